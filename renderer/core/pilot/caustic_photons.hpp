// Photons from small lights over smooth surfaces: what a CausticGuide is made of.
#pragma once

#include <vector>

#include "guide/caustic_tree.hpp"
#include "scene/scene.hpp"

namespace primray {

// Those that landed on surfaces which scatter widely, after one smooth surface at least and `longest` - 1 at most. Empty where
// no small light meets a smooth surface. A function of scene and depth alone; threads show in no bit.
std::vector<CausticPhoton> trace_photons(const Scene& scene, int longest, int threads);

}  // namespace primray
