// Stage of a round in scenes with emission in volumes: adds what paths gather along their rays, up to where these end.
#pragma once

#include "integrator/emission.hpp"
#include "integrator/lpe_light.hpp"
#include "integrator/media.hpp"
#include "integrator/place_in_depth.hpp"
#include "integrator/round.hpp"
#include "light/sampler/selection.hpp"
#include "volume/tracking_emission.hpp"

namespace primray {

// Returns where rays end that see lights as bodies: at the nearest, if it is before `end`.
template <int W>
PRIMRAY_RARE vfloat<W> end_at_bodies(const Round& round, vbool<W> sees_body, const PathLanes<W>& p, vfloat<W> end) {
  vvec3<W> ignored(vfloat<W>(0.0f));
  const vbool<W> hit = end < vfloat<W>(kInfinity);
  const LightHits<W> seen = intersect_lights(round.scene.lights, sees_body, hit, p, end, ignored);
  return select(seen.covered, min(end, seen.nearest), end);
}

// Media around rays beside volumes.
template <int W>
struct MediaAround {
  vvec3<W> extinction{vfloat<W>(0.0f)};
  FogAlong<W> fog;

  PRIMRAY_INLINE vbool<W> exists() const { return (max_component(extinction) > vfloat<W>(0.0f)) | fog.lanes; }
  PRIMRAY_INLINE vvec3<W> transmittance(vfloat<W> t) const {
    const vvec3<W> left{exp_of_minus(extinction.x * t), exp_of_minus(extinction.y * t), exp_of_minus(extinction.z * t)};
    return any(fog.lanes) ? left * fog.transmittance(t) : left;
  }
  // Takes those of paths `path` of the pool, in lanes `m`.
  PRIMRAY_RARE void take(const Round& round, vbool<W> m, vint<W> path) {
    for (uint32_t b = bits(m); b; b &= b - 1) {
      const int i = __builtin_ctz(b);
      const RayMedium<1> medium = medium_at(round, path[i], round.worker.medium_states->pool->template at<1>(path[i]));
      extinction.x.set(i, medium.extinction.x[0]), extinction.y.set(i, medium.extinction.y[0]);
      extinction.z.set(i, medium.extinction.z[0]);
      const bool in_fog = medium.any_fog && medium.fog.lanes[0];
      const vbool<W> own = lane_numbers<W>() == vint<W>(i);
      fog.lanes = (fog.lanes & !own) | (own & vbool<W>(in_fog));
      if (!in_fog) continue;
      fog.height.set(i, medium.fog.height[0]), fog.slope.set(i, medium.fog.slope[0]);
      fog.falloff = medium.fog.falloff, fog.extinction = medium.fog.extinction;
    }
  }
};

// Begins the events of rays `ray` in the emission of `instance`, in lanes `fresh`.
template <int W>
PRIMRAY_INLINE void begin_emission(const Round& round, vbool<W> fresh, vint<W> ray, vint<W> instance,
                                   EmissionEvents<W, MediaAround<W>>& events) {
  using F = vfloat<W>;
  using I = vint<W>;
  const VolumeTable& volumes = *round.scene.volumes;
  const PathPool& pool = *round.worker.pool;
  const LightTable& lights = round.scene.lights;
  const I row = gather<W>(volumes.in_emissions.of.data(), instance) * I(6);
  const float* rows = reinterpret_cast<const float*>(volumes.emissions.data());
  vvec3<W> radiance{gather<W>(rows + 3, row), gather<W>(rows + 4, row), gather<W>(rows + 5, row)};
  if (const CameraVisibilityTable& camera = volumes.in_emissions.camera; camera.any()) {
    const vbool<W> looks = fresh & (gather<W>(pool.depth, select(fresh, ray, I(0))) == I(0));
    radiance = select(looks & !camera.lanes_with(CameraVisibility::kSeen, looks, instance), vvec3<W>(F(0.0f)), radiance);
  }
  events.radiance = select(fresh, radiance, events.radiance);
  const F pdf = gather<W>(pool.bsdf_pdf, ray), travelled = round.needs.travelled ? gather<W>(pool.travelled, ray) : F(0.0f);
  events.scattered_pdf = select(fresh, pdf, events.scattered_pdf);
  events.travelled = select(fresh, travelled, events.travelled);

  // Find the rate of events
  const F time = round.needs.time ? gather<W>(pool.time, ray) : F(0.0f);
  const vvec3<W> d{gather<W>(pool.dx, ray), gather<W>(pool.dy, ray), gather<W>(pool.dz, ray)};
  const vvec3<W> from = vvec3<W>(gather<W>(pool.ox, ray), gather<W>(pool.oy, ray), gather<W>(pool.oz, ray)) - d * travelled;
  const F part = emitting_part(volumes, fresh, instance, from, d, time);
  events.per_value = select(fresh, gather<W>(volumes.events_per_value.data(), instance) / part, events.per_value);

  // Find the density of light samples
  const I light = gather<W>(volumes.light_of.data(), instance);
  const vbool<W> sampled = fresh & (pdf > F(0.0f)) & (light >= I(0));
  F relative(0.0f);
  if (any(sampled)) {
    vvec3<W> normal(F(0.0f));
    if (round.needs.normals) normal = {gather<W>(pool.nx, ray), gather<W>(pool.ny, ray), gather<W>(pool.nz, ray)};
    const I number = select(sampled, light, I(light[__builtin_ctz(bits(sampled))]));
    const F chosen = lights.links.any() ? linked_probability_of(lights, number, sampled, from, normal,
                                                                round.needs.links ? gather<W>(pool.link, ray) : I(kUnlinkedRow))
                                        : probability_of(lights, number, sampled, from, normal);
    relative = select(sampled, chosen * part * EmissionPlaces<W>(volumes, sampled, instance, time).relative_density, relative);
  }
  events.relative = select(fresh, relative, events.relative);

  if (round.follows_media()) events.around.take(round, fresh, ray);
}

// Follows the pool's rays through volumes that emit, and adds up what each finds. `listen(ray, events, i)` is called for each
// volume on a ray.
template <int W, class Events, class Listen>
PRIMRAY_INLINE void track_emission(Round& round, const VolumeRays& rays, const Listen& listen) {
  const VolumeTable& volumes = *round.scene.volumes;
  VolumeState& state = *round.worker.volumes;
  pass_volumes<W>(volumes.grids, volumes.in_emissions, rays, round.worker.pool->count, state.passes,
                  [&](const VolumePasses& tasks) {
                    const auto load = [&](vbool<W> fresh, vint<W> numbers, Events& events) {
                      begin_emission(round, fresh, gather<W>(tasks.ray, numbers), gather<W>(tasks.instance, numbers), events);
                      TrackingTask<W> task = tracking_task<W>(volumes.in_emissions, rays, tasks, fresh, numbers);
                      task.seed = mix(task.seed ^ vuint<W>(0x2545f491u));
                      events.begin(fresh, task);
                      return task;
                    };
                    const auto store = [&](vbool<W> done, vint<W> numbers, const Events& events) {
                      for (uint32_t b = bits(done); b; b &= b - 1) {
                        const int i = __builtin_ctz(b), ray = tasks.ray[numbers[i]];
                        state.emission[0][ray] += events.sum.x[i], state.emission[1][ray] += events.sum.y[i];
                        state.emission[2][ray] += events.sum.z[i];
                        listen(ray, events, i);
                      }
                    };
                    return follow_segments<W, Events>(volumes.grids, tasks.count, load, store);
                  });
}

// Emission of one volume along a ray of the pool, and the distance at which a deep picture has it.
struct PlacedEmission {
  int ray;
  float t, radiance[3];
};

// Adds light that covers nothing to the layers of its sample, unless the path has scattered before.
PRIMRAY_RARE void add_placed(Round& round, const PlacedEmission& light) {
  const PathPool& pool = *round.worker.pool;
  const int ray = light.ray;
  PathLanes<1> p = pool.paths<1>(ray, round.needs);
  const float scale = round.follows_media() ? radiance_scale_at<1>(round, ray)[0] : 1.0f;
  const vvec3<1> radiance{vfloat<1>(light.radiance[0]), vfloat<1>(light.radiance[1]), vfloat<1>(light.radiance[2])};
  place_light<1>(round, vfloat<1>(light.t), p.beta * radiance * vfloat<1>(scale), p);
}

// Adds the emission along the rays of all paths of the pool, whose ends are those of VolumeState.
template <int W>
PRIMRAY_RARE void gather_volume_emission(Round& round) {
  using F = vfloat<W>;
  const PathPool& pool = *round.worker.pool;
  VolumeState& state = *round.worker.volumes;
  for (int at = 0; at < pool.count; at += W) {
    const vbool<W> active = lane_numbers<W>() < vint<W>(pool.count - at);
    for (float* sums : state.emission) store(sums + at, F(0.0f));
    if (!round.scene.lights.needs_hit_test) continue;
    const PathLanes<W> p = pool.paths<W>(at, round.needs);
    if (const vbool<W> sees_body = active & (p.bsdf_pdf == F(0.0f)); any(sees_body))
      store(state.end + at, end_at_bodies(round, sees_body, p, load<W>(state.end + at)));
  }
  const VolumeRays rays{pool.ox,   pool.oy,    pool.oz,   pool.dx,      pool.dy,
                        pool.dz,   pool.tnear, state.end, state.number, round.needs.time ? pool.time : nullptr,
                        pool.depth};
  std::vector<PlacedEmission> placed;
  if (round.deep)
    track_emission<W, PlacedEmissionEvents<W, MediaAround<W>>>(round, rays, [&](int ray, const auto& events, int i) {
      placed.push_back({ray, events.chosen[i], {events.sum.x[i], events.sum.y[i], events.sum.z[i]}});
    });
  else
    track_emission<W, EmissionEvents<W, MediaAround<W>>>(round, rays, [](int, const auto&, int) {});
  for (int at = 0; at < pool.count; at += W) {
    const vbool<W> active = lane_numbers<W>() < vint<W>(pool.count - at);
    const PathLanes<W> p = pool.paths<W>(at, round.needs);
    vvec3<W> gathered{load<W>(state.emission[0] + at), load<W>(state.emission[1] + at), load<W>(state.emission[2] + at)};
    const vbool<W> shines = active & (max_component(gathered) > F(0.0f));
    if (!any(shines)) continue;
    if (round.follows_media()) gathered = gathered * radiance_scale_at<W>(round, at);
    if (PathLog* const log = path_log<W>(round)) log->add("gathered", p).put("radiance", gathered);
    add_to_slots(round, shines, sum_of(round, unplaced(round, p.slot), p.depth), p.beta * gathered);
    if (round.needs.lpe) {
      record_emission(*round.worker.lpe, shines, vint<W>(kEndObject), gathered, LobeFactors());
      add_recorded(round, p, p.beta);
    }
  }
  for (const PlacedEmission& light : placed) add_placed(round, light);
}

}  // namespace primray
