// Tracing stages of a round: intersects the pool's rays with the scene; later traces the queued shadow rays and adds the
// contributions that arrive to their samples.
#pragma once

#include <algorithm>

#include "accel/query.hpp"
#include "bvh/interleaved.hpp"
#include "integrator/rays/path_pool.hpp"
#include "integrator/rays/ray_recorder.hpp"
#include "integrator/rays/shadow_rays.hpp"
#include "integrator/round.hpp"

namespace primray {

// Stream traversal: traces all rays of a pool or of a shadow queue at once with the interleaved traversal
// (bvh/interleaved.hpp).
template <int W, class Rays>
void record_stream(RayRecorder& recorder, bool shadow, const Rays& rays) {
  for (int at = 0; at < rays.count; at += W)
    recorder.record(shadow, true, lane_numbers<W>() < vint<W>(rays.count - at), rays.template rays<W>(at));
}

// Traces the pool's rays and stores the hits in the pool.
template <int W>
void trace_stream(const TriangleBvh& bvh, RayRecorder* recorder, PathPool& pool) {
  if (recorder) record_stream<W>(*recorder, false, pool);
  intersect_interleaved(bvh, uint32_t(pool.count), pool.ray_columns(), pool.hit_columns());
}

// Traces the queue's shadow rays; `blocked` is set to 1 or 0 for each.
template <int W>
void occlude_stream(const TriangleBvh& bvh, RayRecorder* recorder, const ShadowQueue& queue, int32_t* blocked) {
  if (recorder) record_stream<W>(*recorder, true, queue);
  occluded_interleaved(bvh, uint32_t(queue.count), queue.ray_columns(), blocked);
}

// Stage of a round: intersects the pool's rays with the scene.
template <int W>
void trace(Round& round) {
  Worker& w = round.worker;
  PathPool& pool = *w.pool;
  if (round.scene.triangle_bvh.any()) return trace_stream<W>(round.scene.triangle_bvh, round.recorder, pool);
  for (int at = 0; at < pool.count; at += W) {
    const vbool<W> active = lane_numbers<W>() < vint<W>(pool.count - at);
    Rays<W> rays = pool.rays<W>(at);
    if (round.needs.time) rays.time = load<W>(pool.time + at);
    PacketChoice& entry = at >= round.first_camera ? w.camera_entry : w.scattered_entry;
    const bool packet = entry.packet();
    if (round.recorder) round.recorder->record(false, packet, active, rays);
    const uint64_t start = entry.measuring() ? PacketChoice::now() : 0;
    const Hits<W> hits = intersect(round.scene, packet, active, rays);
    if (entry.measuring()) entry.record(PacketChoice::now() - start, std::min(W, pool.count - at));
    pool.set_hits(at, hits);
  }
}

// Radiance that the rays from `at` on carry.
template <int W>
PRIMRAY_INLINE vvec3<W> carried_at(const ShadowQueue& q, int at) {
  return {load<W>(q.r + at), load<W>(q.g + at), load<W>(q.b + at)};
}

// Returns which part of what shadow rays carried arrives, by channel.
template <int W>
vvec3<W> visible_part(vbool<W> arrives, const vvec3<W>& left, const vvec3<W>& carried) {
  const auto part = [&](vfloat<W> a, vfloat<W> of) { return select(arrives & (of > vfloat<W>(0.0f)), a / of, 0.0f); };
  return {part(left.x, carried.x), part(left.y, carried.y), part(left.z, carried.z)};
}

template <int W>
PRIMRAY_RARE void trace_shadow_stream(Round& round) {
  const ShadowQueue& q = round.worker.shadows;
  alignas(64) int32_t blocked[ShadowQueue::kSize];
  occlude_stream<W>(round.scene.triangle_bvh, round.recorder, q, blocked);
  for (int at = 0; at < q.count; at += W) {
    const vbool<W> open = (lane_numbers<W>() < vint<W>(q.count - at)) & (load<W>(blocked + at) == vint<W>(0));
    if (PathLog* const log = path_log<W>(round)) log->arrive(log->shadows, at, select(open, vvec3<W>(1.0f), vvec3<W>(0.0f)));
    add_to_slots(round, open, load<W>(q.slot + at), carried_at<W>(q, at));
    if (LpeStore* const lpe = round.worker.lpe.get(); lpe && round.needs.lpe)
      add_arrived(*lpe, lpe->shadows, at, open, load<W>(q.slot + at), carried_at<W>(q, at), vint<W>(0));
  }
}

template <int W>
PRIMRAY_RARE vbool<W> pass_thin_shadows(Round& round, int at, vbool<W> active, const Rays<W>& rays, vvec3<W>& carried,
                                        vint<W>* passed) {
  ShadowMedia<W> media;
  if (round.follows_media())
    media = round.worker.medium_states->shadows.at<W>(at), media.sets = &round.worker.medium_states->sets;
  return pass_thin(round.scene, round.recorder, active, rays, carried, round.follows_media() ? &media : nullptr, passed);
}

// Adds what arrives along the shadow rays from `at` on: `left` of what they carried, in lanes `arrives`. `passed`: number of
// surfaces that each has passed straight.
template <int W>
PRIMRAY_INLINE void arrive(Round& round, int at, vbool<W> arrives, const vvec3<W>& left, vint<W> passed) {
  Worker& w = round.worker;
  const ShadowQueue& q = w.shadows;
  if (PathLog* const log = path_log<W>(round)) log->arrive(log->shadows, at, visible_part(arrives, left, carried_at<W>(q, at)));
  add_to_slots(round, arrives, load<W>(q.slot + at), left);
  if (round.needs.lpe) add_arrived(*w.lpe, w.lpe->shadows, at, arrives, load<W>(q.slot + at), left, passed);
}

// The same for rays towards special lights.
template <int W>
PRIMRAY_RARE void arrive_special(Round& round, int at, vbool<W> active, const vvec3<W>& left, vint<W> passed) {
  const ShadowQueue& q = round.worker.special_shadows->rays;
  if (PathLog* const log = path_log<W>(round))
    log->arrive(log->special_shadows, at, visible_part(active, left, carried_at<W>(q, at)));
  add_to_slots(round, active, load<W>(q.slot + at), left);
  if (LpeStore* const lpe = round.worker.lpe.get(); lpe && round.needs.lpe)
    add_arrived(*lpe, lpe->special_shadows, at, active, load<W>(q.slot + at), left, passed);
}

// Attenuates what is left of a queue's rays by the volumes, and lets it arrive.
template <int W, class Arrive>
PRIMRAY_RARE void arrive_through_volumes(Round& round, const ShadowQueue& q, const Arrive& arrive_at) {
  VolumeState& state = *round.worker.volumes;
  attenuate_shadows<W>(*round.scene.volumes, state, q, round.needs.time);
  for (int at = 0; at < q.count; at += W) {
    const vbool<W> active = lane_numbers<W>() < vint<W>(q.count - at);
    arrive_at(at, active & (load<W>(state.shadow_end + at) > vfloat<W>(0.0f)), state.left_at<W>(at),
              load<W>(state.passed + at));
  }
}

template <int W>
void trace_shadow_lanes(Round& round) {
  Worker& w = round.worker;
  const ShadowQueue& q = w.shadows;
  const bool volumes = round.has_volumes();
  // Rays that leave a fibre are let out by a filter (accel/cutout.cpp).
  const bool hits = round.scene.has_thin && round.scene.shadows_need_hits;
  for (int at = 0; at < q.count; at += W) {
    const vbool<W> active = lane_numbers<W>() < vint<W>(q.count - at);
    Rays<W> rays = q.rays<W>(at);
    if (round.needs.time) rays.time = load<W>(q.time + at);
    vvec3<W> carried = carried_at<W>(q, at);
    vint<W> passed(0);
    vbool<W> blocked;
    if (hits) {
      blocked = !pass_thin_shadows(round, at, active, rays, carried, round.needs.lpe ? &passed : nullptr);
    } else {
      const bool packet = w.shadow_entry.packet(), measuring = w.shadow_entry.measuring();
      if (round.recorder) round.recorder->record(true, packet, active, rays);
      const uint64_t start = measuring ? PacketChoice::now() : 0;
      blocked = occluded(round.scene, packet, active, rays);
      if (measuring) w.shadow_entry.record(PacketChoice::now() - start, std::min(W, q.count - at));
    }
    if (volumes)
      w.volumes->put_left(at, active & !blocked, carried, rays.tfar, passed);
    else
      arrive(round, at, active & !blocked, carried, passed);
  }
  if (volumes)
    arrive_through_volumes<W>(round, q, [&](int at, vbool<W> arrives, const vvec3<W>& left, vint<W> passed) {
      arrive(round, at, arrives, left, passed);
    });
}

template <int W>
void trace_special_shadows(Round& round) {
  const SpecialShadowQueue& q = *round.worker.special_shadows;
  round.worker.shadow_rays += q.rays.count;
  const bool volumes = round.has_volumes();
  for (int at = 0; at < q.rays.count; at += W) {
    const vbool<W> active = lane_numbers<W>() < vint<W>(q.rays.count - at);
    const vvec3<W> carried = carried_at<W>(q.rays, at);
    const vint<W> light = select(active, load<W>(q.light + at), vint<W>(q.light[at]));
    Rays<W> rays = q.rays.rays<W>(at);
    if (round.needs.time) rays.time = load<W>(q.rays.time + at);
    ShadowMedia<W> media;
    const bool follows = round.follows_media() && round.scene.shadows_need_hits;
    if (follows) media = round.worker.medium_states->special_shadows.at<W>(at), media.sets = &round.worker.medium_states->sets;
    vint<W> passed(0);
    const vvec3<W> left = pass_special(round.scene, round.recorder, active, rays, light, follows ? &media : nullptr,
                                       round.needs.lpe ? &passed : nullptr);
    if (volumes)
      round.worker.volumes->put_left(at, active, carried * left, rays.tfar, passed);
    else
      arrive_special(round, at, active, carried * left, passed);
  }
  if (volumes)
    arrive_through_volumes<W>(round, q.rays, [&](int at, vbool<W> arrives, const vvec3<W>& left, vint<W> passed) {
      arrive_special(round, at, arrives, left, passed);
    });
}

template <int W>
void trace_shadows(Round& round) {
  round.worker.shadow_rays += round.worker.shadows.count;
  round.scene.triangle_bvh.any() && !round.scene.shadows_need_hits && !round.has_volumes() ? trace_shadow_stream<W>(round)
                                                                                           : trace_shadow_lanes<W>(round);
  if (round.has_special()) trace_special_shadows<W>(round);
}

}  // namespace primray
