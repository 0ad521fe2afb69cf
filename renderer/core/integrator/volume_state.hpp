// State of one worker in scenes with volumes, and how volumes attenuate shadow rays.
#pragma once

#include "integrator/rays/cross_grids.hpp"

namespace primray {

struct VolumeState {
  VolumePasses passes;
  // By path of the pool.
  alignas(64) float end[kPadded], albedo[3][kPadded];
  alignas(64) int32_t instance[kPadded];
  alignas(64) uint32_t number[kPadded];
  alignas(64) float emission[3][kPadded];
  // By shadow ray: what is left of the radiance that it carries, where it ends (0: it is blocked), and how many surfaces it
  // passed.
  alignas(64) float left[3][ShadowQueue::kSize], shadow_end[ShadowQueue::kSize];
  alignas(64) int32_t passed[ShadowQueue::kSize];

  template <int W>
  PRIMRAY_INLINE void put_left(int at, vbool<W> arrives, const vvec3<W>& carried, vfloat<W> tfar, vint<W> passes_surfaces) {
    const vfloat<W> zero(0.0f);
    store(left[0] + at, select(arrives, carried.x, zero)), store(left[1] + at, select(arrives, carried.y, zero));
    store(left[2] + at, select(arrives, carried.z, zero)), store(shadow_end + at, select(arrives, tfar, zero));
    store(passed + at, passes_surfaces);
  }
  template <int W>
  PRIMRAY_INLINE vvec3<W> left_at(int at) const {
    return {load<W>(left[0] + at), load<W>(left[1] + at), load<W>(left[2] + at)};
  }
};

// Seed of the random numbers that a path's ray takes in volumes; a function of the path and its vertex.
template <int W>
PRIMRAY_INLINE vuint<W> volume_seed(vuint<W> seed, vuint<W> reversed_index, vint<W> vertex) {
  return mix(seed ^ mix(reversed_index + bit_cast<vuint<W>>(vertex) * vuint<W>(0x9e3779b9u)));
}

// Stores seeds for the shadow rays of lanes `m`, which are about to be queued.
template <int W>
PRIMRAY_RARE void put_shadow_seeds(vbool<W> m, ShadowQueue& queue, const PathLanes<W>& p) {
  const vuint<W> seed = volume_seed<W>(p.sampler.seed ^ vuint<W>(0x5bd1e995u), p.sampler.reversed_index, p.vertex);
  Compaction<W>(m).append(queue.number + queue.count, seed);
}

// Attenuates what is left of the queue's rays. `has_time`: of the paths (PathNeeds).
template <int W>
PRIMRAY_RARE void attenuate_shadows(const VolumeTable& volumes, VolumeState& state, const ShadowQueue& q, bool has_time) {
  for (int at = 0; at < q.count; at += kPool) {
    const VolumeRays rays{q.ox + at,     q.oy + at,
                          q.oz + at,     q.dx + at,
                          q.dy + at,     q.dz + at,
                          nullptr,       state.shadow_end + at,
                          q.number + at, has_time ? q.time + at : nullptr};
    attenuate<W>(volumes, rays, std::min(kPool, q.count - at), state.passes, state.left[0] + at, state.left[1] + at,
                 state.left[2] + at);
  }
}

}  // namespace primray
