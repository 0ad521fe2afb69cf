// Guide for caustics, learnt from photons before the render.
#pragma once

#include <memory>

#include "guide/caustic_guide.hpp"
#include "render/task_function.hpp"

namespace primray {

// Returns the guide, or null if there are no significant caustics. A function of scene and depth alone, not of seed, threads or
// lanes, so that every part of a distributed render has the same one.
std::unique_ptr<CausticGuide> find_caustics(const Scene& scene, int max_depth, int threads);

// Returns the guide, or null if it would not pay.
std::unique_ptr<CausticGuide> learn_caustics(const Scene& scene, int max_depth, int threads, TaskFunction task);

}  // namespace primray
