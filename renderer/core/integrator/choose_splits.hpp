// Whether paths should split at their first surface: measured on a few pixels before the render.
#pragma once

#include "integrator/task_function.hpp"

namespace primray {

// Paths to go on from the first surface, 1, 2, 4 or 8, by error per ray. A function of scene, depth and guide, not of seed,
// samples, threads or lanes, so that every part of a render comes to the same answer.
int choose_splits(const Scene& scene, const IntegratorSettings& settings, TaskFunction task);

}  // namespace primray
