// Last stage of a round: traces the queued shadow rays and adds the contributions that arrive to their samples.
#pragma once

#include <algorithm>

#include "path/rays/ray_streams.hpp"
#include "path/rays/shadow_rays.hpp"
#include "path/round.hpp"

namespace primray {

// Radiance that the rays from `at` on carry.
template <int W>
PRIMRAY_INLINE vvec3<W> carried_at(const ShadowQueue& q, int at) {
  return {load<W>(q.r + at), load<W>(q.g + at), load<W>(q.b + at)};
}

template <int W>
PRIMRAY_RARE void trace_shadow_stream(Round& round) {
  const ShadowQueue& q = round.worker.shadows;
  alignas(64) int32_t blocked[ShadowQueue::kSize];
  occlude_stream<W>(round.scene.triangle_bvh, round.recorder, q, blocked);
  for (int at = 0; at < q.count; at += W) {
    const vbool<W> open = (lane_numbers<W>() < vint<W>(q.count - at)) & (load<W>(blocked + at) == vint<W>(0));
    add_to_slots(round, open, load<W>(q.slot + at), carried_at<W>(q, at));
    if (RouteStore* const routes = round.worker.routes.get(); routes && round.needs.routes)
      add_arrived(*routes, routes->shadows, at, open, load<W>(q.slot + at), carried_at<W>(q, at), vint<W>(0));
  }
}

template <int W>
PRIMRAY_RARE vbool<W> pass_thin_shadows(Round& round, int at, vbool<W> active, const Rays<W>& rays, vvec3<W>& carried,
                                        vint<W>* passed) {
  BodiesAround<W> around;
  if (round.follows_bodies()) around = round.worker.inside->shadows.at<W>(at);
  return pass_thin(round.scene, round.recorder, active, rays, carried, round.follows_bodies() ? &around : nullptr, passed);
}

template <int W>
void trace_shadow_lanes(Round& round) {
  Worker& w = round.worker;
  const ShadowQueue& q = w.shadows;
  for (int at = 0; at < q.count; at += W) {
    const vbool<W> active = lane_numbers<W>() < vint<W>(q.count - at);
    Rays<W> rays = q.rays<W>(at);
    if (round.needs.time) rays.time = load<W>(q.time + at);
    vvec3<W> carried = carried_at<W>(q, at);
    vint<W> passed(0);
    vbool<W> blocked;
    if (round.scene.has_thin) {
      blocked = !pass_thin_shadows(round, at, active, rays, carried, round.needs.routes ? &passed : nullptr);
    } else {
      const bool packet = w.shadow_entry.packet(), measuring = w.shadow_entry.measuring();
      if (round.recorder) round.recorder->record(true, packet, active, rays);
      const uint64_t start = measuring ? EntryChoice::now() : 0;
      blocked = occluded(round.scene, packet, active, rays);
      if (measuring) w.shadow_entry.record(EntryChoice::now() - start, std::min(W, q.count - at));
    }
    add_to_slots(round, active & !blocked, load<W>(q.slot + at), carried);
    if (round.needs.routes)
      add_arrived(*w.routes, w.routes->shadows, at, active & !blocked, load<W>(q.slot + at), carried, passed);
  }
}

template <int W>
void trace_special_shadows(Round& round) {
  const SpecialShadowQueue& q = *round.worker.special_shadows;
  round.worker.shadow_rays += q.rays.count;
  for (int at = 0; at < q.rays.count; at += W) {
    const vbool<W> active = lane_numbers<W>() < vint<W>(q.rays.count - at);
    const vvec3<W> carried = carried_at<W>(q.rays, at);
    const vint<W> light = select(active, load<W>(q.light + at), vint<W>(q.light[at]));
    Rays<W> rays = q.rays.rays<W>(at);
    if (round.needs.time) rays.time = load<W>(q.rays.time + at);
    BodiesAround<W> around;
    const bool follows = round.follows_bodies() && round.scene.has_thin;
    if (follows) around = round.worker.inside->special_shadows.at<W>(at);
    vint<W> passed(0);
    const vvec3<W> left = pass_special(round.scene, round.recorder, active, rays, light, follows ? &around : nullptr,
                                       round.needs.routes ? &passed : nullptr);
    add_to_slots(round, active, load<W>(q.rays.slot + at), carried * left);
    if (RouteStore* const routes = round.worker.routes.get(); routes && round.needs.routes)
      add_arrived(*routes, routes->special_shadows, at, active, load<W>(q.rays.slot + at), carried * left, passed);
  }
}

template <int W>
void trace_shadows(Round& round) {
  round.worker.shadow_rays += round.worker.shadows.count;
  round.scene.triangle_bvh.any() && !round.scene.has_thin ? trace_shadow_stream<W>(round) : trace_shadow_lanes<W>(round);
  if (round.has_special()) trace_special_shadows<W>(round);
}

}  // namespace primray
