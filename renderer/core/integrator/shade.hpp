// Stage of a round at each ray's hit: collects emission, samples lights, and scatters.
#pragma once

#include <algorithm>

#include "integrator/camera_visibility.hpp"
#include "integrator/gather_emission.hpp"
#include "integrator/nested_media.hpp"
#include "integrator/place_in_depth.hpp"
#include "integrator/shade_surface.hpp"
#include "integrator/sort_hits.hpp"

namespace primray {

// Lower limit of the cosine when a ray cone's footprint is projected onto a surface.
constexpr float kGrazing = 0.05f;
// Minimum distance of front and back hits from the ray's origin, in surface offsets: 3 hits in 1e8 rays at a closed box were
// inside it.
constexpr float kAhead = 0.25f, kBackAhead = 16;

// Returns the lanes that hit hair from within.
template <int W>
PRIMRAY_RARE vbool<W> is_within_fibre(const SurfaceHit<W>& surface) {
  return ((surface.rows.flags() & vint<W>(kHair)) != vint<W>(0)) & !surface.front;
}

// Returns the lanes in which the side of the surface that the ray came from is certain. Where rounding hides it, the path ends:
// choosing the wrong side would leak light through the edges of closed surfaces. Uncertain hits are seen edge-on; or lie behind
// the ray's origin (Embree's distance is wrong where the origin is almost in the triangle's plane; the point is not); or lie on
// a back so near to the origin that this may have been on the wrong side of the next face; or lie on the edge of a back-facing
// triangle that the ray would miss a little further inside, which means that it passed the silhouette. Hits on hair from within
// count as certain: their paths continue straight, so that misjudging the side leaks no light.
template <int W>
PRIMRAY_INLINE vbool<W> is_side_certain(Round& round, vbool<W> hit, const PathLanes<W>& p, const SurfaceHit<W>& surface) {
  const Interaction<W>& it = surface.it;
  const vbool<W> behind = !surface.front;
  const vfloat<W> ahead = dot(it.p - p.ray.o, p.ray.d);
  vbool<W> certain =
      (abs(surface.cosine) > it.least_cosine) & (ahead > it.offset * select(behind, vfloat<W>(kBackAhead), vfloat<W>(kAhead)));
  if (const vbool<W> back = hit & it.at_edge & behind; any(back))
    certain &= (!back) | confirm_edge_hit(round, back, p, surface);
  if (!round.scene.surfaces.hair.empty()) certain |= is_within_fibre(surface);
  return certain;
}

// Marks the pixels of camera rays that meet hair in lanes `hit`.
template <int W>
PRIMRAY_RARE void mark_fibres(Round& round, vbool<W> hit, const PathLanes<W>& p, const SurfaceRows<W>& rows) {
  hit &= (p.vertex == vint<W>(0)) & ((rows.flags() & vint<W>(kHair)) != vint<W>(0));
  for (uint32_t b = bits(hit); b; b &= b - 1)
    round.worker.shows_fibres[(p.slot[__builtin_ctz(b)] & kSumMask) % Worker::kSlots / round.samples] = true;
}

// Shades one vertex of the paths at [at, at + W).
template <int W>
void shade_lanes(Round& round, int at, vbool<W> active) {
  using F = vfloat<W>;
  using V = vvec3<W>;
  const Scene& scene = round.scene;
  const IntegratorSettings& settings = round.settings;
  const PathPool& pool = *round.worker.pool;
  const bool in_media = round.follows_media();
  PathLanes<W> p = pool.paths<W>(at, round.needs);
  Hits<W> hits = pool.hits<W>(at);
  hits.time = p.ray.time;
  vbool<W> hit = active & (hits.geom != vint<W>(-1));

  // Gather emission from lights and from the environment
  const vbool<W> looks = in_media ? active & !has_crossed_medium<W>(round, at) : active;
  if (round.deep) place_in_depth(round, active, looks, hit, hits, false, p);
  V gathered = gather_emission(round, active, looks, p, hits, hit);
  if (in_media) gathered = gathered * radiance_scale_at<W>(round, at);
  if (!any(hit)) {
    if (round.needs.lpe) add_recorded_at(round, at, p);
    if (PathLog* const log = path_log<W>(round)) log->end(p, "no surface is hit"), log->events.back().put("radiance", gathered);
    return add_to_slots(round, active, sum_of(round, p.slot, p.depth), p.beta * gathered);
  }

  // Compute the surface interaction, and pass what is hidden from the camera
  SurfaceHit<W> surface(scene, hit, p.ray, hits);
  Interaction<W>& it = surface.it;
  if constexpr (W == 1) {
    if (PathLog* const log = path_log<W>(round)) log_hit(*log, scene, p, surface);
  }
  if (scene.interiors.has_bounded()) pass_volumes(round, at, p, surface, hit);
  if (scene.camera_visibility.any()) apply_camera_visibility(round, at, p, surface, hit);

  // Evaluate textures and primvars
  LaneRows<W> varying;
  if (any_inputs(scene, hit, it.surface)) {
    // Footprint of the ray cone on the surface, whatever the angle.
    const F width = p.cone_width + p.cone_spread * hits.t;
    const F footprint = width * width / max(abs(surface.cosine), kGrazing);
    surface.rows = evaluate_inputs(scene, hit, hits, it.surface, footprint, it.p, it.ng, it.ns, varying);
  }

  // Gather emission from the surface
  if (scene.has_emission) gathered += gather_surface_emission(round, at, hit, surface, p);
  if (PathLog* const log = path_log<W>(round); log && any(max_component(abs(gathered)) > F(0.0f)))
    log->add("gathered", p).put("radiance", gathered);
  add_to_slots(round, active, sum_of(round, p.slot, p.depth), p.beta * gathered);
  if (round.needs.lpe) add_recorded_at(round, at, p), resolve_lpe(p);

  // End paths at the maximum depth, and where the side of the surface is uncertain
  const vbool<W> certain = is_side_certain(round, hit, p, surface);
  const vbool<W> scatters = hit & certain & ((p.depth < vint<W>(settings.max_depth)) | vbool<W>(scene.has_thin));
  if (PathLog* const log = path_log<W>(round); log && any(hit & !scatters))
    log->end(p, any(certain) ? "the maximum depth is reached" : "rounding hides from which side the surface is hit");
  if (!any(in_media ? hit : scatters)) return;

  if (!scene.surfaces.hair.empty()) mark_fibres(round, scatters, p, surface.rows);
  // Sample direct illumination and continue the paths
  const V wo = -p.ray.d;
  surface.set_frame(wo);
  PRIMRAY_ASSERT(are_unit(hit, wo) && are_unit(hit & scatters, surface.ng) && are_unit(hit & scatters, surface.frame.n));
  if (in_media) return shade_in_media(round, at, hit, scatters, p, surface);
  if (!scene.surfaces.hair.empty()) return shade_hair(round, scatters, p, surface);
  if (!scene.surfaces.open_pbr.empty()) return shade_open_pbr(round, scatters, p, surface);
  const MediumInterface<W>* const none = nullptr;
  shade_surface<Bsdf<W>>(round, scatters, p, surface, none);
}

template <int W>
void shade(Round& round) {
  Worker& w = round.worker;
  PathPool& pool = *w.pool;
  if (round.sorts) sort_hits(round);
  for (int at = 0; at < pool.count; at += W) {
    w.busy_lanes += std::min(W, pool.count - at), w.shaded_lanes += W;
    shade_lanes(round, at, lane_numbers<W>() < vint<W>(pool.count - at));
  }
  std::swap(w.pool, w.next);
  if (w.medium_states) std::swap(w.medium_states->pool, w.medium_states->next);
}

}  // namespace primray
