// Threads of first_hit.hpp: they take tiles in any order; a pixel is written by one of them.
#include "aov/first_hit.hpp"

#include <algorithm>
#include <atomic>
#include <string>
#include <thread>

#include "aov/first_hit_task.hpp"
#include "base/error.hpp"
#include "base/time_spans.hpp"
#include "film/film.hpp"
#include "render/task_function.hpp"

namespace primray {

// Compiled in first_hit_fewer_lanes.cpp.
extern template void fill_first_hits<1>(const Scene&, const PixelRect&, FirstHitPlanes&);
extern template void fill_layers<1>(const Scene&, size_t, LayerPoints&);
#if PRIMRAY_MAX_LANES > 4
extern template void fill_first_hits<4>(const Scene&, const PixelRect&, FirstHitPlanes&);
extern template void fill_layers<4>(const Scene&, size_t, LayerPoints&);
#endif
#if PRIMRAY_MAX_LANES > 8
extern template void fill_first_hits<8>(const Scene&, const PixelRect&, FirstHitPlanes&);
extern template void fill_layers<8>(const Scene&, size_t, LayerPoints&);
#endif

namespace {

// What one lane count is compiled to.
struct Kernel {
  void (*fill_rect)(const Scene&, const PixelRect&, FirstHitPlanes&);
  void (*fill_layers)(const Scene&, size_t, LayerPoints&);
};

template <int W>
constexpr Kernel kKernel{fill_first_hits<W>, fill_layers<W>};

Kernel kernel_of(int lanes) {
  switch (lanes) {
    case 1:
      return kKernel<1>;
    case 4:
      return kKernel<4>;
#if PRIMRAY_MAX_LANES >= 8
    case 8:
      return kKernel<8>;
#endif
#if PRIMRAY_MAX_LANES >= 16
    case 16:
      return kKernel<16>;
#endif
  }
  throw Error("settings-error", "this build has no kernel for " + std::to_string(lanes) + " lanes");
}

}  // namespace

void find_first_hits(const Scene& scene, int lanes, int threads, int first_row, int end_row, FirstHitPlanes& planes) {
  const auto fill_rect = kernel_of(lanes).fill_rect;
  const int width = scene.camera.pixels.width, end = std::min(end_row, scene.camera.pixels.height);
  const int across = (width + kTile - 1) / kTile, down = (std::max(end - first_row, 0) + kTile - 1) / kTile;
  std::atomic<int> next{0};
  const auto work = [&] {
    const TimeSpan span("find first hits");
    set_float_mode();
    for (int i; (i = next++) < across * down;) {
      const int x = i % across * kTile, y = first_row + i / across * kTile;
      fill_rect(scene, {x, y, std::min(x + kTile, width), std::min(y + kTile, end)}, planes);
    }
  };
  std::vector<std::thread> pool;
  for (int i = 0; i < std::clamp(threads, 1, std::max(across * down, 1)); ++i) pool.emplace_back(work);
  for (std::thread& t : pool) t.join();
}

void find_layers(const Scene& scene, int lanes, int threads, LayerPoints& points) {
  const auto fill = kernel_of(lanes).fill_layers;
  const size_t tasks = (points.x.size() + LayerPoints::kTask - 1) / LayerPoints::kTask;
  points.count.assign(points.x.size(), 0), points.by_task.assign(tasks, {});
  std::atomic<size_t> next{0};
  const auto work = [&] {
    const TimeSpan span("find layers");
    set_float_mode();
    for (size_t i; (i = next++) < tasks;) fill(scene, i, points);
  };
  std::vector<std::thread> pool;
  for (size_t i = 0; i < std::clamp(size_t(std::max(threads, 1)), size_t(1), std::max(tasks, size_t(1))); ++i)
    pool.emplace_back(work);
  for (std::thread& t : pool) t.join();
}

}  // namespace primray
