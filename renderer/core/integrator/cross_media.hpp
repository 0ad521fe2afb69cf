// Stage between trace and shade for scenes with participating media: attenuates paths up to their next hit, or scatters them in
// the medium before it. Paths that scatter continue from that point and are not shaded in this round. Random walks
// below opaque surfaces take hundreds of such steps, each of which costs only a ray and a new direction.
#pragma once

#include "integrator/end_rays.hpp"
#include "integrator/log_vertex.hpp"
#include "integrator/lpe_light.hpp"
#include "integrator/media.hpp"
#include "integrator/phase_vertex.hpp"
#include "integrator/place_in_depth.hpp"
#include "integrator/sample_light.hpp"
#include "integrator/scatter.hpp"

namespace primray {

// Continues paths from distance `t` along their rays without sampling lights; `end`: distance at which those ended, or hit.
template <int W>
PRIMRAY_INLINE void scatter_unlit(Round& round, vbool<W> scatters, const PathLanes<W>& p, vfloat<W> t, vfloat<W> end,
                                  const MediumState<W>& state, vfloat<W> phase) {
  using F = vfloat<W>;

  // Sample the phase function, below surfaces together with the walk's guide
  PathLanes<W> n = p;
  MediumState<W> scattered = state;
  scattered.origin_distance = F(0.0f);
  const vbool<W> below = state.in_subsurface();
  const vint<W> bounce = p.vertex + vint<W>(1);
  const Pair<W> u = p.sampler.link(bounce + vint<W>(round.first_link()));
  const vvec3<W> local = sample_phase(phase, u.u, u.v);
  F density = phase_density(local.z, phase);
  n.ray.d = Frame<F>(p.ray.d).to_world(local);
  if (any(scatters & below)) {
    scattered.guide.move(p.ray.d, t, end);
    const WalkDirection<W> next = sample_walk_direction(scattered.guide, state.subsurface, p.beta, p.ray.d, u.u, u.v);
    n.ray.d = select(below, next.d, n.ray.d), density = select(below, next.phase_pdf, density);
    n.beta = select(below, p.beta * next.weight, p.beta);
    scattered.guide.phase_pdf = next.phase_pdf;
  }
  n.ray.o = p.ray.o + p.ray.d * t;
  n.ray.tnear = F(0.0f), n.ray.tfar = F(kInfinity);

  // Update the path state
  n.vertex = bounce;
  if (round.deep) n.slot = n.slot | vint<W>(kSettled);
  n.depth = p.depth + select(below, vint<W>(0), vint<W>(1));
  n.bsdf_pdf = n.travelled = F(0.0f);
  n.cone_width = p.cone_width + p.cone_spread * t;
  n.cone_spread = p.cone_spread + kLobeSpread / sqrt(max(density, 1e-6f));
  n.normal = vvec3<W>(F(0.0f)), n.diffuse_share = vvec3<W>(F(1.0f));
  if (round.needs.lpe) advance_lpe_in_medium(*round.settings.lpe, scatters & !below, n);

  // Play Russian roulette
  vbool<W> alive = scatters & (max_component(n.beta) > F(0.0f)) & (n.depth <= vint<W>(round.settings.max_depth));
  const vbool<W> thins = alive & (bounce >= vint<W>(kRouletteStart));
  const F most = select(bounce >= vint<W>(kMediumDeep), F(kMediumDeepKeep), F(1.0f));
  const F survive = select(thins, min(max_component(n.beta) * parts_of(n) * kRouletteKeep, most), F(1.0f));
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

// Scatters at distance `t` along the rays as at any vertex: lights are sampled there. `path`: see PhaseLobes.
template <int W>
PRIMRAY_RARE void scatter_lit(Round& round, vbool<W> scatters, const PathLanes<W>& p, vint<W> path, vfloat<W> t,
                              const MediumState<W>& state, vfloat<W> phase) {
  const MediumInterface<W> media{state, Boundary<W>(state.stack), {}};
  with_phase_vertex(round, p, path, t, phase, &media, [&](const auto& v) {
    if (round.scene.lights.count > 0) sample_lights(round, scatters & (p.depth < vint<W>(round.settings.max_depth)), v, p);
    scatter(round, scatters, v, p);
  });
}

// Samples the distance at which paths collide with the fog: shortens `end` to it, and returns the lanes for which it is
// shorter. Fog that only absorbs is taken into account by `p.beta`.
template <int W>
PRIMRAY_RARE vbool<W> collide_in_fog(const Round& round, vbool<W> in_medium, const RayMedium<W>& medium, vfloat<W>& end,
                                     PathLanes<W>& p) {
  const Fog& fog = round.scene.interiors.fog;
  if (fog.extinction == 0) return vbool<W>(false);
  if (!fog.scatters()) {
    p.beta = select(in_medium, p.beta * medium.fog.transmittance(end), p.beta);
    return vbool<W>(false);
  }
  const Pair<W> u = p.sampler.pair(p.vertex + vint<W>(kFogDimensions), Purpose::kLens);
  const vfloat<W> t = medium.fog.collision(u.u);
  const vbool<W> collides = in_medium & (t < end);
  end = select(collides, t, end);
  return collides;
}

// Sets alpha of camera rays that reach nothing to what fog without scattering absorbs.
template <int W>
PRIMRAY_RARE void cover_by_fog(Round& round, vbool<W> escapes, PathLanes<W>& p) {
  if (round.scene.interiors.fog.scatters()) return;
  for (uint32_t b = bits(escapes & (p.vertex == vint<W>(0))); b; b &= b - 1) {
    const int i = __builtin_ctz(b);
    const float covered = 1 - (p.beta.x[i] + p.beta.y[i] + p.beta.z[i]) * (1.0f / 3);
    alpha_of(round, p.slot[i]) = covered;
    if (!round.deep) continue;
    p.slot.set(i, round.deep->placed_far(p.slot[i], 0.0f));
    round.deep->cover(p.slot[i], covered);
  }
}

// Sets phase function and throughput of paths that scatter in the fog.
template <int W>
PRIMRAY_RARE void scatter_in_fog(const Round& round, vbool<W> m, vfloat<W>& phase, PathLanes<W>& p) {
  const Fog& fog = round.scene.interiors.fog;
  const vvec3<W> albedo{vfloat<W>(fog.albedo.x), vfloat<W>(fog.albedo.y), vfloat<W>(fog.albedo.z)};
  p.beta = select(m, p.beta * albedo, p.beta);
  phase = select(m, vfloat<W>(fog.phase), phase);
  // All lights illuminate the fog, whichever surface the path comes from.
  p.link = select(m, vint<W>(0), p.link);
}

// Returns distances in [0, end) for numbers `u`, in proportion to the transmittance of an extinction: where light emitted along
// rays comes from.
template <int W>
PRIMRAY_INLINE vfloat<W> emission_distance(vfloat<W> extinction, vfloat<W> end, vfloat<W> u) {
  const vfloat<W> length = min(end, 1e18f), depth = extinction * length;
  const vfloat<W> passed = depth_of(u * (1.0f - exp_of_minus(depth))) / max(extinction, 1e-30f);
  return select(depth < vfloat<W>(1e-3f), u * length, passed);
}

// Adds to a deep picture what media and fog emit along the paths up to `end`.
template <int W>
PRIMRAY_RARE void place_medium_emission(Round& round, const RayMedium<W>& medium, const MediumState<W>& state, vfloat<W> end,
                                        const vvec3<W>& of_media, const vvec3<W>& of_fog, const PathLanes<W>& p) {
  using F = vfloat<W>;
  const F u = p.sampler.single(p.vertex + vint<W>(kFogDimensions), Purpose::kLobe);
  const auto place = [&](F t, const vvec3<W>& light) {
    place_light(round, max(t - state.origin_distance, 0.0f), p.beta * light, p);
  };
  const vvec3<W>& k = medium.extinction;
  place(emission_distance((k.x + k.y + k.z) * (1.0f / 3), end, u), of_media);
  if (medium.any_fog)
    place(min(medium.fog.distance(emission_distance(F(round.scene.interiors.fog.extinction), medium.fog.length(end), u)), end),
          of_fog);
}

// Adds what media emit along the paths up to `end`: of volumes and objects up to where light collides with the fog, of the fog
// as much as these transmit from one of its points. Both have the expectation of the integral with both transmittances.
template <int W>
PRIMRAY_RARE void add_medium_emission(Round& round, vbool<W> in_medium, const RayMedium<W>& medium, const MediumState<W>& state,
                                      vfloat<W> end, const PathLanes<W>& p) {
  using F = vfloat<W>;
  using V = vvec3<W>;
  const V none(F(0.0f));
  const Fog& fog = round.scene.interiors.fog;
  Pair<W> u{F(0.0f), F(0.0f)};
  if (medium.any_fog) u = p.sampler.pair(p.vertex + vint<W>(kFogDimensions), Purpose::kLens);
  const F own = medium.any_fog ? min(end, medium.fog.collision(u.u)) : end;
  const V L = select(in_medium, medium.emission * integral_of_transmittance(medium.extinction, own), none);
  V glow = none;
  if (medium.any_fog && fog.emits()) {
    const V shines{F(fog.emission.x), F(fog.emission.y), F(fog.emission.z)};
    const F length = medium.fog.length(end), depth = length * fog.extinction;
    // Endless fog without extinction would have no bound.
    const F whole = select((length < F(kEndless)) | (depth > F(1.0f)), length * mean_of_exp(depth), F(0.0f));
    V left(F(1.0f));
    if (any(in_medium & medium.Medium<W>::exists())) {
      // A point in proportion to what arrives from there through the fog alone.
      const F arrives = 1.0f - exp_of_minus(depth);
      const F l = select(depth < F(1e-3f), u.v * length, depth_of(u.v * arrives) / max(F(fog.extinction), 1e-30f));
      left = medium.Medium<W>::transmittance(min(medium.fog.distance(l), end));
    }
    glow = select(in_medium & medium.fog.lanes, shines * left * whole, none);
  }
  const F scale = radiance_scale(round.scene, state.stack);
  const V scaled = (L + glow) * scale;
  if (PathLog* const log = path_log<W>(round); log && any(in_medium & (max_component(scaled) > F(0.0f))))
    log->add("gathered", p).put("radiance", scaled).why = "a medium emits";
  add_to_slots(round, in_medium, sum_of(round, unplaced(round, p.slot), p.depth), p.beta * scaled);
  if (round.deep) place_medium_emission(round, medium, state, own, L * scale, glow * scale, p);
  if (!round.needs.lpe) return;
  record_emission(*round.worker.lpe, in_medium, vint<W>(int32_t(kEndObject)), scaled, LobeFactors{});
  add_recorded(round, p, p.beta);
}

// Takes from the alpha of camera rays what matte volumes extinguish on the way, of a throughput that was `before`.
template <int W>
PRIMRAY_RARE void leave_out_mattes(Round& round, vbool<W> in_medium, vbool<W> collides, const RayMedium<W>& medium,
                                   const vvec3<W>& before, const PathLanes<W>& p) {
  const VolumeSets& sets = round.worker.medium_states->sets;
  if (!sets.any_matte()) return;
  const vfloat<W> share = sets.matte_share(medium.row);
  // Paths in media that scatter lose all of their throughput where they collide, and elsewhere nothing of it.
  const vvec3<W> lost = select(collides, before, select(medium.scatters(), vvec3<W>(vfloat<W>(0.0f)), before - p.beta));
  for (uint32_t b = bits(in_medium & (p.depth == vint<W>(0)) & (share > vfloat<W>(0.0f))); b; b &= b - 1) {
    const int i = __builtin_ctz(b);
    const float part = share[i] * (lost.x[i] + lost.y[i] + lost.z[i]) * (1.0f / 3);
    alpha_of(round, p.slot[i]) -= part;
    if (round.deep) round.deep->cover(p.slot[i], -part);
  }
}

// Chooses one of the overlapping volumes for paths that scatter, in proportion to what each would add to the throughput.
template <int W>
PRIMRAY_RARE void choose_phase(const Round& round, vbool<W> scatters, vint<W> row, vfloat<W>& phase, PathLanes<W>& p) {
  const VolumeSets& sets = round.worker.medium_states->sets;
  for (uint32_t b = bits(scatters); b; b &= b - 1) {
    const int i = __builtin_ctz(b);
    const std::span<const VolumeSets::Member> members = sets.members(row[i]);
    if (members.size() < 2) continue;
    vec3 sum(0.0f);
    for (const VolumeSets::Member& m : members) sum = sum + m.scattering;
    const auto share = [](float part, float of) { return of > 0 ? part / of : 0.0f; };
    const auto part = [&](const VolumeSets::Member& m) {
      return vec3(p.beta.x[i] * share(m.scattering.x, sum.x), p.beta.y[i] * share(m.scattering.y, sum.y),
                  p.beta.z[i] * share(m.scattering.z, sum.z));
    };
    const float total = p.beta.x[i] + p.beta.y[i] + p.beta.z[i];
    float left = p.sampler.single(p.vertex + vint<W>(1), Purpose::kLobe)[i] * total;
    const VolumeSets::Member* chosen = nullptr;
    vec3 taken(0.0f);
    for (const VolumeSets::Member& m : members) {
      const vec3 own = part(m);
      const float weight = own.x + own.y + own.z;
      if (weight <= 0) continue;
      chosen = &m, taken = own * (total / weight);
      if ((left -= weight) < 0) break;
    }
    if (!chosen) continue;
    phase.set(i, chosen->phase);
    p.beta.x.set(i, taken.x), p.beta.y.set(i, taken.y), p.beta.z.set(i, taken.z);
  }
}

// Advances the packet of paths at `at` of the pool through their medium; returns the lanes that are shaded next.
template <int W>
PRIMRAY_INLINE vbool<W> cross_medium(Round& round, int at, vbool<W> active, vbool<W> in_medium, RayMedium<W>& medium,
                                     const MediumState<W>& state, const Hits<W>& hits, PathLanes<W>& p) {
  using F = vfloat<W>;
  const Scene& scene = round.scene;
  const vbool<W> hit = active & (hits.geom != vint<W>(-1));
  const vbool<W> ended = in_medium & ends_at_collision(scene, state, medium, p.depth), stopped = hit | ended;
  const vbool<W> in_subsurface = state.in_subsurface(), may_scatter = in_medium & medium.scatters();

  // Choose by what the next distance is drawn; walks that are not guided yet are traced farther than that
  Pair<W> u{F(0.0f), F(0.0f)};
  if (any(may_scatter)) u = distance_numbers(p.sampler, p.vertex);
  const vbool<W> guided = may_scatter & in_subsurface & state.guide.guides(), measures = ended & in_subsurface & !guided;
  WalkDistance<W> walk;
  if (any(guided)) walk = WalkDistance<W>(state.guide, medium, p.beta, p.ray.d);
  if (any(ended)) medium.end_at_collisions(ended, p.beta, guided, walk);
  if (any(measures)) {
    const F t = max(draw_distance(medium, p.beta, u.u, u.v) - state.origin_distance, 0.0f);
    p.ray.tfar = select(measures, min(p.ray.tfar, t), p.ray.tfar);
  }
  F end = select(hit, hits.t, kInfinity);
  vbool<W> stays = active;

  // Add lights that the rays hit in the medium
  vvec3<W> gathered(F(0.0f));
  const LightHits<W> light_hits =
      intersect_lights(scene.lights, in_medium, stopped, p, hits.t, gathered, &medium, state.origin_distance);
  if constexpr (W == 1) {
    if (PathLog* const log = path_log<W>(round)) {
      log_light_hits(*log, round, in_medium, p, hits, stopped, &medium, state.origin_distance);
      log->add("gathered", p).put("radiance", gathered * radiance_scale(scene, state.stack));
    }
  }
  const vbool<W> covered = in_medium & light_hits.covered;
  if (round.deep) place_events(round, covered, light_hits.nearest, false, p);
  add_to_slots(round, in_medium, sum_of(round, p.slot, p.depth), p.beta * gathered * radiance_scale(scene, state.stack));
  if (round.needs.lpe) {
    record_light_hits(round, in_medium, p, hits, stopped, ListenerMedium<W>{&medium, state.origin_distance});
    add_recorded(round, p, p.beta * radiance_scale(scene, state.stack));
  }
  p.ray.tfar = select(ended, F(kInfinity), p.ray.tfar);

  // End paths at lights that they see as bodies
  end = select(covered, light_hits.nearest, end);
  for (uint32_t b = bits(covered & (p.vertex == vint<W>(0))); b; b &= b - 1) alpha_of(round, p.slot[__builtin_ctz(b)]) = 1.0f;
  stays &= !covered;

  // Sample the fog's collision, which ends what happens in other media
  end += state.origin_distance;
  const vvec3<W> before = p.beta;
  vbool<W> in_fog(false);
  if (medium.any_emission) add_medium_emission(round, in_medium, medium, state, end, p);
  if (medium.any_fog) in_fog = collide_in_fog(round, in_medium, medium, end, p);
  if (medium.any_fog) cover_by_fog(round, in_medium & !hit & !covered, p);

  // Attenuate paths in media that only absorb
  p.beta = select(in_medium & !may_scatter, p.beta * medium.Medium<W>::transmittance(end), p.beta);
  if (PathLog* const log = path_log<W>(round); log && any(in_medium & !may_scatter))
    log->add("medium", p).put("distance", log->length(end)).put("throughput", p.beta).why = "absorbs";
  if (!any(may_scatter | in_fog)) {
    if (medium.any_volumes) leave_out_mattes(round, in_medium, vbool<W>(false), medium, before, p);
    return stays;
  }

  // Sample the distance to the next scattering event
  DistanceSample<W> step{};
  if (any(may_scatter & !guided)) step = sample_distance(medium, p.beta, end, u.u, u.v);
  if (any(guided)) {
    const DistanceSample<W> s = walk.at(walk.draw(u.u, u.v), end, medium.scattering, p.beta);
    step.scatters = (guided & s.scatters) | (step.scatters & !guided);
    step.t = select(guided, s.t, step.t), step.beta = select(guided, s.beta, step.beta);
  }
  p.beta = select(may_scatter, step.beta, p.beta);
  const vbool<W> collides = may_scatter & step.scatters, scatters = collides | in_fog;
  const F t = max(select(may_scatter, step.t, end) - state.origin_distance, 0.0f);
  F phase = medium.phase;
  if (medium.any_fog) scatter_in_fog(round, in_fog & !collides, phase, p);
  if (medium.any_volumes) {
    leave_out_mattes(round, in_medium, collides, medium, before, p);
    choose_phase(round, collides, medium.row, phase, p);
  }
  if (PathLog* const log = path_log<W>(round); log && any(may_scatter))
    log->add("medium", p).put("distance", log->length(any(scatters) ? t : end)).put("throughput", p.beta).why =
        any(scatters) ? "scatters" : "is crossed";

  // Scatter the paths that do not reach their hit
  if (any(scatters)) {
    if (round.needs.lpe) resolve_lpe_where(scatters, p);
    if (round.deep) place_events(round, scatters, t, true, p);
    for (uint32_t b = bits(scatters & (p.vertex == vint<W>(0))); b; b &= b - 1)
      alpha_of(round, p.slot[__builtin_ctz(b)]) = 1.0f;
    vbool<W> lit = scatters & is_lit(scene, state);
    // Guides are for vertices of both kinds, if no lights are sampled anywhere.
    if (scene.lights.count == 0 && (round.settings.guide || round.settings.guide_log)) lit = scatters & !in_subsurface;
    const vbool<W> kinds[2] = {scatters & !lit, lit};
    for_kinds(round.has_parts(), kinds, [&](int kind, vbool<W> lanes) {
      if (kind == 0) return scatter_unlit(round, lanes, p, t, hits.t, state, phase);
      scatter_lit(round, lanes, p, lane_numbers<W>() + vint<W>(at), t, state, phase);
    });
  }

  // A random walk that hits no surface has left through a gap, or by rounding.
  return stays & !scatters & !(in_subsurface & !hit);
}

// Adds to the sets of the paths at `at` the volumes that they are about to leave.
template <int W>
PRIMRAY_RARE void enter_missed_volumes(Round& round, int at, vbool<W> active, MediumState<W>& state) {
  const PathPool& pool = *round.worker.pool;
  Hits<W> hits = pool.hits<W>(at);
  const vbool<W> hit = active & (hits.geom >= vint<W>(0));
  if (!any(hit)) return;
  Rays<W> rays = pool.rays<W>(at);
  if (round.needs.time) rays.time = load<W>(pool.time + at);
  hits.time = rays.time;
  const Interaction<W> it = interact(round.scene, hit, rays, hits);
  const vbool<W> leaves = bounds_volume(round.scene, hit, it.surface) & (dot(it.ng, rays.d) > vfloat<W>(0.0f));
  if (!any(leaves)) return;
  MediumStateStore& media = *round.worker.medium_states;
  enter_missed(round.scene, media.sets, leaves, hits, it.surface, vbool<W>(false), state.volumes);
  store(media.pool->volumes + at, state.volumes);
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
    MediumState<W> state = states.at<W>(at);
    if (states.walks) state.guide = states.guide_at<W>(at);
    if (round.scene.interiors.has_bounded()) enter_missed_volumes(round, at, active, state);
    RayMedium<W> medium = medium_at(round, at, state);
    const vbool<W> in_medium = active & medium.exists();
    if (!any(in_medium) && staying == at) {
      staying += std::min(W, count - at);
      continue;
    }
    PathLanes<W> p = pool.paths<W>(at, round.needs);
    const Hits<W> hits = pool.hits<W>(at);
    const vbool<W> stays = any(in_medium) ? cross_medium(round, at, active, in_medium, medium, state, hits, p) : active;
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
