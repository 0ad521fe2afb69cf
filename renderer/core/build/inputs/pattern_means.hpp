// What patterns are on average, by trying them on the shapes that wear them: what chooses among emitters, and photons, go by
// it.
#pragma once

#include "scene/scene.hpp"

namespace primray {

// Sets `fallback` of the inputs that read a tape, of surfaces that some triangles wear; others keep theirs.
void note_pattern_means(Scene& scene);

}  // namespace primray
