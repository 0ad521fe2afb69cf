// Guide learnt from paths before the render.
#pragma once

#include <memory>

#include "guide/guide.hpp"
#include "render/task_function.hpp"

namespace primray {

// Returns the guide, or null if it would not pay. A function of scene, depth and settings.splits (which must be chosen) alone,
// not of seed, threads or lanes, so that every part of a distributed render has the same one.
std::unique_ptr<Guide> learn_guide(const Scene& scene, const IntegratorSettings& settings, TaskFunction task);

}  // namespace primray
