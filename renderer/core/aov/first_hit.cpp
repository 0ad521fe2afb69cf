// Threads of first_hit.hpp: they take tiles in any order; a pixel is written by one of them.
#include "aov/first_hit.hpp"

#include <algorithm>
#include <atomic>
#include <limits>
#include <numeric>
#include <string>
#include <thread>
#include <unordered_map>

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
  planes.presence_varies = presence_varies(scene);
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

bool presence_varies(const Scene& scene) {
  return std::any_of(scene.surface_inputs.begin(), scene.surface_inputs.end(),
                     [](const SurfaceInputs& inputs) { return inputs.constants.presence; });
}

void find_layers(const Scene& scene, int lanes, int threads, LayerPoints& points) {
  points.presence_varies = presence_varies(scene);
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

namespace {

// Numbers parts in the order in which they are asked for.
class PartNumbers {
 public:
  using Part = std::array<int32_t, 3>;

  int32_t operator()(const Part& part) {
    if (last_ >= 0 && parts[size_t(last_)] == part) return last_;  // neighbouring rays mostly pass the same
    const auto [at, is_new] = numbers_.try_emplace(part, int32_t(parts.size()));
    if (is_new) parts.push_back(part);
    return last_ = at->second;
  }
  std::vector<Part> parts;

 private:
  struct Hash {
    size_t operator()(const Part& p) const {
      uint64_t h = 0;
      for (const int32_t x : p) h = (h ^ uint32_t(x)) * 0x9e3779b97f4a7c15u, h ^= h >> 32;
      return size_t(h);
    }
  };

  std::unordered_map<Part, int32_t, Hash> numbers_;
  int32_t last_ = -1;
};

}  // namespace

NumberedLayers numbered(const LayerPoints& points) {
  NumberedLayers found;
  const size_t n = points.count.size();
  found.first.assign(n, -1), found.depth.assign(n, std::numeric_limits<float>::infinity());
  found.begin.reserve(n + 1);
  PartNumbers number;
  size_t point = 0;
  for (const std::vector<Layer>& task : points.by_task) {
    const Layer* layer = task.data();
    for (const size_t end = std::min(point + LayerPoints::kTask, n); point < end; ++point) {
      found.begin.push_back(uint32_t(found.numbers.size()));
      if (points.count[point] > 0) found.depth[point] = layer->depth;
      for (uint32_t k = 0; k < points.count[point]; ++k, ++layer)
        found.numbers.push_back(number({layer->shape, layer->instance, layer->outer}));
    }
  }
  found.begin.push_back(uint32_t(found.numbers.size()));

  // Number the parts in their own order, which does not depend on that of the rays
  std::vector<int32_t> order(number.parts.size()), rank(number.parts.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](int32_t a, int32_t b) { return number.parts[size_t(a)] < number.parts[size_t(b)]; });
  for (size_t k = 0; k < order.size(); ++k) {
    rank[size_t(order[k])] = int32_t(k);
    found.parts.push_back(number.parts[size_t(order[k])]);
  }
  for (int32_t& part : found.numbers) part = rank[size_t(part)];
  for (size_t k = 0; k < n; ++k)
    if (points.count[k] > 0) found.first[k] = found.numbers[found.begin[k]];
  return found;
}

namespace {

// Calls f(thing, ray, is_first) once for each thing that a ray passes.
template <class F>
void for_things_passed(const NumberedLayers& layers, std::span<const int32_t> places, std::span<const int32_t> parents,
                       const F& f) {
  std::vector<uint32_t> latest(parents.size());  // the latest ray that passed a thing, from 1
  for (size_t ray = 0; ray < layers.first.size(); ++ray)
    for (uint32_t k = layers.begin[ray]; k < layers.begin[ray + 1]; ++k)
      // What holds a thing that the ray has passed before has been visited with it.
      for (int32_t at = places[size_t(layers.numbers[k])]; at >= 0 && latest[size_t(at)] != ray + 1; at = parents[size_t(at)]) {
        latest[size_t(at)] = uint32_t(ray + 1);
        f(at, ray, k == layers.begin[ray]);
      }
}

}  // namespace

RayCounts rays_by_thing(const NumberedLayers& layers, std::span<const int32_t> places, std::span<const int32_t> parents) {
  RayCounts counts{std::vector<int64_t>(parents.size()), std::vector<int64_t>(parents.size())};
  for_things_passed(layers, places, parents, [&](int32_t thing, size_t, bool is_first) {
    ++counts.passing[size_t(thing)], counts.first[size_t(thing)] += is_first;
  });
  return counts;
}

std::vector<std::array<int32_t, 2>> rays_passing_things(const NumberedLayers& layers, std::span<const int32_t> places,
                                                        std::span<const int32_t> parents) {
  std::vector<std::array<int32_t, 2>> found;
  for_things_passed(layers, places, parents, [&](int32_t thing, size_t ray, bool) { found.push_back({thing, int32_t(ray)}); });
  return found;
}

}  // namespace primray
