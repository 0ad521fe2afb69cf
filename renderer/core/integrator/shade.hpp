// Third stage of a round, at each ray's hit: collects emission, samples lights, and scatters.
#pragma once

#include <algorithm>

#include "bsdf/bsdf_with_hair.hpp"
#include "integrator/emission.hpp"
#include "integrator/log_vertex.hpp"
#include "integrator/lpe_light.hpp"
#include "integrator/outline_rays.hpp"
#include "integrator/sample_light.hpp"
#include "integrator/scatter.hpp"

namespace primray {

// Lower limit of the cosine when a ray cone's footprint is projected onto a surface.
constexpr float kGrazing = 0.05f;
// Minimum distance of front and back hits from the ray's origin, in surface offsets: 3 hits in 1e8 rays at a closed box were
// inside it.
constexpr float kAhead = 0.25f, kBackAhead = 16;

// Samples that escape through transparent surfaces do not contribute to alpha.
template <int W>
PRIMRAY_RARE void reduce_alpha(Round& round, vbool<W> seen, const PathLanes<W>& p) {
  for (uint32_t b = bits(seen); b; b &= b - 1) {
    const int k = __builtin_ctz(b);
    round.worker.a[p.slot[k]] -= (p.beta.x[k] + p.beta.y[k] + p.beta.z[k]) * (1.0f / 3);
  }
}

// Removes from alpha samples that escape straight: those that passed only gaps, and those that see no light (`nothing`).
template <int W>
PRIMRAY_RARE void reduce_alpha_of_escaped(Round& round, vbool<W> escaped, vbool<W> nothing, const PathLanes<W>& p) {
  const uint32_t unseen = bits(nothing);
  for (uint32_t b = bits(escaped); b; b &= b - 1) {
    const int k = __builtin_ctz(b);
    float& a = round.worker.a[p.slot[k]];
    if (a >= kThroughGaps || (unseen >> k & 1)) a -= (p.beta.x[k] + p.beta.y[k] + p.beta.z[k]) * (1.0f / 3);
  }
}

// Returns emission along the rays: from lights that they hit, and from the environment. Removes lanes that a light's body
// covers from `hit`. `looks`: lanes whose lights were not already added in a medium (integrator/cross_media.hpp).
template <int W>
PRIMRAY_INLINE vvec3<W> gather_emission(Round& round, vbool<W> active, vbool<W> looks, const PathLanes<W>& p,
                                        const Hits<W>& hits, vbool<W>& hit) {
  const LightTable& lights = round.scene.lights;
  vvec3<W> gathered(vfloat<W>(0.0f));
  if (round.needs.lpe) record_light_hits(round, looks, p, hits, hit);
  if constexpr (W == 1) {
    if (PathLog* const log = path_log<W>(round)) log_light_hits(*log, round, looks, p, hits, hit);
  }
  const LightHits<W> met = intersect_lights(lights, looks, hit, p, hits.t, gathered);
  const vbool<W> covered = met.covered;
  if (const vbool<W> camera = covered & (p.vertex == vint<W>(0)); round.outlined && any(camera))
    gathered = select(is_outlined(round, camera, p.slot, met.light), vvec3<W>(vfloat<W>(0.0f)), gathered);
  hit &= !covered;
  const vbool<W> escaped = active & !hit & !covered;
  vbool<W> nothing = escaped;
  if (!lights.domes.empty() && any(escaped)) {
    const vvec3<W> sky = evaluate_domes(lights, escaped, p);
    if (round.needs.lpe) record_domes(round, escaped, p);
    if constexpr (W == 1) {
      if (PathLog* const log = path_log<W>(round)) log_domes(*log, round, p);
    }
    gathered += select(escaped, sky, vvec3<W>(vfloat<W>(0.0f)));
    nothing &= !(max_component(sky) > vfloat<W>(0.0f));
  }
  if (round.scene.has_thin) {
    const vbool<W> straight = escaped & (p.depth == vint<W>(0)) & (p.vertex > vint<W>(0));
    if (any(straight)) reduce_alpha_of_escaped(round, straight, nothing, p);
  }
  for (uint32_t b = bits(active & (p.vertex == vint<W>(0)) & (hit | covered)); b; b &= b - 1)
    round.worker.a[p.slot[__builtin_ctz(b)]] = 1.0f;
  return gathered;
}

// Adds the emission recorded for the packet at `at` to light path expressions.
template <int W>
PRIMRAY_RARE void add_recorded_at(Round& round, int at, const PathLanes<W>& p) {
  add_recorded(round, p, round.follows_media() ? p.beta * radiance_scale_at<W>(round, at) : p.beta);
}

// Returns the lanes in which the side of the surface that the ray came from is certain. Where rounding hides it, the path ends:
// choosing the wrong side would leak light through the edges of closed surfaces. Uncertain hits are seen edge-on; or lie behind
// the ray's origin (Embree's distance is wrong where the origin is almost in the triangle's plane; the point is not); or lie on
// a back so near to the origin that this may have been on the wrong side of the next face; or lie on the edge of a back-facing
// triangle that the ray would miss a little further inside, which means that it passed the silhouette.
template <int W>
PRIMRAY_INLINE vbool<W> is_side_certain(Round& round, vbool<W> hit, const PathLanes<W>& p, const Hits<W>& hits,
                                        const Interaction<W>& it, vfloat<W> facing) {
  const vbool<W> behind = !(facing > vfloat<W>(0.0f));
  const vfloat<W> ahead = dot(it.p - p.ray.o, p.ray.d);
  vbool<W> certain =
      (abs(facing) > it.least_cosine) & (ahead > it.offset * select(behind, vfloat<W>(kBackAhead), vfloat<W>(kAhead)));
  if (const vbool<W> back = hit & it.at_edge & behind; any(back))
    certain &= (!back) | confirm_edge_hit(round, back, p, hits, it);
  return certain;
}

// Returns the lanes that hit hair from within and continue straight: misjudging the side of such hits leaks no light.
template <int W>
PRIMRAY_RARE vbool<W> is_within_fibre(const SurfaceRows<W>& rows, vfloat<W> facing) {
  return ((truncate(rows(kFlags)) & vint<W>(kHair)) != vint<W>(0)) & !(facing > vfloat<W>(0.0f));
}

template <int W, class Lobes>
void sample_direct_and_continue(Round& round, vbool<W> scatters, const Vertex<W, Lobes>& v, const PathLanes<W>& p) {
  vbool<W> lit = scatters & (p.depth < vint<W>(round.settings.max_depth));
  if constexpr (Lobes::kFollowsMedia) {
    if (v.crossing) lit &= !v.crossing->inside.in_subsurface();
  }
  // Paths inside a fibre continue straight.
  if constexpr (Lobes::kFibres) lit &= v.bsdf.presence > vfloat<W>(0.0f);
  if (round.scene.lights.count > 0) sample_lights(round, lit, v, p);
  scatter(round, scatters, v, p);
}

template <int W, class Lobes>
PRIMRAY_RARE void sample_direct_and_continue_guided(Round& round, vbool<W> scatters, Vertex<W, Lobes>& v,
                                                    const PathLanes<W>& p) {
  const auto sends = [&](const vvec3<W>& w, vfloat<W> width2) { return suits(v.bsdf, v.wo, v.frame.to_local(w), width2); };
  const CausticLanes<W> guide(*round.settings.caustics, scatters & follows_caustics<W>(v.bsdf), v.it.p, sends);
  if (any(guide.share > vfloat<W>(0.0f))) v.caustics = &guide;
  sample_direct_and_continue(round, scatters, v, p);
}

// Samples lights and scatters at the hits `it`.
template <class Lobes, int W, class... More>
PRIMRAY_INLINE void scatter_at(Round& round, vbool<W> scatters, const PathLanes<W>& p, const Hits<W>& hits,
                               const Interaction<W>& it, const SurfaceRows<W>& rows, const vvec3<W>& ng,
                               const Frame<vfloat<W>>& frame, vbool<W> front, const Crossing<W>* crossing,
                               const More&... more) {
  const IntegratorSettings& settings = round.settings;
  const vvec3<W> wo = frame.to_local(-p.ray.d);
  Vertex<W, Lobes> v{it,      ng,      frame, wo, Lobes(rows, scatters, wo, front, more...), hits, {vint<W>(-1), vint<W>(0)},
                     nullptr, crossing};
  v.bsdf.diffuse *= it.color;
  if constexpr (W == 1) {
    if (PathLog* const log = path_log<W>(round)) log_lobes(*log, p, v);
  }
  if (settings.guide) v.place = find_place(*settings.guide, scatters, it.p, ng, v.bsdf);
  if (settings.caustics) return sample_direct_and_continue_guided(round, scatters, v, p);
  sample_direct_and_continue(round, scatters, v, p);
}
template <int W>
PRIMRAY_RARE void scatter_with_open_pbr(Round& round, vbool<W> scatters, const PathLanes<W>& p, const Hits<W>& hits,
                                        const Interaction<W>& it, const SurfaceRows<W>& rows, const vvec3<W>& ng,
                                        Frame<vfloat<W>> frame, vbool<W> front) {
  align_tangent(rows, scatters, frame);
  const Crossing<W>* const none = nullptr;
  scatter_at<BsdfWithOpenPbr<W>>(round, scatters, p, hits, it, rows, ng, frame, front, none);
}

template <int W>
PRIMRAY_RARE void scatter_with_hair(Round& round, vbool<W> scatters, const PathLanes<W>& p, const Hits<W>& hits,
                                    const Interaction<W>& it, const SurfaceRows<W>& rows, const vvec3<W>& ng,
                                    Frame<vfloat<W>> frame, vbool<W> front) {
  align_tangent(rows, scatters, frame);
  align_fibre(rows, scatters & it.on_curve, it.tangent, frame);
  const Crossing<W>* const none = nullptr;
  scatter_at<BsdfWithHair<W>>(round, scatters, p, hits, it, rows, ng, frame, front, none);
}

// White Lambert lobes through which light leaves a subsurface medium.
template <int W>
struct WhiteLobes : Bsdf<W> {
  static constexpr bool kFollowsMedia = true;
  using Bsdf<W>::Bsdf;
};

// Exit of a subsurface random walk: lights are sampled and paths continue as from a white Lambert surface.
template <int W>
PRIMRAY_RARE void exit_subsurface(Round& round, vbool<W> lanes, const PathLanes<W>& p, const Hits<W>& hits, Interaction<W> it,
                                  const MediumState<W>& inside) {
  using F = vfloat<W>;
  static const std::vector<float> white = [] {
    SurfaceTable table;
    SurfaceInput lambert;
    lambert.diffuse_color = vec3(1.0f);
    table.add(lambert);
    return table.rows;
  }();
  Crossing<W> crossing{{inside.stack, {}, {}}, Boundary<W>(inside.stack), {}};
  it.color = vvec3<W>(F(1.0f));
  // Treat the path as if it had arrived from outside, along the normal.
  PathLanes<W> outside = p;
  const Frame<F> frame(it.ns);
  outside.ray.d = -it.ns;
  scatter_at<WhiteLobes<W>>(round, lanes, outside, hits, it, SurfaceRows<W>(white.data(), vint<W>(0), nullptr), it.ng, frame,
                            vbool<W>(true), &crossing);
}

// Returns the paths continued straight, from behind the surface that they hit.
template <int W>
PRIMRAY_RARE PathLanes<W> continue_behind(const PathLanes<W>& p, const Interaction<W>& it, const vvec3<W>& ng) {
  PathLanes<W> n = p;
  const vfloat<W> way = dot(it.p - p.ray.o, p.ray.d);
  n.ray.o = it.p - ng * it.offset;
  n.ray.tnear = vfloat<W>(0.0f);
  n.ray.tfar = p.ray.tfar - dot(n.ray.o - p.ray.o, p.ray.d);
  n.vertex = p.vertex + vint<W>(1);
  n.travelled = p.travelled + way, n.cone_width = p.cone_width + p.cone_spread * way;
  return n;
}

// Passes boundaries that a medium of higher priority overrides: paths continue straight.
template <int W>
PRIMRAY_RARE void skip_overridden_boundary(Round& round, vbool<W> lanes, const PathLanes<W>& p, const Interaction<W>& it,
                                           const vvec3<W>& ng, const MediumState<W>& inside) {
  const Compaction<W> kept(lanes);
  round.worker.inside->next->put(round.worker.next->count, kept, inside);
  round.worker.next->append(kept, continue_behind(p, it, ng), round.needs);
}

// Mean free paths below a surface shorter than kLeastOffsets of its ray offsets are treated as zero: light leaves where it
// entered. Channels with a shorter one than kLeastSteps offsets are raised to that.
constexpr float kLeastOffsets = 64, kLeastSteps = 8;

// Shades hits in scenes with media (medium/medium_stack.hpp), for the paths from `at` on in the pool; `hit` are the lanes that
// hit a surface.
template <int W>
PRIMRAY_RARE void scatter_in_media(Round& round, int at, vbool<W> hit, vbool<W> scatters, PathLanes<W> p, const Hits<W>& hits,
                                   const Interaction<W>& it, const SurfaceRows<W>& rows, const vvec3<W>& ng,
                                   Frame<vfloat<W>> frame, vbool<W> front) {
  using F = vfloat<W>;
  using V = vvec3<W>;
  const Scene& scene = round.scene;
  MediumState<W> inside = round.worker.inside->pool->template at<W>(at);
  const vbool<W> is_open = hit & ((truncate(rows(kFlags)) & vint<W>(kOpenPbr)) != vint<W>(0));
  const OpenPbrRows<W> row{rows.open_pbr, select(is_open, truncate(rows(kOpenPbrRow)), vint<W>(0)) * vint<W>(kOpenPbrFields)};
  const vbool<W> deep = is_open & (row(kOpenSubsurface) > F(0.0f)), in_subsurface = inside.in_subsurface();
  const vbool<W> leaves = deep & in_subsurface & !front & (p.depth < vint<W>(round.settings.max_depth));
  // A random walk that hits a front face has left unnoticed.
  scatters &= !(in_subsurface & deep);
  Crossing<W> crossing{inside, Boundary<W>(scene, scatters, inside.stack, it.surface, front), {}};
  const Boundary<W>& b = crossing.boundary;
  vbool<W> enterable = deep;
  if (any(deep)) {
    // Shorter steps would be lost in the rounding of their start.
    const F most = 1.0f / (kLeastSteps * max(it.offset, 1e-30f));
    const V extinction = row.color(kOpenSubsurfaceExtinction) * scene.interiors.per_length;
    const V capped{min(extinction.x, most), min(extinction.y, most), min(extinction.z, most)};
    crossing.entered.extinction = select(deep, capped, V(F(0.0f)));
    crossing.entered.scattering = crossing.entered.extinction * row.color(kOpenSubsurfaceAlbedo);
    crossing.entered.phase = row(kOpenSubsurfacePhase);
    enterable &= min(min(extinction.x, extinction.y), extinction.z) * it.offset * kLeastOffsets < F(1.0f);
  }
  if (const vbool<W> m = b.missed & !in_subsurface & (inside.stack.top() < vint<W>(0)); any(m))
    p.beta = select(m, p.beta * medium_of(scene, b.here).transmittance(hits.t + inside.lead), p.beta);
  align_tangent(rows, scatters, frame);
  const bool hairy = !scene.surfaces.hair.empty();
  if (hairy) align_fibre(rows, scatters & it.on_curve, it.tangent, frame);
  const vbool<W> kinds[3] = {leaves, b.overridden, scatters & !b.overridden};
  for_kinds(round.settings.splits > 1, kinds, [&](int kind, vbool<W> lanes) {
    if (kind == 0) return exit_subsurface(round, lanes, p, hits, it, inside);
    if (PathLog* const log = path_log<W>(round); log && kind == 1)
      log->add("pass", p).why = "a medium of higher priority overrides the boundary";
    if (kind == 1)
      return skip_overridden_boundary(round, lanes, p, it, ng,
                                      MediumState<W>{b.beyond, inside.subsurface, lead_of(it.offset, ng, p.ray.d)});
    if (hairy)
      return scatter_at<BsdfWithHair<W>>(round, lanes, p, hits, it, rows, ng, frame, front, &crossing, b.beside, enterable);
    scatter_at<BsdfWithOpenPbr<W>>(round, lanes, p, hits, it, rows, ng, frame, front, &crossing, b.beside, enterable);
  });
}

// Handles surfaces hidden from camera rays and mattes (holdouts): paths pass hidden surfaces straight; a matte covers nothing
// of its pixel, and its paths end.
template <int W>
PRIMRAY_RARE void apply_camera_visibility(Round& round, int at, const PathLanes<W>& p, const Interaction<W>& it,
                                          vbool<W>& hit) {
  using F = vfloat<W>;
  const CameraSights& sights = round.scene.camera_sights;
  const vbool<W> looks = hit & (p.depth == vint<W>(0));
  if (const vbool<W> matte = sights.are(CameraSight::kMatte, looks, it.surface); any(matte)) {
    reduce_alpha(round, matte, p);
    hit &= !matte;
    if (PathLog* const log = path_log<W>(round)) log->end(p, "a matte ends it");
  }
  const vbool<W> hidden = sights.are(CameraSight::kHidden, looks, it.surface);
  if (!any(hidden)) return;
  hit &= !hidden;
  if (PathLog* const log = path_log<W>(round)) log->add("pass", p).why = "the surface is hidden from the camera";
  mark_gaps(round, hidden, p);
  const F side = select(dot(it.ng, p.ray.d) > F(0.0f), F(-1.0f), F(1.0f));
  const vvec3<W> ng = it.ng * side;
  if (round.follows_media())
    return skip_overridden_boundary(round, hidden, p, it, ng, round.worker.inside->pool->template at<W>(at));
  round.worker.next->append(Compaction<W>(hidden), continue_behind(p, it, ng), round.needs);
}

// Shades one vertex of the paths at [at, at + W).
template <int W>
void shade_lanes(Round& round, int at, vbool<W> active) {
  using F = vfloat<W>;
  using V = vvec3<W>;
  const Scene& scene = round.scene;
  const IntegratorSettings& settings = round.settings;
  const PathPool& pool = *round.worker.pool;
  PathLanes<W> p = pool.paths<W>(at, round.needs);
  Hits<W> hits = pool.hits<W>(at);
  hits.time = p.ray.time;
  vbool<W> hit = active & (hits.geom != vint<W>(-1));
  const vbool<W> looks = round.follows_media() ? active & !has_crossed_medium<W>(round, at) : active;
  V gathered = gather_emission(round, active, looks, p, hits, hit);
  if (round.follows_media()) gathered = gathered * radiance_scale_at<W>(round, at);
  if (!any(hit)) {
    if (round.needs.lpe) add_recorded_at(round, at, p);
    if (PathLog* const log = path_log<W>(round)) log->end(p, "no surface is hit"), log->events.back().put("radiance", gathered);
    return add_to_slots(round, active, sum_of(round, p.slot, p.depth), p.beta * gathered);
  }

  Interaction<W> it = interact(scene, hit, p.ray, hits);
  if constexpr (W == 1) {
    if (PathLog* const log = path_log<W>(round)) log_hit(*log, scene, p, hits, it);
  }
  if (scene.camera_sights.any()) apply_camera_visibility(round, at, p, it, hit);
  SurfaceRows<W> rows(scene.surfaces, it.surface);
  LaneRows<W> varying;
  if (any_inputs(scene, hit, it.surface)) {
    // Footprint of the ray cone on the surface, whatever the angle.
    const F width = p.cone_width + p.cone_spread * hits.t, cosine = abs(dot(it.ng, p.ray.d));
    rows = evaluate_inputs(scene, hit, hits, it.surface, width * width / max(cosine, kGrazing), it.p, it.ng, it.ns, varying);
  }
  if (scene.has_emission) {
    V shines = select(hit, emitted(scene, hit, hits, it, rows, p), V(F(0.0f)));
    if (round.needs.lpe) record_surface_emission(round, hit, hits, it, shines);
    if constexpr (W == 1) {
      if (PathLog* const log = path_log<W>(round)) log_surface_emission(*log, scene, hit, p, hits, it, shines);
    }
    if (round.follows_media()) shines = shines * radiance_scale_at<W>(round, at);
    gathered += shines;
  }
  if (PathLog* const log = path_log<W>(round); log && any(max_component(abs(gathered)) > F(0.0f)))
    log->add("gathered", p).put("radiance", gathered);
  add_to_slots(round, active, sum_of(round, p.slot, p.depth), p.beta * gathered);
  if (round.needs.lpe) add_recorded_at(round, at, p), resolve_lpe(p);

  const V wo = -p.ray.d;
  const F facing = dot(it.ng, wo);
  vbool<W> certain = is_side_certain(round, hit, p, hits, it, facing);
  if (!scene.surfaces.hair.empty()) certain |= is_within_fibre(rows, facing);
  const vbool<W> scatters = hit & certain & ((p.depth < vint<W>(settings.max_depth)) | vbool<W>(scene.has_thin));
  if (PathLog* const log = path_log<W>(round); log && any(hit & !scatters))
    log->end(p, any(certain) ? "the maximum depth is reached" : "rounding hides from which side the surface is hit");
  const bool in_media = round.follows_media();
  if (!any(in_media ? hit : scatters)) return;
  const vbool<W> front = facing > F(0.0f);
  const F side = select(front, F(1.0f), F(-1.0f));
  const V ng = it.ng * side;
  // A shading normal that faces away from the viewer is replaced by the geometric normal.
  const V ns = it.ns * side;
  const Frame<F> frame(select(dot(ns, wo) > F(1e-4f), ns, ng));
  PRIMRAY_ASSERT(are_unit(hit, wo) && are_unit(hit & scatters, ng) && are_unit(hit & scatters, frame.n));
  if (in_media) return scatter_in_media(round, at, hit, scatters, p, hits, it, rows, ng, frame, front);
  if (!scene.surfaces.hair.empty()) return scatter_with_hair(round, scatters, p, hits, it, rows, ng, frame, front);
  if (!scene.surfaces.open_pbr.empty()) return scatter_with_open_pbr(round, scatters, p, hits, it, rows, ng, frame, front);
  const Crossing<W>* const none = nullptr;
  scatter_at<Bsdf<W>>(round, scatters, p, hits, it, rows, ng, frame, front, none);
}

template <int W>
void shade(Round& round) {
  Worker& w = round.worker;
  PathPool& pool = *w.pool;
  for (int at = 0; at < pool.count; at += W) {
    w.busy_lanes += std::min(W, pool.count - at), w.shaded_lanes += W;
    shade_lanes(round, at, lane_numbers<W>() < vint<W>(pool.count - at));
  }
  std::swap(w.pool, w.next);
  if (w.inside) std::swap(w.inside->pool, w.inside->next);
}

}  // namespace primray
