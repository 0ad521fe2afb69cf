// Rendering of a pass: every tile's sample sequences are rendered up to given ends, by threads, with progress and cancellation.
#pragma once

#include <functional>
#include <span>

#include "render/task_function.hpp"

namespace primray {

// Called now and then from the calling thread with the fraction done; false stops the pass.
using Progress = std::function<bool(double fraction)>;

struct PassStatistics {
  bool interrupted = false;
  int64_t busy_lanes = 0, shaded_lanes = 0;  // paths, and lanes that were available for them, in the shading steps
  double seconds = 0;
};

// Renders every tile's sample sequence of each replicate from its position in the film (`film.next`) to `ends` (replicate,
// tile), with W = `lanes` paths at a time (1, 4, 8 or 16; those that this module was built with). The film must have the
// camera's size. After an interruption it holds whole tasks; another pass continues to the same bits. settings.splits must be
// chosen.
PassStatistics render_pass(const Scene& scene, const IntegratorSettings& settings, int lanes, std::span<const uint32_t> ends,
                           Film& film, const Progress& progress, RayRecorder* recorder = nullptr);

// Sample indices [first, end) of one replicate.
struct SampleSpan {
  uint32_t first, end;
};

// Renders these samples of the pixel at (x, y) of the frame, on the calling
// thread with one lane at a time, and adds their events to `log`. The samples
// are those of any render with these settings.
void log_pixel(const Scene& scene, const IntegratorSettings& settings, int x, int y, const SampleSpan (&spans)[kReplicates],
               PathLog& log);

// Kernel for a number of lanes; throws an Error if this module has none.
TaskFunction kernel_of(int lanes);

}  // namespace primray
