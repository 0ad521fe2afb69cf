// Construction of the scene's EmitterTable.
#pragma once

namespace primray {

struct Scene;

// Finds emissive geometry and adds its rows to the scene's lights; after the last shape and placement.
void build_emitters(Scene& scene);

}  // namespace primray
