// Stage of a round in scenes with lights in media: light samples along rays (light/sampler/segment_choice.hpp). A vertex
// in a medium, at a distance sampled by extinction, samples lights as well; both techniques find the same points, and are
// weighted by the balance heuristic. That needs a density of distances, for which the segment's mean extinction serves: weights
// may be any functions that add up to 1.
//
// After a scattering event only segments are sampled that pass close to a light, where vertices would seldom be near enough.
#pragma once

#include "integrator/along_state.hpp"
#include "integrator/cross_volumes.hpp"
#include "integrator/volume_emission.hpp"

namespace primray {

// Part of rays in which there are media, and the mean extinction over it.
template <int W>
struct MediaExtent {
  vfloat<W> from, to, extinction;
};

// Returns the lanes of `m` in which light that instance `i` scatters is seen: the camera sees none of volumes that are hidden
// from it, or mattes. `looks`: lanes of rays that come straight from the camera.
template <int W>
PRIMRAY_INLINE vbool<W> shown(const VolumePlacements& placed, size_t i, vbool<W> m, vbool<W> looks) {
  if (!placed.camera.any()) return m;
  return placed.camera.of_surface[i] == int32_t(CameraVisibility::kSeen) ? m : m & !looks;
}

// Returns the extent of the volumes' boxes on rays of lanes `all_rays`; `looks` as in shown().
template <int W>
PRIMRAY_RARE MediaExtent<W> extent_of_volumes(const VolumeTable& volumes, vbool<W> all_rays, vbool<W> looks, const vvec3<W>& o,
                                              const vvec3<W>& d, vfloat<W> begin, vfloat<W> end, vfloat<W> time) {
  using F = vfloat<W>;
  MediaExtent<W> all{F(kInfinity), F(0.0f), F(0.0f)};
  for (size_t i = 0; i < volumes.in_media.size(); ++i) {
    const VolumeTable::Medium& medium = volumes.media[size_t(volumes.in_media.of[i])];
    const GridTable::Row& row = volumes.grids.rows[size_t(medium.grid)];
    const vbool<W> m = shown(volumes.in_media, i, all_rays, looks);
    F from = begin, to = end;
    clip_to_grid(row, GridRays<W>(volumes.in_media, m, vint<W>(int32_t(i)), o, d, time), from, to);
    const vbool<W> crosses = m & (from < to);
    if (!any(crosses)) continue;
    all.from = select(crosses, min(all.from, from), all.from), all.to = select(crosses, max(all.to, to), all.to);
    const float mean = row.mean * (medium.extinction[0] + medium.extinction[1] + medium.extinction[2]) / 3;
    all.extinction += select(crosses, (to - from) * mean, F(0.0f));
  }
  all.extinction = all.extinction / max(all.to - all.from, 1e-30f);
  return all;
}

// Adds the extent of volumes without grids and of fog, on rays of lanes `m` from `begin` to `end`. A ray that has passed a
// volume's boundary keeps its origin, and what is before the boundary is not in the volume.
template <int W>
PRIMRAY_RARE void add_media(vbool<W> m, const RayMedium<W>& medium, vfloat<W> begin, vfloat<W> end, MediaExtent<W>& all) {
  using F = vfloat<W>;
  const vvec3<W>& e = medium.extinction;
  F mean = select(max_component(medium.scattering) > F(0.0f), (e.x + e.y + e.z) * (1.0f / 3), F(0.0f));
  if (medium.any_fog) {
    // Of endless fog the part counts that light crosses.
    const F most = min(end - begin, 4.0f / max(F(medium.fog.extinction), 1e-30f));
    mean += select(medium.fog.lanes, medium.fog.extinction * medium.fog.length(most) / max(most, 1e-30f), F(0.0f));
  }
  m &= mean > F(0.0f);
  if (!any(m)) return;
  const F others = all.extinction * max(all.to - all.from, 0.0f);
  const vbool<W> finite = end < F(kInfinity);
  all.from = select(m, begin, all.from), all.to = select(m, max(all.to, end), all.to);
  all.extinction = select(m, mean + select(finite, others / max(all.to - begin, 1e-30f), F(0.0f)), all.extinction);
}

// Medium at points: one of those that overlap there, with what it scatters by the probability of its choice.
template <int W>
struct MediumAtPoint {
  vvec3<W> scattering{vfloat<W>(0.0f)};
  vfloat<W> phase{0.0f};
  vfloat<W> weight{0.0f};  // sum of what was offered

