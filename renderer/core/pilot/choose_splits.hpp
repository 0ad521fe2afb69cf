// Number of paths and light samples at the first surface, measured on a few pixels before the render.
#pragma once

#include "render/task_function.hpp"

namespace primray {

// Paths that continue from the first surface (1, 2, 4 or 8), and light samples taken there (1, 2 or 4).
struct Splits {
  int paths = 1, lights = 1;
};

// Chooses by error per ray. A function of scene, depth and guide, not of seed, samples, threads or lanes, so that every part of
// a distributed render makes the same choice.
Splits choose_splits(const Scene& scene, const IntegratorSettings& settings, TaskFunction task);

}  // namespace primray
