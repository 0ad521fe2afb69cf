// Rendering a scene into a film: threads, tasks and their order, progress and cancellation.
#pragma once

#include <atomic>
#include <functional>
#include <memory>

#include "integrator/task_function.hpp"

namespace primray {

// Called now and then from the calling thread with the fraction done; false stops the render.
using Progress = std::function<bool(double fraction)>;

struct RenderStatistics {
  bool interrupted = false;
  double lane_occupancy = 0;  // paths over lanes in the shading steps
  double seconds = 0;
  int splits = 1;
};

// W = `lanes` paths at a time (1, 4, 8 or 16; those this module was built with). The film must be of the camera's size. What is
// in it after an interruption is valid: every pixel has its own counts.
RenderStatistics render(const Scene& scene, const IntegratorSettings& settings, int lanes, Film& film, const Progress& progress,
                        RayRecorder* recorder = nullptr);

}  // namespace primray
