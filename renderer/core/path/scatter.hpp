// Sends paths on from a vertex: a direction, what they carry there, and which of them end.
#pragma once

#include <algorithm>

#include "path/coverage.hpp"
#include "path/emission.hpp"
#include "path/met_routes.hpp"
#include "path/rays/path_parts.hpp"
#include "path/vertex.hpp"
#include "surface/through_tube.hpp"

namespace primray {

// A scattered ray's cone is wider by the angle of a cone that holds a 256th of the solid angle 1 / pdf which the ray stands
// for: pi (w / 2)^2 = 1 / (256 pdf); an eighth of a radian for diffuse ones. A choice: wider ones would carry colours and light
// from one part of a texture to another that lies beside it in the image alone. Mirrors and refractions keep the cone; their
// curvature is not followed.
constexpr float kLobeSpread = 0.0705236979f;
// Roulette: from this scattering on a path survives with probability min(1, kRouletteKeep * its largest throughput). On the
// Cornell box (relMSE, rays a sample, 64 samples): keep 1 from 4 on 0.00180, 5.2; 2 from 3: 0.00162, 5.1; 4 from 2: 0.00139,
// 5.9; 8 from 3: 0.00134, 6.5; none: 0.00132, 7.6. Of paths split in four, 2 costs the Cornell box as much as 4, and a terrain
// under a sky, where the last rays are cheap, half as much again.
constexpr int kRouletteStart = 2;
constexpr float kRouletteKeep = 4;
// From here on not even a lossless path survives for certain: one that is caught for good between mirrors or by total
// reflection would otherwise never end. What it brings is weighed accordingly. With a share a of light left by each scattering
// the weights' squares add up as long as a^2 is below what is kept: 0.98 left a closed room of albedo 0.998 6 % too dark in any
// render.
constexpr int kRouletteDeep = 1024;
constexpr float kRouletteDeepKeep = 0.999f;

// Camera rays that pass what is not there, or what the camera does not see, before anything else (path/coverage.hpp).
template <int W>
PRIMRAY_RARE void note_gaps(Round& round, vbool<W> gaps, const PathLanes<W>& p) {
  for (uint32_t b = bits(gaps & (p.vertex == vint<W>(0))); b; b &= b - 1) {
    float& a = round.worker.a[p.slot[__builtin_ctz(b)]];
    if (a < kThroughGaps) a += kGapMark;
  }
}

// Of camera rays that go straight on from `v`: whether there was nothing, or something that light passes.
template <int W, class Lobes>
PRIMRAY_RARE void note_straight(Round& round, vbool<W> straight, const Vertex<W, Lobes>& v, const BsdfSample<W>& s,
                                const PathLanes<W>& p) {
  if constexpr (requires { v.bsdf.presence; }) {
    const vfloat<W> one(1.0f);
    const vbool<W> gap = straight & (v.bsdf.presence < one) & (s.weight.x == one) & (s.weight.y == one) & (s.weight.z == one);
    note_gaps(round, gap, p);
    for (uint32_t b = bits(straight & !gap); b; b &= b - 1) {
      float& a = round.worker.a[p.slot[__builtin_ctz(b)]];
      if (a >= kThroughGaps) a -= kGapMark;
    }
  }
}

// A direction by the BSDF, the guide or photons. `splits`: among how many paths each sample is split, photons change it.
// `own`: where photons are asked, the density without them.
template <int W, class Lobes>
PRIMRAY_INLINE BsdfSample<W> sample_direction(const Round& round, const Vertex<W, Lobes>& v, const PathLanes<W>& p,
                                              vfloat<W>& splits, vfloat<W>& own) {
  const Guide* guide = round.settings.guide;
  const vint<W> bounce = p.vertex + vint<W>(1);
  Pair<W> u = p.sampler.link(bounce + vint<W>(round.first_link()));
  const vfloat<W> lobe = v.bsdf.any_preview || v.caustics ? p.sampler.single(bounce, Purpose::kLobe) : vfloat<W>(0.0f);
  const vbool<W> by_guide = guide ? choose_guide(v.place, u.u) : vbool<W>(false);
  // Inlined for what most paths take; a compiler counts the guided ones as well and would call it for all.
  const auto sample = [&](vfloat<W> l) __attribute__((always_inline)) {
    BsdfSample<W> found = v.bsdf.sample(v.wo, l, u.u, u.v);
    if (guide) sample_guided(*guide, v.place, by_guide, u, v.frame, v.wo, v.bsdf, found);
    return found;
  };
  const auto density = [&](const vvec3<W>& wi, vfloat<W> by_bsdf) { return scattered_density(round, v, wi, by_bsdf); };
  if (!v.caustics) return sample(lobe);
  return sample_guided(*v.caustics, v.bsdf, v.frame, v.wo, lobe, u, round.settings.splits, sample, density, splits, own);
}

// Starts the rays of `n` on the side that they leave to; which of them leave to where `s` says.
template <int W, class Lobes>
PRIMRAY_INLINE vbool<W> leave_surface(Round& round, vbool<W> scatters, const Vertex<W, Lobes>& v, const BsdfSample<W>& s,
                                      vfloat<W> time, PathLanes<W>& n) {
  const vfloat<W> zero(0.0f), out = dot(v.ng, n.ray.d);
  n.ray.o = v.it.p + v.ng * (v.it.offset * select(out > zero, vfloat<W>(1.0f), vfloat<W>(-1.0f)));
  // The true surface, or the one that its smooth normals stand for, decides which side a direction is on, whatever the
  // shading normal says.
  vbool<W> above = out > zero;
  if (const vbool<W> below = scatters & v.it.smooth & !above & !s.transmits & (max_component(n.beta) > zero); any(below))
    above |= start_lifted(round, below, v, n.ray.d, time, n.ray.o);
  return scatters & ((s.transmits & (out < zero)) | (above & !s.transmits));
}

// What a scene asks paths to carry from vertex to vertex.
template <int W, class Lobes>
PRIMRAY_INLINE void carry_on(const Round& round, const Vertex<W, Lobes>& v, const PathLanes<W>& p, const BsdfSample<W>& s,
                             PathLanes<W>& n) {
  using F = vfloat<W>;
  const Scene& scene = round.scene;
  if (scene.has_thin) n.travelled = select(s.straight, p.travelled + dot(v.it.p - p.ray.o, p.ray.d), F(0.0f));
  if (scene.has_inputs) {
    n.cone_width = p.cone_width + p.cone_spread * dot(v.it.p - p.ray.o, p.ray.d);
    n.cone_spread = p.cone_spread + select(s.pdf > F(0.0f), kLobeSpread / sqrt(max(s.pdf, 1e-6f)), F(0.0f));
  }
  if (round.needs.normals) n.normal = select(s.straight, p.normal, facing(v));
  if (round.needs.links) n.link = select(s.straight, p.link, v.it.link);
  if (round.needs.diffuse_shares) n.diffuse_share = select(s.straight, p.diffuse_share, s.diffuse_share);
  // What was guided counts as its surface would have sent it, until it next scatters widely.
  if (round.settings.caustics) {
    const vbool<W> widely = (s.pdf > F(0.0f)) & (s.pdf < F(kDiffuseDensity));
    n.splits = select(widely, min(n.splits, float(round.settings.splits)), n.splits);
  }
}

// Russian roulette: ends paths among `alive`, and weighs those that go on; the probability with which each did. `expected`: see
// expected_light().
template <int W>
PRIMRAY_INLINE vfloat<W> play_roulette(const Round& round, vbool<W> straight, vfloat<W> expected, PathLanes<W>& n,
                                       vbool<W>& alive) {
  using F = vfloat<W>;
  using I = vint<W>;
  const I bounce = n.vertex;
  const vbool<W> roulette = alive & (bounce >= I(kRouletteStart)) & !straight;
  F survive(1.0f);
  if (!any(roulette)) return survive;
  const F most = select(bounce >= I(kRouletteDeep), F(kRouletteDeepKeep), F(1.0f));
  F kept = max_component(n.beta) * n.splits * kRouletteKeep;
  if (round.needs.first_received) kept = select(n.first_received > F(0.0f), max(kept * expected, kLeastSurvival), kept);
  survive = select(roulette, min(kept, most), survive);
  const F r = n.sampler.single(bounce, Purpose::kRoulette);
  alive &= !(roulette & (r >= survive));
  n.beta = n.beta * (1.0f / survive);
  return survive;
}

// What becomes of a path among bodies that goes on as `s` says.
template <int W>
PRIMRAY_RARE void put_inside(Round& round, const Compaction<W>& kept, const Crossing<W>& crossing, const BsdfSample<W>& s,
                             vfloat<W> lead) {
  Inside<W> inside = crossing.after(s);
  inside.lead = lead;
  round.worker.inside->next->put(round.worker.next->count, kept, inside);
}
template <int W>
PRIMRAY_RARE void look_for_sky_inside(Round& round, vbool<W> lit, const Crossing<W>& crossing, const BsdfSample<W>& s,
                                      vfloat<W> lead, vvec3<W>& carried) {
  const Inside<W> inside = crossing.after(s);
  if (!round.scene.has_thin)
    carried = carried * inside.medium(round.scene).left_after(vfloat<W>(kInfinity)) * radiance_from(round.scene, inside.bodies);
  round.worker.inside->shadows.put(round.worker.shadows.count, Compaction<W>(lit), BodiesAround<W>{inside.bodies, lead});
}

// Of last rays only whether they meet the sky counts: a shadow ray tells that for less.
template <int W>
PRIMRAY_INLINE void look_for_sky(Round& round, vbool<W> last, const PathLanes<W>& n, const Crossing<W>* crossing,
                                 const BsdfSample<W>& s, vfloat<W> lead) {
  vvec3<W> carried = n.beta * meet_domes(round.scene.lights, last, n);
  const vbool<W> lit = last & (max_component(carried) > vfloat<W>(0.0f));
  if (!any(lit)) return;
  if (crossing) look_for_sky_inside(round, lit, *crossing, s, lead, carried);
  if (round.needs.routes) put_sky_routes(round, lit, n);
  const vint<W> sum = sum_of(round, n.slot, n.depth);
  round.worker.shadows.append(lit, n.ray.o, n.ray.d, vfloat<W>(kInfinity), carried, sum, n.ray.time, round.needs);
}

template <int W, class Lobes>
void scatter_once(Round& round, vbool<W> scatters, const Vertex<W, Lobes>& v, const PathLanes<W>& p) {
  using F = vfloat<W>;
  using I = vint<W>;
  using B = vbool<W>;
  const Scene& scene = round.scene;
  PathLanes<W> n = p;
  F own(0.0f);
  const BsdfSample<W> s = sample_direction(round, v, p, n.splits, own);
  if (const B through = scatters & s.straight & (p.depth == I(0)); scene.has_thin && any(through))
    note_straight(round, through, v, s, p);
  n.ray.d = select(s.straight, p.ray.d, v.frame.to_world(s.wi));
  n.beta = p.beta * s.weight;
  B alive = leave_surface(round, scatters, v, s, p.ray.time, n) & (max_component(n.beta) > F(0.0f));
  n.vertex = p.vertex + I(1);
  // What enters below a surface has not scattered from it before it comes out.
  n.depth = p.depth + select(s.straight | s.enters, I(0), I(1));
  alive &= n.depth <= I(round.settings.max_depth);
  // The last vertex only looks for light: without any that a ray could meet, there is nothing to look for.
  const B last = n.depth == I(round.settings.max_depth);
  if (!scene.rays_find_light) alive &= !last;
  n.bsdf_pdf = select(s.straight, p.bsdf_pdf, v.caustics ? own : s.pdf);
  carry_on(round, v, p, s, n);
  if (round.needs.routes) step_routes<Lobes::kInMedium>(*round.settings.routes, p, s, n);
  const F expected =
      round.needs.first_received ? expected_light(*round.settings.guide, v.place, n.ray.d, n.first_received) : F(0.0f);
  const F survive = play_roulette(round, s.straight, expected, n, alive);
  // Nor are there lights for it that light sampling does not find.
  if (scene.only_met_lights_found)
    alive &= (!last) | s.straight | s.enters |
             may_meet(scene.lights.hierarchy, alive & last & !s.straight, n.ray.o, n.ray.d, n.bsdf_pdf);
  if (!any(alive)) return;
  // What the camera does not see beyond its far plane it does not see through a gap either.
  n.ray.tnear = F(0.0f);
  if constexpr (Lobes::kFibres)
    n.ray.tnear = way_through_tube(alive & v.bsdf.is_hair & s.transmits & !s.straight, v.it, n.ray.d);
  n.ray.tfar = select(s.straight & (p.depth == I(0)), p.ray.tfar - dot(n.ray.o - p.ray.o, p.ray.d), F(kInfinity));
  // No light is sampled on a walk below a surface.
  const bool crosses = Lobes::kAmongBodies && v.crossing;
  if (crosses) n.bsdf_pdf = select(v.crossing->inside.walks(), F(0.0f), n.bsdf_pdf);
  if (const B sky = alive & last & !(s.straight | s.enters); scene.only_domes_found && any(sky)) {
    look_for_sky(round, sky, n, crosses ? v.crossing : nullptr, s, crosses ? lead_of(v.it.offset, v.ng, n.ray.d) : F(0.0f));
    alive &= !sky;
    if (!any(alive)) return;
  }
  if (round.settings.log && !Lobes::kInMedium)
    keep_vertex(*round.settings.log, alive & (s.pdf > F(0.0f)), v.it.p, v.ng, v.frame.n, s.pdf, survive, n);
  const Compaction<W> kept(alive);
  if (crosses) put_inside(round, kept, *v.crossing, s, lead_of(v.it.offset, v.ng, n.ray.d));
  round.worker.next->append(kept, n, round.needs);
}

// A path at its first surface that is no mirror is split, which spends more on what comes after than on finding that surface.
template <int W, class Lobes>
void scatter(Round& round, vbool<W> scatters, const Vertex<W, Lobes>& v, const PathLanes<W>& p) {
  const int splits = round.settings.splits;
  const vbool<W> split = scatters & (p.vertex == vint<W>(0)) & !v.bsdf.mirror;
  if (splits == 1 || !any(split)) return scatter_once(round, scatters, v, p);
  PathLanes<W> part = part_of(p, split, splits);
  part.splits = select(split, vfloat<W>(float(splits)), p.splits);
  for (int k = 0; k < splits; ++k) {
    number_part(part, p, split, splits, k);
    scatter_once(round, k == 0 ? scatters : split, v, part);
  }
}

}  // namespace primray
