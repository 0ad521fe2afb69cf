// What the camera sees straight ahead: alpha of samples that escape through surfaces, gaps, surfaces hidden from camera rays,
// and mattes (holdouts).
//
// Alpha of a sample is 1 once its camera ray hits something, minus the part that escapes straight through it
// (integrator/tile_task.hpp).
#pragma once

#include "integrator/vertex.hpp"

namespace primray {

// Samples that escape through transparent surfaces do not contribute to alpha.
template <int W>
PRIMRAY_RARE void reduce_alpha(Round& round, vbool<W> escaped, const PathLanes<W>& p) {
  for (uint32_t b = bits(escaped); b; b &= b - 1) {
    const int k = __builtin_ctz(b);
    const float part = (p.beta.x[k] + p.beta.y[k] + p.beta.z[k]) * (1.0f / 3);
    alpha_of(round, p.slot[k]) -= part;
    if (round.deep) round.deep->cover(p.slot[k], -part);
  }
}

// Removes from alpha samples that escape straight: those that passed only gaps, and those that see no light (`nothing`).
template <int W>
PRIMRAY_RARE void reduce_alpha_of_escaped(Round& round, vbool<W> escaped, vbool<W> nothing, const PathLanes<W>& p) {
  const uint32_t unlit = bits(nothing);
  for (uint32_t b = bits(escaped); b; b &= b - 1) {
    const int k = __builtin_ctz(b);
    float& a = alpha_of(round, p.slot[k]);
    if (a < kThroughGaps && !(unlit >> k & 1)) continue;
    const float part = (p.beta.x[k] + p.beta.y[k] + p.beta.z[k]) * (1.0f / 3);
    a -= part;
    if (round.deep) round.deep->cover(p.slot[k], -part);
  }
}

// Marks the samples of camera rays that pass only gaps: surfaces that are not present, or hidden from the camera
// (integrator/tile_task.hpp).
template <int W>
PRIMRAY_RARE void mark_gaps(Round& round, vbool<W> gaps, const PathLanes<W>& p) {
  for (uint32_t b = bits(gaps & (p.vertex == vint<W>(0))); b; b &= b - 1) {
    float& a = alpha_of(round, p.slot[__builtin_ctz(b)]);
    if (a < kThroughGaps) a += kGapMark;
  }
}

// Clears the gap marks of camera rays that hit something, which covers their samples.
template <int W>
PRIMRAY_RARE void clear_gap_marks(Round& round, vbool<W> hit, const PathLanes<W>& p) {
  for (uint32_t b = bits(hit); b; b &= b - 1) {
    float& a = alpha_of(round, p.slot[__builtin_ctz(b)]);
    if (a >= kThroughGaps) a -= kGapMark;
  }
}

// Updates the gap marks of camera rays that pass straight through `v`: set for a gap, cleared for a transmissive surface.
template <int W, class Lobes>
PRIMRAY_RARE void update_gap_marks(Round& round, vbool<W> straight, const Vertex<W, Lobes>& v, const BsdfSample<W>& s,
                                   const PathLanes<W>& p) {
  if constexpr (requires { v.bsdf.presence; }) {
    const vfloat<W> one(1.0f);
    const vbool<W> gap = straight & (v.bsdf.presence < one) & (s.weight.x == one) & (s.weight.y == one) & (s.weight.z == one);
    mark_gaps(round, gap, p);
    clear_gap_marks(round, straight & !gap, p);
  }
}

// Passes the boundaries of volumes straight, into the volume or out of it, and removes them from `hit`. What the camera sees
// through them has the alpha of what is seen through a gap, less what the media extinguish.
template <int W>
PRIMRAY_RARE void pass_volumes(Round& round, int at, const PathLanes<W>& p, const SurfaceHit<W>& surface, vbool<W>& hit) {
  const vbool<W> m = bounds_volume(round.scene, hit, surface.it.surface);
  if (!any(m)) return;
  hit &= !m;
  if (PathLog* const log = path_log<W>(round)) log->add("pass", p).why = "the surface only bounds a volume";
  mark_gaps(round, m & (p.depth == vint<W>(0)), p);
  MediumStateStore& media = *round.worker.medium_states;
  MediumState<W> state = media.pool->template at<W>(at);
  cross_boundaries(round.scene, media.sets, m, surface.hits, surface.it.surface, surface.front, state.volumes);
  // The origin stays: an offset would skip surfaces that are almost where the boundary is, such as the walls of a room full of
  // fog. Media are counted from the boundary on. To hit it twice changes nothing.
  state.origin_distance = -surface.hits.t;
  PathLanes<W> n = p;
  n.ray.tnear = behind_boundary(surface.hits.t, surface.it.offset);
  n.vertex = p.vertex + vint<W>(1);
  const Compaction<W> c(m);
  media.next->put(round.worker.next->count, c, state);
  round.worker.next->append(c, n, round.needs);
}

// Handles surfaces hidden from camera rays and mattes: paths of lanes `hit` pass hidden surfaces straight; a matte covers
// nothing of its pixel, and its paths end. Removes both from `hit`. `at`: position of the paths in the pool.
template <int W>
PRIMRAY_RARE void apply_camera_visibility(Round& round, int at, const PathLanes<W>& p, const SurfaceHit<W>& surface,
                                          vbool<W>& hit) {
  const CameraVisibilityTable& visibility = round.scene.camera_visibility;
  const vbool<W> looks = hit & (p.depth == vint<W>(0));
  if (const vbool<W> matte = visibility.lanes_with(CameraVisibility::kMatte, looks, surface.it.surface); any(matte)) {
    reduce_alpha(round, matte, p);
    hit &= !matte;
    if (PathLog* const log = path_log<W>(round)) log->end(p, "a matte ends it");
  }
  const vbool<W> hidden = visibility.lanes_with(CameraVisibility::kHidden, looks, surface.it.surface);
  if (!any(hidden)) return;
  hit &= !hidden;
  if (PathLog* const log = path_log<W>(round)) log->add("pass", p).why = "the surface is hidden from the camera";
  mark_gaps(round, hidden, p);
  if (!round.follows_media()) return continue_straight(round, hidden, p, surface);
  const MediumState<W> state = round.worker.medium_states->pool->template at<W>(at);
  continue_straight(round, hidden, p, surface, &state);
}

}  // namespace primray
