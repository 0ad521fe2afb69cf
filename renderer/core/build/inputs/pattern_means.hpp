// Mean values of patterns, estimated on the shapes that use them: the choice among emitters, and photons, rely on these.
#pragma once

#include "scene/scene.hpp"

namespace primray {

// Sets `fallback` of inputs that read a tape, for surfaces that some triangles have; others keep theirs.
void note_pattern_means(Scene& scene);

}  // namespace primray
