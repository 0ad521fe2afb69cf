// What the first surface is worth: measured on a few pixels before the render.
#pragma once

#include "render/task_function.hpp"

namespace primray {

// Paths to go on from the first surface, 1, 2, 4 or 8, and samples of lights to be taken there, 1, 2 or 4.
struct Splits {
  int paths = 1, lights = 1;
};

// By error per ray. A function of scene, depth and guide, not of seed, samples, threads or lanes, so that every part of a
// render comes to the same answer.
Splits choose_splits(const Scene& scene, const IntegratorSettings& settings, TaskFunction task);

}  // namespace primray
