// Photons from small lights over smooth surfaces, from which a CausticGuide is built.
#pragma once

#include <vector>

#include "guide/caustic_tree.hpp"
#include "scene/scene.hpp"

namespace primray {

// Traces photons and returns those that landed on surfaces which scatter widely, after at least one and at most `longest` - 1
// smooth surfaces. Empty if no small light reaches a smooth surface. A function of scene and depth alone; threads do not change
// a bit.
std::vector<CausticPhoton> trace_photons(const Scene& scene, int longest, int threads);

}  // namespace primray
