// A guide into caustics, found by photons before the render.
#pragma once

#include <memory>

#include "guide/caustic_guide.hpp"
#include "render/task_function.hpp"

namespace primray {

// What photons find; null where there are no caustics to speak of. A function of scene and depth alone, not of seed, threads or
// lanes, so that every part of a render has the same one.
std::unique_ptr<CausticGuide> find_caustics(const Scene& scene, int max_depth, int threads);

// The same; null also where it would not pay.
std::unique_ptr<CausticGuide> learn_caustics(const Scene& scene, int max_depth, int threads, TaskFunction task);

}  // namespace primray
