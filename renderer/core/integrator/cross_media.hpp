// Stage between trace and shade for scenes with participating media: attenuates paths up to their next hit, or scatters them in
// the medium before it. Paths that scatter continue from that point and are not shaded in this round. Random walks
// below opaque surfaces take hundreds of such steps, each of which costs only a ray and a new direction.
#pragma once

#include "integrator/log_vertex.hpp"
#include "integrator/lpe_light.hpp"
#include "integrator/media.hpp"
#include "integrator/sample_light.hpp"
#include "integrator/scatter.hpp"

namespace primray {

// Continues paths from distance `t` along their rays without sampling lights.
template <int W>
PRIMRAY_INLINE void scatter_unlit(Round& round, vbool<W> scatters, const PathLanes<W>& p, vfloat<W> t,
                                  const MediumState<W>& state, vfloat<W> phase) {
  using F = vfloat<W>;

  // Sample the phase function
  PathLanes<W> n = p;
  const vint<W> bounce = p.vertex + vint<W>(1);
  const Pair<W> u = p.sampler.link(bounce + vint<W>(round.first_link()));
  const vvec3<W> local = sample_phase(phase, u.u, u.v);
  n.ray.o = p.ray.o + p.ray.d * t;
  n.ray.d = Frame<F>(p.ray.d).to_world(local);
  n.ray.tnear = F(0.0f), n.ray.tfar = F(kInfinity);

  // Update the path state
  n.vertex = bounce;
  const vbool<W> below = state.in_subsurface();
  n.depth = p.depth + select(below, vint<W>(0), vint<W>(1));
  n.bsdf_pdf = n.travelled = F(0.0f);
  MediumState<W> scattered = state;
  scattered.origin_distance = F(0.0f);
  n.cone_width = p.cone_width + p.cone_spread * t;
  n.cone_spread = p.cone_spread + kLobeSpread / sqrt(max(phase_density(local.z, phase), 1e-6f));
  n.normal = vvec3<W>(F(0.0f)), n.diffuse_share = vvec3<W>(F(1.0f));
  if (round.needs.lpe) advance_lpe_in_medium(*round.settings.lpe, scatters & !below, n);

  // Play Russian roulette
  vbool<W> alive = scatters & (max_component(n.beta) > F(0.0f)) & (n.depth <= vint<W>(round.settings.max_depth));
  const vbool<W> thins = alive & (bounce >= vint<W>(kRouletteStart));
  const F most = select(bounce >= vint<W>(kMediumDeep), F(kMediumDeepKeep), F(1.0f));
  const F survive = select(thins, min(max_component(n.beta) * n.splits * kRouletteKeep, most), F(1.0f));
  if (any(thins & (survive < F(1.0f)))) {
    alive &= !(thins & (n.sampler.single(bounce, Purpose::kRoulette) >= survive));
    n.beta = n.beta * (1.0f / survive);
  }
  if (PathLog* const log = path_log<W>(round)) {
    log->add("scatter", p).put("direction", n.ray.d).put("throughput", n.beta).why = "phase function";
    if (!any(alive)) log->end(p, "roulette, or the maximum depth is reached");
  }

  // Store the paths that continue
  const Compaction<W> c(alive);
  round.worker.medium_states->next->put(round.worker.next->count, c, scattered);
  round.worker.next->append(c, n, round.needs);
}

// Scatters at distance `t` along the rays as at any vertex: lights are sampled there.
template <int W>
PRIMRAY_RARE void scatter_lit(Round& round, vbool<W> scatters, const PathLanes<W>& p, vfloat<W> t, const MediumState<W>& state,
                              vfloat<W> phase) {
  using F = vfloat<W>;
  const vvec3<W> back = -p.ray.d;
  Interaction<W> it;
  it.p = p.ray.o + p.ray.d * t, it.ng = it.ns = back;
  it.offset = it.least_cosine = F(0.0f);
  it.at_edge = it.smooth = vbool<W>(false);
  it.surface = it.mesh = it.triangle = it.curved = vint<W>(0);
  it.link = round.needs.links ? max(p.link, vint<W>(0)) : vint<W>(0);
  it.color = vvec3<W>(F(1.0f));
  Hits<W> hits{};
  const MediumInterface<W> media{state, Boundary<W>(state.stack), {}};
  const vvec3<W> head_on(F(0.0f), F(0.0f), F(1.0f));
  const Vertex<W, PhaseLobes<W>> v{
      it, back, Frame<F>(back), head_on, PhaseLobes<W>(phase), hits, {vint<W>(-1), vint<W>(0)}, nullptr, &media};
  if (round.scene.lights.count > 0) sample_lights(round, scatters & (p.depth < vint<W>(round.settings.max_depth)), v, p);
  scatter(round, scatters, v, p);
}

// Returns the lanes in which light samples can contribute: media without a refracting boundary, and all media if a light is
// inside one.
template <int W>
PRIMRAY_INLINE vbool<W> is_lit(const Scene& scene, const MediumState<W>& state) {
  if (scene.lights.count == 0) return vbool<W>(false);
  return (!state.in_subsurface()) & (vbool<W>(scene.interiors.lit) | (ior_in(scene, state.stack) == vfloat<W>(1.0f)));
}

// Advances one packet of paths of the pool through their medium; returns the lanes that are shaded next.
template <int W>
PRIMRAY_INLINE vbool<W> cross_medium(Round& round, vbool<W> active, vbool<W> in_medium, const Medium<W>& medium,
                                     const MediumState<W>& state, const Hits<W>& hits, PathLanes<W>& p) {
  using F = vfloat<W>;
  const Scene& scene = round.scene;
  const vbool<W> hit = active & (hits.geom != vint<W>(-1));
  F end = select(hit, hits.t, kInfinity);
  vbool<W> stays = active;

  // Add lights that the rays hit in the medium
  vvec3<W> gathered(F(0.0f));
  const LightHits<W> light_hits =
      intersect_lights(scene.lights, in_medium, hit, p, hits.t, gathered, &medium, state.origin_distance);
  if constexpr (W == 1) {
    if (PathLog* const log = path_log<W>(round)) {
      log_light_hits(*log, round, in_medium, p, hits, hit, &medium, state.origin_distance);
      log->add("gathered", p).put("radiance", gathered * radiance_scale(scene, state.stack));
    }
  }
  add_to_slots(round, in_medium, sum_of(round, p.slot, p.depth), p.beta * gathered * radiance_scale(scene, state.stack));
  if (round.needs.lpe) {
    record_light_hits(round, in_medium, p, hits, hit, ListenerMedium<W>{&medium, state.origin_distance});
    add_recorded(round, p, p.beta * radiance_scale(scene, state.stack));
  }

  // End paths at lights that they see as bodies
  const vbool<W> covered = in_medium & light_hits.covered;
  end = select(covered, light_hits.nearest, end);
  for (uint32_t b = bits(covered & (p.vertex == vint<W>(0))); b; b &= b - 1) round.worker.a[p.slot[__builtin_ctz(b)]] = 1.0f;
  stays &= !covered;

  // Attenuate paths in media that only absorb
  const vbool<W> in_subsurface = state.in_subsurface(), may_scatter = in_medium & medium.scatters();
  end += state.origin_distance;
  p.beta = select(in_medium & !may_scatter, p.beta * medium.transmittance(end), p.beta);
  if (PathLog* const log = path_log<W>(round); log && any(in_medium & !may_scatter))
    log->add("medium", p).put("distance", log->length(end)).put("throughput", p.beta).why = "absorbs";
  if (!any(may_scatter)) return stays;

  // Sample the distance to the next scattering event; these sample dimensions are used by camera rays only
  const Pair<W> u = p.sampler.pair(p.vertex + vint<W>(1), Purpose::kLens);
  const DistanceSample<W> step = sample_distance(medium, p.beta, end, u.u, u.v);
  p.beta = select(may_scatter, step.beta, p.beta);
  const vbool<W> scatters = may_scatter & step.scatters;
  const F t = max(step.t - state.origin_distance, 0.0f);
  if (PathLog* const log = path_log<W>(round); log && any(may_scatter))
    log->add("medium", p).put("distance", log->length(any(scatters) ? t : end)).put("throughput", p.beta).why =
        any(scatters) ? "scatters" : "is crossed";

  // Scatter the paths that do not reach their hit
  if (any(scatters)) {
    if (round.needs.lpe) resolve_lpe_where(scatters, p);
    for (uint32_t b = bits(scatters & (p.vertex == vint<W>(0))); b; b &= b - 1) round.worker.a[p.slot[__builtin_ctz(b)]] = 1.0f;
    const vbool<W> lit = scatters & is_lit(scene, state), kinds[2] = {scatters & !lit, lit};
    for_kinds(round.settings.splits > 1, kinds, [&](int kind, vbool<W> lanes) {
      if (kind == 0) return scatter_unlit(round, lanes, p, t, state, medium.phase);
      scatter_lit(round, lanes, p, t, state, medium.phase);
    });
  }

  // A random walk that hits no surface has left through a gap, or by rounding.
  return stays & !scatters & !(in_subsurface & !hit);
}

template <int W>
PRIMRAY_RARE void cross_media(Round& round) {
  Worker& w = round.worker;
  PathPool& pool = *w.pool;
  MediumStateColumns& states = *w.medium_states->pool;
  const int count = pool.count;
  int staying = 0;
  for (int at = 0; at < count; at += W) {
    const vbool<W> active = lane_numbers<W>() < vint<W>(count - at);
    const MediumState<W> state = states.at<W>(at);
    const Medium<W> medium = state.medium(round.scene);
    const vbool<W> in_medium = active & medium.exists();
    if (!any(in_medium) && staying == at) {
      staying += std::min(W, count - at);
      continue;
    }
    PathLanes<W> p = pool.paths<W>(at, round.needs);
    const Hits<W> hits = pool.hits<W>(at);
    const vbool<W> stays = any(in_medium) ? cross_medium(round, active, in_medium, medium, state, hits, p) : active;
    const Compaction<W> c(stays);
    states.put(staying, c, state);
    put_hits(pool, staying, c, hits);
    pool.count = staying;
    pool.append(c, p, round.needs);
    staying = pool.count;
  }
  pool.count = staying;
}

}  // namespace primray
