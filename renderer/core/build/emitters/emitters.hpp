// Fills the scene's EmitterTable.
#pragma once

namespace primray {

struct Scene;

// Finds what emits and adds its rows to the scene's lights; after the last shape and placement.
void build_emitters(Scene& scene);

}  // namespace primray
