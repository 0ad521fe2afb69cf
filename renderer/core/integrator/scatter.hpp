// Scattering: samples the next direction of each path, updates its state, and ends paths by Russian roulette.
#pragma once

#include <algorithm>

#include "integrator/camera_visibility.hpp"
#include "integrator/emission.hpp"
#include "integrator/log_vertex.hpp"
#include "integrator/lpe_light.hpp"
#include "integrator/tile_task.hpp"
#include "integrator/vertex.hpp"
#include "surface/ray_origin.hpp"

namespace primray {

// Widening of the ray cone at a scattering event: the angle w of a cone that holds 1/256 of the solid angle 1 / pdf of the
// sample, from pi (w / 2)^2 = 1 / (256 pdf); an eighth of a radian for diffuse lobes. A wider cone would blur distant parts of
// a texture that are adjacent only in the image. Mirrors and refractions keep the cone; curvature is ignored.
constexpr float kLobeSpread = 0.0705236979f;
// Russian roulette: from this vertex on a path survives with probability min(1, kRouletteKeep * its largest throughput). On the
// Cornell box (relMSE, rays per sample, 64 samples): keep 1 from vertex 4: 0.00180, 5.2; 2 from 3: 0.00162, 5.1; 4 from 2:
// 0.00139, 5.9; 8 from 3: 0.00134, 6.5; none: 0.00132, 7.6. With paths split in four, 2 costs as much as 4 on the Cornell box,
// and half as much again on a terrain under a sky, where the last rays are cheap.
constexpr int kRouletteStart = 2;
constexpr float kRouletteKeep = 4;
// The same of paths that leave hair, where last rays cost as much as first ones. 25,000 dark strands under a sky with a sun,
// one path, 8 samples: 1 / (relMSE CPU) of keep 16, 8, 4, 2, 1 is 0.89, 0.97, 1.03, 1.06, 0.98; without the worst thousandth of
// the pixels 0.99, 1.08, 1.14, 1.19, 1.22; without the worst hundredth 1.6, 1.8, 1.9, 2.1, 2.6.
constexpr float kFibreKeep = 2;
// Beyond this depth even lossless paths may end: one that is trapped between mirrors or by total internal reflection would
// never end otherwise. If each scattering event keeps a share a of the light, the variance of the weights stays finite as long
// as a^2 is below the survival probability: 0.98 made a closed room of albedo 0.998 6 % too dark in any render.
constexpr int kRouletteDeep = 1024;
constexpr float kRouletteDeepKeep = 0.999f;
// Paths in dense media without absorption scatter as often as the object is optically thick, so Russian roulette starts later
// for them and ends fewer.
constexpr int kMediumDeep = 16384;
constexpr float kMediumDeepKeep = 0.9999f;

// Range of the random numbers that choose a lobe.
template <int W>
struct LobeRange {
  vfloat<W> begin, size;
};

// Samples a direction from the BSDF, the guide or the caustic photons. `splits`: number of parts of each sample, which photons
// change. `own`: with photons, the density without them. `range`: null for that of all lobes.
template <int W, class Lobes>
PRIMRAY_INLINE BsdfSample<W> sample_direction(const Round& round, const Vertex<W, Lobes>& v, const PathLanes<W>& p,
                                              const LobeRange<W>* range, vfloat<W>& splits, vfloat<W>& own) {
  const Guide* guide = round.settings.guide;
  const vint<W> bounce = p.vertex + vint<W>(1);
  const Pair<W> u = p.sampler.link(bounce + vint<W>(round.first_link()));
  vfloat<W> lobe = v.bsdf.any_preview || v.caustics ? p.sampler.single(bounce, Purpose::kLobe) : vfloat<W>(0.0f);
  if (range) lobe = min(range->begin + lobe * range->size, 0x1.fffffep-1f);
  // Inlined for the common case; the compiler would otherwise count the guided branch as well and emit a call for all.
  const auto sample = [&](vfloat<W> l) __attribute__((always_inline)) {
    Pair<W> at = u;
    const vbool<W> by_guide = guide ? choose_guide(v.place, l, at.u) : vbool<W>(false);
    BsdfSample<W> found = v.bsdf.sample(v.wo, l, at.u, at.v);
    if (guide) sample_guided(*guide, v.place, by_guide, at, v.frame, v.wo, v.bsdf, found);
    return found;
  };
  const auto density = [&](const vvec3<W>& wi, vfloat<W> by_bsdf) { return scattered_density(round, v, wi, by_bsdf); };
  if (!v.caustics) return sample(lobe);
  return sample_guided(*v.caustics, v.bsdf, v.frame, v.wo, lobe, u, round.settings.splits, sample, density, splits, own);
}

// Offsets the origins of `n` to the side on which they leave; returns the lanes that leave on the side that `s` sampled.
template <int W, class Lobes>
PRIMRAY_INLINE vbool<W> offset_origins(Round& round, vbool<W> scatters, const Vertex<W, Lobes>& v, const BsdfSample<W>& s,
                                       vfloat<W> time, PathLanes<W>& n) {
  const vfloat<W> zero(0.0f), out = dot(v.ng, n.ray.d);
  n.ray.o = v.it.p + v.ng * (v.it.offset * select(out > zero, vfloat<W>(1.0f), vfloat<W>(-1.0f)));
  // The true surface, or the smooth surface that its normals approximate, decides on which side a direction is, whatever the
  // shading normal.
  vbool<W> above = out > zero;
  if (const vbool<W> below = scatters & v.it.smooth & !above & !s.transmits & (max_component(n.beta) > zero); any(below))
    above |= lift_origins(round, below, v, n.ray.d, time, n.ray.o);
  return scatters & ((s.transmits & (out < zero)) | (above & !s.transmits));
}

// Updates the optional path state that the scene needs at the next vertex.
template <int W, class Lobes>
PRIMRAY_INLINE void update_path_state(const Round& round, const Vertex<W, Lobes>& v, const PathLanes<W>& p,
                                      const BsdfSample<W>& s, PathLanes<W>& n) {
  using F = vfloat<W>;
  const Scene& scene = round.scene;
  if (scene.has_thin) n.travelled = select(s.straight, p.travelled + dot(v.it.p - p.ray.o, p.ray.d), F(0.0f));
  if (round.needs.cones) {
    n.cone_width = p.cone_width + p.cone_spread * dot(v.it.p - p.ray.o, p.ray.d);
    n.cone_spread = p.cone_spread + select(s.pdf > F(0.0f), kLobeSpread / sqrt(max(s.pdf, 1e-6f)), F(0.0f));
  }
  if (round.needs.normals) n.normal = select(s.straight, p.normal, facing(v));
  if (round.needs.links) n.link = select(s.straight, p.link, v.it.link);
  if (round.needs.diffuse_shares) n.diffuse_share = select(s.straight, p.diffuse_share, s.diffuse_share);
  // Guided paths keep their surface's split count until the next diffuse scattering event.
  if (round.settings.caustics) {
    const vbool<W> widely = (s.pdf > F(0.0f)) & (s.pdf < F(kDiffuseDensity));
    n.splits = select(widely, min(n.splits, float(round.settings.splits)), n.splits);
  }
}

// Plays Russian roulette among `alive`, divides the throughput of survivors, and returns the survival probabilities.
// `expected`: see expected_light(); `keep`: kRouletteKeep or kFibreKeep.
template <bool kInMedium, int W>
PRIMRAY_INLINE vfloat<W> play_roulette(const Round& round, vbool<W> straight, vfloat<W> expected, vfloat<W> keep,
                                       PathLanes<W>& n, vbool<W>& alive) {
  using F = vfloat<W>;
  using I = vint<W>;
  const I bounce = n.vertex;
  const vbool<W> roulette = alive & (bounce >= I(kRouletteStart)) & !straight;
  F survive(1.0f);
  if (!any(roulette)) return survive;
  constexpr int kDeep = kInMedium ? kMediumDeep : kRouletteDeep;
  constexpr float kDeepKeep = kInMedium ? kMediumDeepKeep : kRouletteDeepKeep;
  const F most = select(bounce >= I(kDeep), F(kDeepKeep), F(1.0f));
  F expected_weight = max_component(n.beta) * parts_of(n) * keep;
  if (round.needs.first_received)
    expected_weight = select(n.first_received > F(0.0f), max(expected_weight * expected, kLeastSurvival), expected_weight);
  survive = select(roulette, min(expected_weight, most), survive);
  const F r = n.sampler.single(bounce, Purpose::kRoulette);
  alive &= !(roulette & (r >= survive));
  n.beta = n.beta * (1.0f / survive);
  if (PathLog* const log = path_log<W>(round))
    log->add("roulette", n).put("survival", survive).put("number", r).put("survives", alive).put("throughput", n.beta);
  return survive;
}

// Stores the medium state of paths that continue with the BSDF sample `s`.
template <int W>
PRIMRAY_RARE void put_medium_state(Round& round, const Compaction<W>& c, const MediumInterface<W>& media,
                                   const BsdfSample<W>& s, const vvec3<W>& ng, vfloat<W> origin_distance) {
  MediumState<W> state = media.state_after(s);
  state.origin_distance = origin_distance;
  if (any(s.enters)) state.guide = WalkGuide<W>::entering(state.subsurface, ng);
  round.worker.medium_states->next->put(round.worker.next->count, c, state);
}
template <int W>
PRIMRAY_RARE void attenuate_sky_light(Round& round, vbool<W> lit, const MediumInterface<W>& media, const BsdfSample<W>& s,
                                      vfloat<W> origin_distance, vvec3<W>& carried) {
  const MediumState<W> state = media.state_after(s);
  if (!round.scene.shadows_need_hits)
    carried =
        carried * state.medium(round.scene).transmittance(vfloat<W>(kInfinity)) * radiance_scale(round.scene, state.stack);
  round.worker.medium_states->shadows.put(round.worker.shadows.count, Compaction<W>(lit),
                                          ShadowMedia<W>{state.stack, origin_distance, state.volumes});
}

// Queues a shadow ray in place of a path's last ray where only the environment's visibility matters: it is cheaper to trace.
template <int W>
PRIMRAY_INLINE void queue_sky_shadow(Round& round, vbool<W> last, const PathLanes<W>& n, const MediumInterface<W>* media,
                                     const BsdfSample<W>& s, vfloat<W> origin_distance) {
  vvec3<W> carried = n.beta * evaluate_domes(round.scene.lights, last, n);
  const vbool<W> lit = last & (max_component(carried) > vfloat<W>(0.0f));
  if (!any(lit)) return;
  if constexpr (W == 1) {  // the light of each dome, of which what arrives has the same part
    if (PathLog* const log = path_log<W>(round)) log_domes(*log, round, n);
  }
  if (PathLog* const log = path_log<W>(round))
    log->add("dome ray", n).put("direction", n.ray.d).put("bsdf_pdf", n.bsdf_pdf).put("unshadowed", carried), log->queue();
  if (media) attenuate_sky_light(round, lit, *media, s, origin_distance, carried);
  if (round.has_volumes()) put_shadow_seeds(lit, round.worker.shadows, n);
  if (round.needs.lpe) put_sky_lpe_states(round, lit, n);
  const vint<W> sum = sum_of(round, n.slot, n.depth);
  round.worker.shadows.append(lit, n.ray.o, n.ray.d, vfloat<W>(kInfinity), carried, sum, n.ray.time, round.needs);
}

template <int W, class Lobes>
void scatter_once(Round& round, vbool<W> scatters, const Vertex<W, Lobes>& v, const PathLanes<W>& p,
                  const LobeRange<W>* range = nullptr) {
  using F = vfloat<W>;
  using I = vint<W>;
  using B = vbool<W>;
  const Scene& scene = round.scene;

  // Sample the next direction
  PathLanes<W> n = p;
  F own(0.0f);
  const BsdfSample<W> s = sample_direction(round, v, p, range, n.splits, own);
  PRIMRAY_ASSERT(are_weights(scatters, s.weight) && are_weights(scatters, s.pdf));
  PRIMRAY_ASSERT(are_unit(scatters & (max_component(s.weight) > F(0.0f)), s.wi));
  PRIMRAY_ASSERT(!any(scatters & s.is_delta & (s.pdf > F(0.0f))) || v.caustics || round.settings.guide);
  PRIMRAY_ASSERT(!any(scatters & s.straight & s.enters));
  if (const B through = scatters & s.straight & (p.depth == I(0)); scene.has_thin && any(through))
    update_gap_marks(round, through, v, s, p);
  n.ray.d = select(s.straight, p.ray.d, v.frame.to_world(s.wi));
  n.beta = p.beta * s.weight;
  B alive = offset_origins(round, scatters, v, s, p.ray.time, n) & (max_component(n.beta) > F(0.0f));
  if (PathLog* const log = path_log<W>(round)) {
    PathLog::Event& event = log->add("scatter", p).put("direction", n.ray.d).put("weight", s.weight).put("pdf", s.pdf);
    event.put("f_cos", s.weight * s.pdf).put("delta", s.is_delta).put("transmits", s.transmits).put("straight", s.straight);
    event.put("enters", s.enters).put("diffuse_share", s.diffuse_share).put("throughput", n.beta);
    if (!any(alive))
      log->end(p, any(max_component(n.beta) > F(0.0f)) ? "the direction is below the surface" : "the throughput is 0");
  }

  // Update the path state
  n.vertex = p.vertex + I(1);
  if (round.deep) n.slot = select(s.straight, n.slot, n.slot | I(kSettled));
  // A path that enters below a surface has not scattered until it leaves again.
  n.depth = p.depth + select(s.straight | s.enters, I(0), I(1));
  alive &= n.depth <= I(round.settings.max_depth);
  // Rays from the last vertex can only collect emission; end the paths if no ray could hit a light.
  const B last = n.depth == I(round.settings.max_depth);
  if (!scene.rays_find_light) alive &= !last;
  n.bsdf_pdf = select(s.straight, p.bsdf_pdf, v.caustics ? own : s.pdf);
  update_path_state(round, v, p, s, n);
  if (round.needs.lpe) advance_lpe<Lobes::kInMedium>(*round.settings.lpe, p, s, n);
  const F expected =
      round.needs.first_received ? expected_light(*round.settings.guide, v.place, n.ray.d, n.first_received) : F(0.0f);
  if (PathLog* const log = path_log<W>(round); log && any(n.depth > I(round.settings.max_depth)))
    log->end(p, "the maximum depth is reached");

  // End paths that cannot find light or that Russian roulette ends
  F keep(kRouletteKeep);
  if constexpr (Lobes::kFibres) keep = select(v.bsdf.is_hair, F(kFibreKeep), keep);
  const F survive = play_roulette<Lobes::kInMedium>(round, s.straight, expected, keep, n, alive);
  // End the paths as well if light sampling alone finds all lights near them.
  if (scene.only_hierarchy_lights_found)
    alive &= (!last) | s.straight | s.enters |
             may_hit_light(scene.lights.hierarchy, alive & last & !s.straight, n.ray.o, n.ray.d, n.bsdf_pdf);
  if (PathLog* const log = path_log<W>(round); log && !any(alive))
    log->end_if_open(p, "no light is left to be found at the maximum depth");
  if (!any(alive)) return;

  // Set the ray's ends
  // The far plane also applies to what the camera sees through a gap.
  n.ray.tnear = F(0.0f);
  if constexpr (Lobes::kFibres)
    n.ray.tnear = distance_through_tube(alive & v.bsdf.is_hair & s.transmits & !s.straight, v.it, n.ray.d);
  n.ray.tfar = select(s.straight & (p.depth == I(0)), p.ray.tfar - dot(n.ray.o - p.ray.o, p.ray.d), F(kInfinity));

  // Replace last rays to the sky by shadow rays
  // No lights are sampled during a random walk below a surface.
  const bool in_media = Lobes::kFollowsMedia && v.media;
  if (in_media) n.bsdf_pdf = select(v.media->incoming.in_subsurface(), F(0.0f), n.bsdf_pdf);
  if (const B sky = alive & last & !(s.straight | s.enters); scene.only_domes_found && any(sky)) {
    queue_sky_shadow(round, sky, n, in_media ? v.media : nullptr, s,
                     in_media ? origin_distance_of(v.it.offset, v.ng, n.ray.d) : F(0.0f));
    alive &= !sky;
    if (!any(alive)) return;
  }

  // Store the paths that continue
  if (round.settings.guide_log)
    keep_vertex<Lobes::kInMedium>(*round.settings.guide_log, alive & (s.pdf > F(0.0f)), v.it.p, v.ng, v.frame.n, s.pdf, survive,
                                  n);
  const Compaction<W> c(alive);
  if (in_media) put_medium_state(round, c, *v.media, s, v.ng, origin_distance_of(v.it.offset, v.ng, n.ray.d));
  round.worker.next->append(c, n, round.needs);
}

// Splits each path at its first surface that is neither mirror nor smooth glass: more work goes to what follows than to finding
// that surface.
template <int W, class Lobes>
void scatter_or_split(Round& round, vbool<W> scatters, const Vertex<W, Lobes>& v, const PathLanes<W>& p) {
  const int splits = round.settings.splits;
  const vbool<W> split = scatters & is_whole(p) & !v.bsdf.mirror;
  if (!any(split)) return scatter_once(round, scatters, v, p);
  if (round.branches && round.sorts && any(scatters & !split)) {
    // A path of the same sample that does not split may come before or after.
    const vbool<W> kinds[2] = {split, scatters & !split};
    return for_kinds(true, kinds, [&](int, vbool<W> lanes) { scatter_or_split(round, lanes, v, p); });
  }
  PathLanes<W> part = split_part(p, split, splits);
  part.splits = select(split, vfloat<W>(float(splits)), p.splits);
  for (int k = 0; k < splits; ++k) {
    number_part(part, p, split, splits, k);
    scatter_once(round, k == 0 ? scatters : split, v, part);
  }
}

// Follows both directions at smooth glass, weighted by their probabilities: a lamp that glass mirrors is as certain as what is
// seen through it. The less likely direction comes first and is not split: a sample whose paths split in turn would be summed
// up in an order that depends on the number of lanes.
template <int W, class Lobes>
PRIMRAY_RARE void scatter_both(Round& round, vbool<W> both, const Vertex<W, Lobes>& v, const PathLanes<W>& p) {
  using F = vfloat<W>;
  const F one(1.0f), reflected = v.bsdf.p_specular, passed = one - reflected;
  const vbool<W> mirrors_less = reflected < passed;
  for (const bool less : {true, false}) {
    const vbool<W> mirrors = less ? mirrors_less : !mirrors_less;
    const F share = select(mirrors, reflected, passed);
    const LobeRange<W> range{select(mirrors, F(0.0f), reflected), select(mirrors, reflected * 0x1.fffffep-1f, passed)};
    PathLanes<W> part = p;
    part.beta = p.beta * share;
    // Roulette counts it as a part of that share: lossless glass in a white sky stays white in each sample.
    part.splits = less ? one / share : F(kBranched);
    if (less) part.sampler.reversed_index = p.sampler.reversed_index ^ vuint<W>(1u);  // far on in the same sequence
    scatter_once(round, both, v, part, &range);
  }
}

template <int W, class Lobes>
void scatter(Round& round, vbool<W> scatters, const Vertex<W, Lobes>& v, const PathLanes<W>& p) {
  if constexpr (requires { v.bsdf.is_smooth_glass(); }) {
    if (round.branches) {
      vbool<W> both = scatters & (p.splits == vfloat<W>(kUnbranched)) & v.bsdf.is_smooth_glass();
      // A packet's straight paths pass what is hidden from the camera before others are shaded.
      if (round.scene.camera_visibility.any()) both &= !v.bsdf.thin;
      if (any(both)) {
        scatter_both(round, both, v, p);
        scatters &= !both;
        if (!any(scatters)) return;
      }
    }
  }
  scatter_or_split(round, scatters, v, p);
}

}  // namespace primray