  // Offers a medium, which is chosen by what it scatters; `u` in [0, 1).
  PRIMRAY_INLINE void offer(vbool<W> m, const vvec3<W>& own, vfloat<W> g, vfloat<W> u) {
    const vfloat<W> w = select(m, own.x + own.y + own.z, vfloat<W>(0.0f));
    const vbool<W> chosen = m & (w > vfloat<W>(0.0f)) & (u * (weight + w) < w);
    weight += w;
    // Scaled by the sum over all when that is known.
    scattering = select(chosen, own * (1.0f / max(w, 1e-30f)), scattering), phase = select(chosen, g, phase);
  }
  PRIMRAY_INLINE vvec3<W> scattered() const { return scattering * weight; }
};

// Offers the volumes that contain points `p` at `time`; `looks` as in shown().
template <int W>
PRIMRAY_RARE void offer_volumes(const VolumeTable& volumes, vbool<W> m, vbool<W> looks, const vvec3<W>& p, vfloat<W> time,
                                vuint<W> seed, MediumAtPoint<W>& at) {
  using F = vfloat<W>;
  const vvec3<W> none(F(0.0f));
  for (size_t i = 0; i < volumes.in_media.size(); ++i) {
    const VolumeTable::Medium& medium = volumes.media[size_t(volumes.in_media.of[i])];
    const vvec3<W> in_grid = GridRays<W>(volumes.in_media, m, vint<W>(int32_t(i)), p, none, time).o;
    const EventNumbers<W> numbers{seed ^ vuint<W>(uint32_t(i) * 0x632be59bu)};
    const GridRows<W> grid(volumes.grids, vint<W>(medium.grid), time);
    const VoxelChoice<W> near =
        grid.voxel_at(in_grid, numbers.voxel(), [&] { return EventNumbers<W>{numbers.seed, vint<W>(1)}.voxel(); });
    const F density = grid.value(near.x, near.y, near.z);
    const vvec3<W> albedo = AlbedoLookup<W>::of(medium).at(volumes.grids, m, near.x, near.y, near.z);
    const vvec3<W> extinction{F(medium.extinction[0]), F(medium.extinction[1]), F(medium.extinction[2])};
    at.offer(shown(volumes.in_media, i, m, looks) & (density > F(0.0f)), extinction * albedo * density, F(medium.phase),
             numbers(5));
  }
}

// Ratio of the greatest irradiance on a segment to its mean from which on scattered rays are sampled as well.
constexpr float kPeaked = 8;

// Offers the volumes without grids and the fog at points `p`.
template <int W>
PRIMRAY_RARE void offer_media(const Round& round, vbool<W> m, const RayMedium<W>& medium, const vvec3<W>& p, vuint<W> seed,
                              MediumAtPoint<W>& at) {
  using F = vfloat<W>;
  const EventNumbers<W> numbers{seed ^ vuint<W>(0x1b873593u)};
  if (medium.any_volumes) {
    // Several volumes may overlap there, each with its phase function.
    for (uint32_t b = bits(m & (max_component(medium.scattering) > F(0.0f))); b; b &= b - 1) {
      const int i = __builtin_ctz(b);
      const vbool<W> own = lane_numbers<W>() == vint<W>(i);
      uint32_t k = 0;
      for (const VolumeSets::Member& member : round.worker.medium_states->sets.members(medium.row[i])) {
        const vvec3<W> scattering{F(member.scattering.x), F(member.scattering.y), F(member.scattering.z)};
        at.offer(own, scattering, F(member.phase), unit_float(mix(seed ^ vuint<W>(0xcc9e2d51u * ++k))));
      }
    }
  } else {
    at.offer(m, medium.scattering, medium.phase, numbers(6));
  }
  if (!medium.any_fog) return;
  const Fog& fog = round.scene.interiors.fog;
  const vvec3<W> albedo{F(fog.albedo.x), F(fog.albedo.y), F(fog.albedo.z)};
  at.offer(m & medium.fog.lanes, albedo * (fog.extinction * density_at(fog, p)), F(fog.phase), numbers(7));
}

// Chooses lights and distances along the pool's rays; returns whether any reach them.
template <int W>
PRIMRAY_RARE bool choose_along_rays(Round& round) {
  using F = vfloat<W>;
  const Scene& scene = round.scene;
  const PathPool& pool = *round.worker.pool;
  AlongState& state = *round.worker.along;
  bool found = false;
  for (int at = 0; at < pool.count; at += W) {
    vbool<W> active =
        (lane_numbers<W>() < vint<W>(pool.count - at)) & (load<W>(pool.depth + at) < vint<W>(round.settings.max_depth));
    const PathLanes<W> p = pool.paths<W>(at, round.needs);
    F end = min(p.ray.tfar, select(load<W>(pool.geom + at) != vint<W>(-1), load<W>(pool.t + at), kInfinity));
    if (scene.lights.needs_hit_test) end = end_at_bodies(round, active & (p.bsdf_pdf == F(0.0f)), p, end);
    MediaExtent<W> extent{F(kInfinity), F(0.0f), F(0.0f)};
    if (round.has_volumes())
      extent = extent_of_volumes(*scene.volumes, active, p.depth == vint<W>(0), p.ray.o, p.ray.d, p.ray.tnear, end, p.ray.time);
    if (round.follows_media()) {
      const MediumState<W> own = round.worker.medium_states->pool->template at<W>(at);
      active &= is_lit(scene, own);
      add_media(active, medium_at(round, at, own), max(-own.origin_distance, 0.0f), end, extent);
    }
    const Segment<W> segment{p.ray.o, p.ray.d, extent.from, extent.to};
    const LightAlong<W> light(scene.lights.pivots, segment, state.sums.data());
    const vbool<W> peaked = (p.depth == vint<W>(0)) | (light.peak * (extent.to - extent.from) > kPeaked * light.total);
    const F total = select(active & peaked & (extent.from < extent.to), light.total, F(0.0f));
    const Pair<W> u = p.sampler.pair(p.vertex + vint<W>(1), Purpose::kFilm);
    const ChosenAlong<W> chosen = light.sample(scene.lights.pivots, segment, state.sums.data(), u.v, u.u);
    store(state.from + at, extent.from), store(state.to + at, extent.to);
    store(state.extinction + at, extent.extinction), store(state.total + at, total);
    const vbool<W> lit = (total > F(0.0f)) & (chosen.density > F(0.0f)) & (chosen.t < F(kInfinity));
    found |= any(lit);
    store(state.t + at, select(lit, chosen.t, F(0.0f))), store(state.density + at, select(lit, chosen.density, F(0.0f)));
    store(state.light + at, chosen.light);
  }
  return found;
}

// Sends light samples from the points that were chosen.
template <int W>
PRIMRAY_RARE void send_along_rays(Round& round) {
  using F = vfloat<W>;
  using V = vvec3<W>;
  const Scene& scene = round.scene;
  const PathPool& pool = *round.worker.pool;
  const AlongState& state = *round.worker.along;
  for (int at = 0; at < pool.count; at += W) {
    const F density = load<W>(state.density + at), t = load<W>(state.t + at);
    const V left{load<W>(state.left[0] + at), load<W>(state.left[1] + at), load<W>(state.left[2] + at)};
    vbool<W> lit = (lane_numbers<W>() < vint<W>(pool.count - at)) & (density > F(0.0f)) & (max_component(left) > F(0.0f));
    if (!any(lit)) continue;
    PathLanes<W> p = pool.paths<W>(at, round.needs);
    // Its numbers are not those of the vertex that may follow.
    p.sampler.seed = mix(p.sampler.seed ^ vuint<W>(0x7f4a7c15u));
    const vuint<W> seed = volume_seed<W>(p.sampler.seed, p.sampler.reversed_index, p.vertex);
    const V point = p.ray.o + p.ray.d * t;
    MediumAtPoint<W> medium;
    if (round.has_volumes()) offer_volumes(*scene.volumes, lit, p.depth == vint<W>(0), point, p.ray.time, seed, medium);
    MediumState<W> own;
    V around(F(1.0f));
    if (round.follows_media()) {
      own = round.worker.medium_states->pool->template at<W>(at);
      const RayMedium<W> along = medium_at(round, at, own);
      around = along.transmittance(t + own.origin_distance);
      offer_media(round, lit, along, point, seed, medium);
      own.origin_distance = F(0.0f);
    }
    lit &= medium.weight > F(0.0f);
    if (!any(lit)) continue;

    ChosenLight<W> chosen;
    chosen.choice.light = select(lit, load<W>(state.light + at), vint<W>(0));
    chosen.choice.probability = probability_of(scene.lights, chosen.choice.light, lit, point, V(F(0.0f)));
    const F by_vertices =
        AlongState::by_extinction(load<W>(state.from + at), t, load<W>(state.extinction + at)) * chosen.choice.probability;
    // The sample's own density of light and distance takes the place of the probability, and the share is its weight.
    const F share = chosen.choice.probability / (density + by_vertices);
    lit &= chosen.choice.probability > F(0.0f);
    p.beta = p.beta * left * around * medium.scattered() * share;
    if (round.deep)
      for (uint32_t b = bits(lit); b; b &= b - 1) {
        const int i = __builtin_ctz(b);
        if (!(p.slot[i] & kSettled)) p.slot.set(i, round.deep->lit(p.slot[i], depth_at(scene, p.ray, t[i], i), true));
      }
    const MediumInterface<W> media{own, Boundary<W>(own.stack), {}};
    with_phase_vertex(round, p, vint<W>(-1), t, medium.phase, round.follows_media() ? &media : nullptr,
                      [&](const auto& v) { queue_light_sample(round, lit, chosen, v, p, v.it.p, F(1.0f)); });
  }
}

template <int W>
PRIMRAY_RARE void sample_along_rays(Round& round) {
  if (!choose_along_rays<W>(round)) return;
  const PathPool& pool = *round.worker.pool;
  AlongState& state = *round.worker.along;
  for (float* left : state.left) std::fill_n(left, pool.count, 1.0f);
  if (round.has_volumes()) {
    VolumeState& volumes = *round.worker.volumes;
    for (int at = 0; at < pool.count; at += W)
      store(volumes.number + at, volume_seed<W>(load<W>(pool.seed + at) ^ vuint<W>(0x68bc21ebu),
                                                load<W>(pool.reversed_index + at), load<W>(pool.vertex + at)));
    const VolumeRays rays{pool.ox,   pool.oy,    pool.oz, pool.dx,        pool.dy,
                          pool.dz,   pool.tnear, state.t, volumes.number, round.needs.time ? pool.time : nullptr,
                          pool.depth};
    attenuate<W>(*round.scene.volumes, rays, pool.count, volumes.passes, state.left[0], state.left[1], state.left[2]);
  }
  send_along_rays<W>(round);
}

}  // namespace primray
