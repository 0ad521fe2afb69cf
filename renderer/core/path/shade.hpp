// The third stage of a round: at what each ray has met, light met, light sampled, next ray.
#pragma once

#include <algorithm>

#include "bsdf/bsdf_with_open_pbr.hpp"
#include "path/emission.hpp"
#include "path/outline_rays.hpp"
#include "path/sample_light.hpp"
#include "path/scatter.hpp"

namespace primray {

// Below this cosine the area that a cone cuts out of a surface is taken as no larger.
constexpr float kGrazing = 0.05f;
// Offsets that a front hit and one on a back lie ahead of the ray's start at least: 3 hits in 1e8 rays at a closed box lay
// inside.
constexpr float kAhead = 0.25f, kBackAhead = 16;

// What of a sample comes to nothing straight through surfaces that it met covers nothing of its pixel.
template <int W>
PRIMRAY_RARE void see_through(Round& round, vbool<W> seen, const PathLanes<W>& p) {
  for (uint32_t b = bits(seen); b; b &= b - 1) {
    const int k = __builtin_ctz(b);
    round.worker.a[p.slot[k]] -= (p.beta.x[k] + p.beta.y[k] + p.beta.z[k]) * (1.0f / 3);
  }
}

// Light that comes back along the ray from lights it meets, and from afar. A body that is met leaves nothing of `hit`.
template <int W>
PRIMRAY_INLINE vvec3<W> gather_met_light(Round& round, vbool<W> active, const PathLanes<W>& p, const Hits<W>& hits,
                                         vbool<W>& hit) {
  const LightTable& lights = round.scene.lights;
  vvec3<W> gathered(vfloat<W>(0.0f));
  const MetLights<W> met = meet_lights(lights, active, hit, p, hits.t, gathered);
  const vbool<W> covered = met.covered;
  if (const vbool<W> camera = covered & (p.vertex == vint<W>(0)); round.outlined && any(camera))
    gathered = select(is_outlined(round, camera, p.slot, met.light), vvec3<W>(vfloat<W>(0.0f)), gathered);
  hit &= !covered;
  const vbool<W> escaped = active & !hit & !covered;
  vbool<W> nothing = escaped;
  if (!lights.domes.empty() && any(escaped)) {
    const vvec3<W> sky = meet_domes(lights, escaped, p);
    gathered += select(escaped, sky, vvec3<W>(vfloat<W>(0.0f)));
    nothing &= !(max_component(sky) > vfloat<W>(0.0f));
  }
  if (round.scene.has_thin) {
    nothing &= (p.depth == vint<W>(0)) & (p.vertex > vint<W>(0));
    if (any(nothing)) see_through(round, nothing, p);
  }
  for (uint32_t b = bits(active & (p.vertex == vint<W>(0)) & (hit | covered)); b; b &= b - 1)
    round.worker.a[p.slot[__builtin_ctz(b)]] = 1.0f;
  return gathered;
}

// Paths scatter on the side of the surface where the ray came from. Where rounding hides which that is, the path ends: taking
// the wrong one lets light through closed surfaces at their edges. Such hits are seen edge-on, or lie behind the ray's
// start (Embree's distance is wrong where the start is almost in the triangle's plane; the point is not), or on a back so
// near to the start that this may have been on the wrong side of the next face, or on the edge of a triangle's back whose
// inside the ray would not see: it came in past the outline of a body.
template <int W>
PRIMRAY_INLINE vbool<W> is_side_certain(Round& round, vbool<W> hit, const PathLanes<W>& p, const Hits<W>& hits,
                                        const Interaction<W>& it, vfloat<W> facing) {
  const vbool<W> behind = !(facing > vfloat<W>(0.0f));
  const vfloat<W> ahead = dot(it.p - p.ray.o, p.ray.d);
  vbool<W> certain =
      (abs(facing) > it.least_cosine) & (ahead > it.offset * select(behind, vfloat<W>(kBackAhead), vfloat<W>(kAhead)));
  if (const vbool<W> back = hit & it.at_edge & behind; any(back)) certain &= (!back) | sees_within(round, back, p, hits, it);
  return certain;
}

template <int W, class Lobes>
void go_on(Round& round, vbool<W> scatters, const Vertex<W, Lobes>& v, const PathLanes<W>& p) {
  if (round.scene.lights.count > 0) sample_lights(round, scatters & (p.depth < vint<W>(round.settings.max_depth)), v, p);
  scatter(round, scatters, v, p);
}

template <int W, class Lobes>
PRIMRAY_RARE void go_on_guided(Round& round, vbool<W> scatters, Vertex<W, Lobes>& v, const PathLanes<W>& p) {
  const auto sends = [&](const vvec3<W>& w, vfloat<W> width2) { return suits(v.bsdf, v.wo, v.frame.to_local(w), width2); };
  const CausticLanes<W> guide(*round.settings.caustics, scatters & follows_caustics<W>(v.bsdf), v.it.p, sends);
  if (any(guide.share > vfloat<W>(0.0f))) v.caustics = &guide;
  go_on(round, scatters, v, p);
}

// Light is sampled and paths are sent on from the hits `it`.
template <class Lobes, int W>
PRIMRAY_INLINE void scatter_at(Round& round, vbool<W> scatters, const PathLanes<W>& p, const Hits<W>& hits,
                               const Interaction<W>& it, const SurfaceRows<W>& rows, const vvec3<W>& ng,
                               const Frame<vfloat<W>>& frame, vbool<W> front) {
  const IntegratorSettings& settings = round.settings;
  const vvec3<W> wo = frame.to_local(-p.ray.d);
  Vertex<W, Lobes> v{it, ng, frame, wo, Lobes(rows, scatters, wo, front), hits, {vint<W>(-1), vint<W>(0)}, nullptr};
  v.bsdf.diffuse *= it.color;
  if (settings.guide) v.place = find_place(*settings.guide, scatters, it.p, ng, v.bsdf);
  if (settings.caustics) return go_on_guided(round, scatters, v, p);
  go_on(round, scatters, v, p);
}
template <int W>
PRIMRAY_RARE void scatter_with_open_pbr(Round& round, vbool<W> scatters, const PathLanes<W>& p, const Hits<W>& hits,
                                        const Interaction<W>& it, const SurfaceRows<W>& rows, const vvec3<W>& ng,
                                        Frame<vfloat<W>> frame, vbool<W> front) {
  align_tangent(rows, scatters, frame);
  scatter_at<BsdfWithOpenPbr<W>>(round, scatters, p, hits, it, rows, ng, frame, front);
}

// One vertex of the paths at [at, at + W).
template <int W>
void shade_lanes(Round& round, int at, vbool<W> active) {
  using F = vfloat<W>;
  using V = vvec3<W>;
  const Scene& scene = round.scene;
  const IntegratorSettings& settings = round.settings;
  const PathPool& pool = *round.worker.pool;
  const PathLanes<W> p = pool.paths<W>(at, round.needs);
  Hits<W> hits = pool.hits<W>(at);
  hits.time = p.ray.time;
  vbool<W> hit = active & (hits.geom != vint<W>(-1));
  V gathered = gather_met_light(round, active, p, hits, hit);
  if (!any(hit)) return add_to_slots(round, active, p.slot, p.beta * gathered);

  Interaction<W> it = interact(scene, hit, p.ray, hits);
  SurfaceRows<W> rows(scene.surfaces, it.surface);
  LaneRows<W> varying;
  if (any_inputs(scene, hit, it.surface)) {
    // Whatever the angle, as much area as the cone cuts out of the surface.
    const F width = p.cone_width + p.cone_spread * hits.t, cosine = abs(dot(it.ng, p.ray.d));
    rows = evaluate_inputs(scene, hit, hits, it.surface, width * width / max(cosine, kGrazing), it.p, it.ng, it.ns, varying);
  }
  if (scene.has_emission) gathered += select(hit, emitted(scene, hit, hits, it, rows, p), V(F(0.0f)));
  add_to_slots(round, active, p.slot, p.beta * gathered);

  const V wo = -p.ray.d;
  const F facing = dot(it.ng, wo);
  const vbool<W> scatters = hit & is_side_certain(round, hit, p, hits, it, facing) &
                            ((p.depth < vint<W>(settings.max_depth)) | vbool<W>(scene.has_thin));
  if (!any(scatters)) return;
  const vbool<W> front = facing > F(0.0f);
  const F side = select(front, F(1.0f), F(-1.0f));
  const V ng = it.ng * side;
  // A shading normal that faces away from the viewer cannot be seen: use the true one.
  const V ns = it.ns * side;
  const Frame<F> frame(select(dot(ns, wo) > F(1e-4f), ns, ng));
  if (!scene.surfaces.open_pbr.empty()) return scatter_with_open_pbr(round, scatters, p, hits, it, rows, ng, frame, front);
  scatter_at<Bsdf<W>>(round, scatters, p, hits, it, rows, ng, frame, front);
}

template <int W>
void shade(Round& round) {
  Worker& w = round.worker;
  PathPool& pool = *w.pool;
  w.next->count = 0;
  w.shadows.count = 0;
  if (round.has_special()) w.special_shadows->rays.count = 0;
  for (int at = 0; at < pool.count; at += W) {
    w.busy_lanes += std::min(W, pool.count - at), w.shaded_lanes += W;
    shade_lanes(round, at, lane_numbers<W>() < vint<W>(pool.count - at));
  }
  std::swap(w.pool, w.next);
}

}  // namespace primray
