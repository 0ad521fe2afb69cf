// Rendering a pass: every tile's sample sequences taken as far as asked, by threads; progress and cancellation.
#pragma once

#include <functional>
#include <span>

#include "render/task_function.hpp"

namespace primray {

// Called now and then from the calling thread with the fraction done; false stops the pass.
using Progress = std::function<bool(double fraction)>;

struct PassStatistics {
  bool interrupted = false;
  int64_t busy_lanes = 0, shaded_lanes = 0;  // paths, and lanes that were there for them, in the shading steps
  double seconds = 0;
};

// Takes every tile's sequence of each replicate from where it stands in the film (`film.next`) to `ends` (replicate, tile),
// with W = `lanes` paths at a time (1, 4, 8 or 16; those this module was built with). The film must be of the camera's size.
// After an interruption it holds whole tasks; another pass goes on from there to the same bits. settings.splits must be chosen.
PassStatistics render_pass(const Scene& scene, const IntegratorSettings& settings, int lanes, std::span<const uint32_t> ends,
                           Film& film, const Progress& progress, RayRecorder* recorder = nullptr);

// The kernel of a number of lanes; an Error if this module has none.
TaskFunction kernel_of(int lanes);

}  // namespace primray
