// Order of a pool's paths before they are shaded: by surface, in scenes of six surfaces or more. A packet
// evaluates the inputs of each surface that it holds in a pass of its own (surface/evaluate_inputs.hpp), and each lobe that one
// of them has.
//
// The order is stable and a function of the pool's hits alone, so paths of one sample are in the same order for every number of
// lanes.
#pragma once

#include <algorithm>

#include "integrator/round.hpp"
#include "surface/interaction.hpp"

namespace primray {

// Numbers of what is sorted behind triangles: shapes that are none, and paths that hit nothing.
constexpr int kCurved = 0x7ffffffe, kMissed = 0x7fffffff;
constexpr int kSortKeys = 256;

template <int W>
PRIMRAY_INLINE vint<W> surfaces_of(const Scene& scene, vbool<W> active, const Hits<W>& h) {
  using I = vint<W>;
  const vbool<W> hit = active & (h.geom != I(-1));
  I surface(kMissed);
  if (!any(hit)) return surface;
  const HitGroup<W> in(scene, hit, h);
  const vbool<W> triangles = in.is_triangle(scene, hit);
  surface = select(hit, I(kCurved), surface);
  if (!any(triangles)) return surface;
  const I mesh = gather<W>(scene.triangle_mesh.data(), in.triangle(scene, triangles, h));
  return select(triangles, gather<W>(scene.meshes.surface.data(), mesh), surface);
}

// Order of increasing numbers, or of runs of 2^shift of them where there are many; equal ones keep theirs. Padding is 0.
__attribute__((noinline)) inline void order_by(const int32_t* numbers, int count, int shift, int32_t* order) {
  const auto key = [&](int i) {
    const int n = numbers[i];
    return n >= kCurved ? kSortKeys - 1 - (kMissed - n) : std::min(n >> shift, kSortKeys - 3);
  };
  int ends[kSortKeys + 1] = {};
  for (int i = 0; i < count; ++i) ++ends[key(i) + 1];
  for (int k = 0; k < kSortKeys; ++k) ends[k + 1] += ends[k];
  for (int i = 0; i < count; ++i) order[ends[key(i)]++] = i;
  std::fill(order + count, order + kPadded - kPool + count, 0);
}

PRIMRAY_RARE void sort_hits(Round& round) {
  constexpr int W = 8;
  PathPool& pool = *round.worker.pool;
  const int count = pool.count;
  alignas(64) int32_t numbers[kPadded], order[kPadded];
  for (int at = 0; at < count; at += W)
    store(numbers + at, surfaces_of(round.scene, lane_numbers<W>() < vint<W>(count - at), pool.hits<W>(at)));
  order_by(numbers, count, round.scene.sort_shift, order);
  pool.reorder(order, round.needs, round.scene.few_triangles.any() || round.scene.triangle_bvh.any());
  if (round.follows_media()) round.worker.medium_states->pool->reorder(order, count);
}

}  // namespace primray
