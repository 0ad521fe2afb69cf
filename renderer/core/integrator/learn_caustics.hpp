// A guide into caustics, found by photons before the render.
#pragma once

#include <memory>

#include "integrator/task_function.hpp"
#include "light/caustic_guide.hpp"

namespace primray {

// Null where there are none to speak of. A function of scene and depth alone, not of seed, threads or lanes, so that every part
// of a render has the same one.
std::unique_ptr<CausticGuide> learn_caustics(const Scene& scene, int max_depth, int threads);

}  // namespace primray
