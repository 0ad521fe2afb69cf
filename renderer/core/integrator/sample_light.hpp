// Next-event estimation: chooses a light for each vertex, samples a point on it, and queues a shadow ray with its contribution.
#pragma once

#include "bsdf/bsdf.hpp"
#include "integrator/emission.hpp"
#include "integrator/lpe_light.hpp"
#include "integrator/vertex.hpp"
#include "light/mesh/emitter.hpp"
#include "light/sampler/tree_choice.hpp"
#include "light/sampler/volume_point.hpp"
#include "surface/ray_origin.hpp"

namespace primray {

// Lobes that influence which of many lights is sampled: of surfaces that are glossy enough, and of media.

// Minimum albedo, and maximum roughness (alpha), of a specular lobe that influences the choice.
constexpr float kLeastGlossy = 0.04f, kDullAlpha = 0.6f;
// Minimum weight of the diffuse remainder, since the preview lobe is only approximate.
constexpr float kLeastRest = 0.02f;

// Finds the lanes of `scatters` whose surface, seen along unit wo (world space), is glossy, and their lobes; returns whether
// there are any.
template <int W, class Lobes>
PRIMRAY_RARE bool find_glossy(vbool<W> scatters, const Lobes& b, const vvec3<W>& wo, LobePreview<W>& s) {
  const vbool<W> by_coat = b.any_coat ? b.p_coat > b.p_specular : vbool<W>(false);
  const vfloat<W> alpha = b.any_coat ? select(by_coat, b.coat_alpha, b.alpha) : b.alpha;
  s.specular = select(by_coat, b.p_coat, b.p_specular), s.rest = max(1.0f - s.specular, kLeastRest);
  s.m = scatters & b.preview & (by_coat | !b.mirror) & (s.specular > vfloat<W>(kLeastGlossy)) & (alpha < vfloat<W>(kDullAlpha));
  s.wo = wo, s.alpha2 = alpha * alpha;
  return any(s.m);
}

// Least mean cosine of phase functions of Henyey and Greenstein that influence the choice; those of droplets always do.
constexpr float kLeastPhase = 0.6f;

// Finds the lanes of `scatters` in media that scatter forwards or backwards, seen along unit wo (world space).
template <int W>
PRIMRAY_RARE bool find_peaked(vbool<W> scatters, vfloat<W> phase, const vvec3<W>& wo, LobePreview<W>& s) {
  s.m = scatters & (abs(phase) > vfloat<W>(kLeastPhase));
  s.wo = wo, s.phase = phase;
  return any(s.m);
}

// Light chosen in each lane, and the lobes that influenced the choice.
template <int W>
struct ChosenLight {
  LightChoice<W> choice;
  LobePreview<W> lobes;
  bool any_lobes = false;
  vfloat<W> known;  // probability without lobes, if there are any: other techniques know nothing of them
};

template <int W, class Lobes>
PRIMRAY_INLINE void choose_light_at(const Round& round, vbool<W> scatters, const Vertex<W, Lobes>& v, const PathLanes<W>& p,
                                    const vvec3<W>& from, ChosenLight<W>& chosen) {
  const LightTable& lights = round.scene.lights;
  const vuint<W> number = lights.count > 1 ? p.sampler.bits_of(p.vertex + vint<W>(1), Purpose::kLightChoice) : vuint<W>(0u);
  const bool linked = lights.links.any();
  if (lights.by_tree() && !linked) {
    if constexpr (Lobes::kInMedium)
      chosen.any_lobes = find_peaked(scatters, v.bsdf.phase, -p.ray.d, chosen.lobes);
    else
      chosen.any_lobes = v.bsdf.any_preview && find_glossy(scatters, v.bsdf, v.frame.to_world(v.wo), chosen.lobes);
  }
  chosen.choice = linked ? choose_linked_light(lights, scatters, from, facing(v), number, v.it.link)
                         : choose_light(lights, scatters, from, facing(v), number, chosen.any_lobes ? &chosen.lobes : nullptr);
  if (chosen.any_lobes) {
    const vbool<W> m = chosen.lobes.m & (chosen.choice.probability > vfloat<W>(0.0f));
    chosen.known = select(m, probability_of(lights, chosen.choice.light, m, from, facing(v)), chosen.choice.probability);
  }
}

// Samples a point on the chosen light, seen from `from`. Domes with portals and geometry lights have their own sampling
// routines.
template <int W, class Lobes>
PRIMRAY_INLINE LightSample<W> sample_point(const Round& round, vbool<W> useful, vint<W> light, const Vertex<W, Lobes>& v,
                                           const PathLanes<W>& p, const vvec3<W>& from) {
  using B = vbool<W>;
  const Scene& scene = round.scene;
  const LightTable& lights = scene.lights;
  const vint<W> bounce = p.vertex + vint<W>(1);
  const Pair<W> u = p.sampler.pair(bounce, Purpose::kLightPoint);
  LightSample<W> s = light_sample(lights, light, useful, from, u.u, u.v, p.ray.time);
  if (lights.has_portals()) {
    const B dome = useful & is_type(LightRow<W>(lights, light).type(), LightType::kDome);
    if (any(dome))
      sample_portals(lights, dome, light, from, p.sampler.single(bounce, Purpose::kEmitter), u.u, u.v, p.ray.time, s);
  }
  if (scene.emitters.any()) {
    const LightRow<W> row(lights, light);
    const B geometry = useful & ((row.flags() & vint<W>(kGeometry)) != vint<W>(0));
    const B mesh = geometry & is_type(row.type(), LightType::kMesh), sphere = geometry & !mesh;
    if (any(sphere)) sample_sphere(scene, sphere, light, from, u.u, u.v, p.ray.time, s);
    if (any(mesh)) {
      const vuint<W> bits = p.sampler.bits_of(bounce, Purpose::kEmitter);
      sample_mesh(scene, mesh, light, from, facing(v), bits, u.u, u.v, p.ray.time, s);
    }
  }
  if (scene.volumes && scene.volumes->in_emissions.any()) {
    const B volume = useful & is_type(LightRow<W>(lights, light).type(), LightType::kVolume);
    if (any(volume))
      sample_volume_point(*scene.volumes, volume, light, from, p.sampler.bits_of(bounce, Purpose::kEmitter), u.u, u.v,
                          p.ray.time, s);
  }
  return s;
}

// BSDF times cosine for light from `s`, with the light's lobe multipliers.
template <int W>
PRIMRAY_INLINE vvec3<W> reflected_of(const LightTable& lights, vint<W> light, const BsdfEval<W>& f) {
  if (!lights.lobe_factors) return f.diffuse + f.specular;
  const LightRow<W> row(lights, light);
  return f.diffuse * row(kDiffuseFactor) + f.specular * row(kSpecularFactor);
}

// MIS weight of the light sample against BSDF-sampled rays that hit the light.
template <int W, class Lobes>
PRIMRAY_INLINE vfloat<W> light_weight(const Round& round, vbool<W> useful, vbool<W> special, const ChosenLight<W>& chosen,
                                      const LightSample<W>& s, vfloat<W> pdf, vfloat<W> scattered_pdf,
                                      const Vertex<W, Lobes>& v, const vvec3<W>& from) {
  const LightTable& lights = round.scene.lights;
  const vint<W> light = chosen.choice.light;
  vbool<W> alone = s.is_delta | special;
  if (!lights.hierarchy.empty()) alone |= rarely_hit(lights, light, from, scattered_pdf);
  // For MIS the choice is treated as if no lobe had influenced it, since that is all that a ray which hits the light knows. The
  // weights of both techniques then add up to 1, whatever the densities in them.
  vfloat<W> known_pdf = pdf;
  if (chosen.any_lobes) known_pdf = s.pdf * chosen.known;
  return select(alone, vfloat<W>(1.0f), mis_weight(known_pdf, scattered_pdf));
}

// Redirects samples of lanes `m` from origin `from` to origin `o`, towards the same point of the light.
template <int W>
PRIMRAY_INLINE void aim_from(vbool<W> m, const vvec3<W>& from, const vvec3<W>& o, LightSample<W>& s) {
  const vvec3<W> to = s.wi * s.t - (o - from);
  const vfloat<W> t = length(to);
  const vbool<W> near = m & (t < vfloat<W>(kInfinity)) & (t > vfloat<W>(0.0f));
  s.wi = select(near, to * (1.0f / t), s.wi), s.t = select(near, t, s.t);
}

// Moves the origins of rays in lanes `below`, which start below the triangle's plane, to the smooth surface at `o`, and
// redirects them to the same point of the light; returns the lanes for which that succeeds.
template <int W, class Lobes>
PRIMRAY_INLINE vbool<W> lift_towards_light(Round& round, vbool<W> below, const Vertex<W, Lobes>& v, const PathLanes<W>& p,
                                           const vvec3<W>& from, LightSample<W>& s, vvec3<W>& o) {
  const vbool<W> lifted = lift_origins(round, below, v, s.wi, p.ray.time, o);
  aim_from(lifted, from, o, s);
  return lifted;
}

// Moves the origins of rays of lanes `m` to the other side of the surface, towards the same point of the light.
template <int W, class Lobes>
PRIMRAY_RARE void cross_surface(vbool<W> m, const Vertex<W, Lobes>& v, const vvec3<W>& from, LightSample<W>& s, vvec3<W>& o) {
  o = select(m, v.it.p - v.ng * v.it.offset, o);
  if constexpr (Lobes::kFibres) o = o + s.wi * distance_through_tube(m & v.bsdf.is_hair, v.it, s.wi);
  aim_from(m, from, o, s);
}

// Stores the medium stacks of shadow rays that are about to be queued.
template <int W>
PRIMRAY_RARE void put_shadow_media(Round& round, vbool<W> special, vbool<W> other, vbool<W> beyond,
                                   const MediumInterface<W>& media, vfloat<W> origin_distance) {
  Worker& w = round.worker;
  const ShadowMedia<W> shadow_media{select(beyond, media.boundary.beyond, media.boundary.here), origin_distance,
                                    media.incoming.volumes};
  if (any(special)) w.medium_states->special_shadows.put(w.special_shadows->rays.count, Compaction<W>(special), shadow_media);
  w.medium_states->shadows.put(w.shadows.count, Compaction<W>(other), shadow_media);
}

// Logs a light sample that cannot contribute.
template <int W>
PRIMRAY_INLINE void log_light(const Round& round, const PathLanes<W>& p, const char* why, vint<W> light = vint<W>(-1)) {
  if (PathLog* const log = path_log<W>(round)) log->add("light sample", p).put("light", light).why = why;
}

// Russian roulette of shadow rays from hair, beyond the first vertex: one is traced with probability min(1, kFibreShadows * the
// path's largest throughput). A strand is in the shadow of others more often than not.
// Beside kFibreKeep, likewise: all traced 1.06, 1.19, 2.1; 2 1.09, 1.23, 2.3; 1 0.84, 1.03, 2.6, as the rare ones that reach
// the sun weigh more.
constexpr float kFibreShadows = 2;

// Ends shadow rays in lanes `hair` of `useful`, and divides what the others carry.
template <int W>
PRIMRAY_RARE void play_shadow_roulette(vbool<W> hair, const PathLanes<W>& p, vbool<W>& useful, vvec3<W>& carried) {
  const vfloat<W> one(1.0f), kept = min(max_component(p.beta) * parts_of(p) * kFibreShadows, 1.0f);
  const vfloat<W> survive = select(hair & (p.vertex > vint<W>(0)), kept, one);
  // This sample dimension is used by camera rays only.
  useful &= p.sampler.single(p.vertex + vint<W>(1), Purpose::kLens) < survive;
  carried = select(useful, carried * (1.0f / survive), carried);
}

// Samples a point on the chosen light, seen from `from`, and queues a shadow ray with its contribution.
template <int W, class Lobes>
PRIMRAY_INLINE void queue_light_sample(Round& round, vbool<W> useful, const ChosenLight<W>& chosen, const Vertex<W, Lobes>& v,
                                       const PathLanes<W>& p, const vvec3<W>& from, vfloat<W> share) {
  using B = vbool<W>;
  using V = vvec3<W>;
  const LightTable& lights = round.scene.lights;
  const vint<W> light = chosen.choice.light;

  // Sample a point on it
  LightSample<W> s = sample_point(round, useful, light, v, p, from);
  PRIMRAY_ASSERT(are_unit(useful & (s.pdf > vfloat<W>(0.0f)), s.wi));
  const V wi = v.frame.to_local(s.wi);
  const B above = dot(v.ng, s.wi) > vfloat<W>(0.0f);
  const B beyond = v.bsdf.lets_through() & (wi.z < vfloat<W>(0.0f)) & !above;  // through the surface
  useful &= (s.pdf > vfloat<W>(0.0f)) & (((wi.z > vfloat<W>(0.0f)) & (above | v.it.smooth)) | beyond);
  if (!any(useful)) return log_light(round, p, "the light is behind the surface, or has no density there", light);

  // Evaluate the BSDF and the MIS weight
  const BsdfEval<W> f = v.bsdf.eval(v.wo, wi);
  const V reflected = reflected_of(lights, light, f);
  const vfloat<W> pdf = s.pdf * chosen.choice.probability;
  B special(false);  // no other technique finds these lights
  if (round.has_special()) special = (LightRow<W>(lights, light).flags() & vint<W>(kSpecial)) != vint<W>(0);
  const vfloat<W> scattered_pdf = scattered_density(round, v, s.wi, f.pdf);
  const vfloat<W> weight = light_weight(round, useful, special, chosen, s, pdf, scattered_pdf, v, from);
  PRIMRAY_ASSERT(are_weights(useful, reflected) && are_weights(useful, scattered_pdf) && are_fractions(useful, weight));

  // Compute the unshadowed contribution
  V carried = p.beta * reflected * s.L * (weight / pdf);
  if constexpr (Lobes::kInMedium) carried = carried * share;
  const bool in_media = Lobes::kFollowsMedia && v.media;
  if (in_media && !round.scene.shadows_need_hits)
    carried = carried * v.media->transmittance_towards(round.scene, beyond, s.t + origin_distance_of(v.it.offset, v.ng, s.wi));
  useful &= max_component(carried) > vfloat<W>(0.0f);
  if constexpr (Lobes::kFibres) {
    if (any(useful & v.bsdf.is_hair)) {
      play_shadow_roulette(v.bsdf.is_hair, p, useful, carried);
      if (!any(useful)) return log_light(round, p, "Russian roulette ends the shadow ray", light);
    }
  }

  // Move the shadow ray's origin to the light's side of the surface
  V o = from;
  if (any(useful & beyond)) cross_surface(useful & beyond, v, from, s, o);
  if (const B below = useful & !above & !beyond; any(below))
    useful &= above | beyond | lift_towards_light(round, below, v, p, from, s, o);
  if (PathLog* const log = path_log<W>(round)) {
    PathLog::Event& event = log->add("light sample", p).put("light", light);
    event.put("choice_probability", chosen.choice.probability).put("direction", s.wi).put("distance", log->length(s.t));
    event.put("light_pdf", pdf).put("radiance", s.L).put("f_cos", reflected).put("bsdf_pdf", scattered_pdf);
    event.put("weight", weight).put("throughput", p.beta).put("unshadowed", carried);
    if (any(useful))
      log->queue(any(special));
    else
      event.why = "nothing is reflected towards the light";
  }

  // Queue the shadow ray
  Worker& w = round.worker;
  if (in_media)
    put_shadow_media(round, useful & special, useful & !special, beyond, *v.media, origin_distance_of(v.it.offset, v.ng, s.wi));
  if (round.needs.lpe) put_shadow_lpe_states<W, Lobes>(round, useful & special, useful & !special, p, f, beyond, light);
  if (round.has_volumes()) {
    if (any(useful & special)) put_shadow_seeds(useful & special, w.special_shadows->rays, p);
    put_shadow_seeds(useful & !special, w.shadows, p);
  }
  const vint<W> sum = sum_of(round, p.slot, p.depth + vint<W>(1));
  if (any(useful & special))
    w.special_shadows->append(useful & special, o, s.wi, s.t * kNearlyOne, carried, sum, light, p.ray.time, round.needs);
  useful &= !special;
  if (any(useful)) w.shadows.append(useful, o, s.wi, s.t * kNearlyOne, carried, sum, p.ray.time, round.needs);
}

template <int W, class Lobes>
void sample_light(Round& round, vbool<W> scatters, const Vertex<W, Lobes>& v, const PathLanes<W>& p) {
  using V = vvec3<W>;
  const LightTable& lights = round.scene.lights;

  // Choose a light. The origin is that of scattered rays, so that both techniques agree on which lights are above the surface
  const V from = v.it.p + v.ng * v.it.offset;
  ChosenLight<W> chosen;
  choose_light_at(round, scatters, v, p, from, chosen);
  const vint<W> light = chosen.choice.light;
  const vbool<W> useful = scatters & (chosen.choice.probability > vfloat<W>(0.0f));
  if (!any(useful)) return log_light(round, p, "no light reaches the point");
  PRIMRAY_ASSERT(are_rows(light, size_t(lights.count)) && are_fractions(useful, chosen.choice.probability));

  vfloat<W> share(1.0f);
  if constexpr (Lobes::kInMedium) {
    // Samples along the ray have the rest.
    if (const vbool<W> m = useful & (v.bsdf.path >= vint<W>(0)); round.samples_along_rays() && any(m))
      share = select(m,
                     round.worker.along->share_of_vertices(lights.pivots, p.ray.o, p.ray.d, dot(v.it.p - p.ray.o, p.ray.d),
                                                           select(m, v.bsdf.path, vint<W>(0)), light,
                                                           chosen.any_lobes ? chosen.known : chosen.choice.probability),
                     share);
  }
  queue_light_sample(round, useful, chosen, v, p, from, share);
}

// Calls f(lanes) for lanes of `m`, in order, of which no two belong to one sample: what several of a sample's parts queue is
// then added in the same order for every lane count.
template <int W, class F>
PRIMRAY_INLINE void for_each_of_samples(vbool<W> m, vint<W> slot, const F& f) {
  for (uint32_t left = bits(m); left;) {
    uint32_t run = 0;
    for (uint32_t b = left; b; b &= b - 1) {
      const int32_t own = slot[__builtin_ctz(b)] & kSumMask;
      bool taken = false;
      for (uint32_t r = run; r; r &= r - 1) taken |= (slot[__builtin_ctz(r)] & kSumMask) == own;
      if (taken) break;
      run |= b & -b;
    }
    left &= ~run;
    f(m & (lane_numbers<W>() >= vint<W>(__builtin_ctz(run))) & (lane_numbers<W>() <= vint<W>(31 - __builtin_clz(run))));
  }
}

// Takes as many light samples where a walk leaves the surface as where a path splits: the walk is what costs.
template <int W, class Lobes>
void sample_lights_after_walk(Round& round, vbool<W> scatters, const Vertex<W, Lobes>& v, const PathLanes<W>& p) {
  const int samples = round.settings.light_samples;
  if (samples == 1) return sample_light(round, scatters, v, p);
  for_each_of_samples(scatters, p.slot, [&](vbool<W> lanes) {
    PathLanes<W> part = split_part(p, lanes, samples);
    for (int k = 0; k < samples; ++k) {
      number_part(part, p, lanes, samples, k);
      sample_light(round, lanes, v, part);
    }
  });
}

// Takes one light sample per vertex; where a path splits, as many as the pilot renders chose.
template <int W, class Lobes>
void sample_lights(Round& round, vbool<W> scatters, const Vertex<W, Lobes>& v, const PathLanes<W>& p) {
  if constexpr (Lobes::kEndsWalk) return sample_lights_after_walk(round, scatters, v, p);
  const int samples = round.settings.light_samples;
  const vbool<W> more = scatters & is_whole(p) & !v.bsdf.mirror;
  if (samples == 1 || !any(more)) return sample_light(round, scatters, v, p);
  if (round.branches && round.sorts && any(scatters & !more)) {
    const vbool<W> kinds[2] = {more, scatters & !more};
    return for_kinds(true, kinds, [&](int, vbool<W> lanes) { sample_lights(round, lanes, v, p); });
  }
  PathLanes<W> part = split_part(p, more, samples);
  for (int k = 0; k < samples; ++k) {
    number_part(part, p, more, samples, k);
    sample_light(round, k == 0 ? scatters : more, v, part);
  }
}

}  // namespace primray
