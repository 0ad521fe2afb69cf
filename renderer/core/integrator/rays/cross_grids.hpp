// Rays through the volumes of a scene, which are tracked volume by volume, in the order in which a ray enters them: the first
// collision of paths, and the transmittance of shadow rays.
#pragma once

#include <vector>

#include "integrator/rays/path_pool.hpp"
#include "volume/albedo_lookup.hpp"
#include "volume/next_volume.hpp"
#include "volume/tracking.hpp"

namespace primray {

// Tasks of one pass: at most one volume for each ray; and where each ray is in the order of its volumes.
struct VolumePasses {
  static constexpr int kMost = 512 + 16;
  // By task.
  alignas(64) int32_t ray[kMost], instance[kMost];
  alignas(64) float from[kMost], to[kMost];
  int count = 0;
  // Rays that may enter more volumes, and by ray the last volume.
  alignas(64) int32_t left[kMost], last_instance[kMost];
  alignas(64) float last_from[kMost];
  // By ray, where there are many volumes: what the last traversal found (kMostFound for each ray; on the heap, since stacks of
  // threads are small), how much that could be and is, and how much is passed.
  std::vector<EnteredVolume> found;
  int32_t wanted[kMost], found_count[kMost], passed[kMost];
  LaneSteps steps;

  // Appends the task of the volume that ray `k` enters next, if there is one: of many volumes.
  void append_next(const GridTable& grids, const VolumePlacements& placed, const VolumeRays& rays, size_t k) {
    const float end = rays.end[k];
    EnteredVolume* const own = &found[k * kMostFound];
    if (passed[k] == found_count[k]) {
      if (found_count[k] < wanted[k]) return;  // there are no more
      const bool is_first = wanted[k] == 0;
      const EnteredVolume last = is_first ? EnteredVolume{} : own[found_count[k] - 1];
      wanted[k] = is_first ? kFirstFound : std::min(4 * wanted[k], kMostFound);
      const vvec3<1> o{vfloat<1>(rays.ox[k]), vfloat<1>(rays.oy[k]), vfloat<1>(rays.oz[k])};
      const vvec3<1> d{vfloat<1>(rays.dx[k]), vfloat<1>(rays.dy[k]), vfloat<1>(rays.dz[k])};
      found_count[k] = find_in_hierarchy(grids, placed, o, d, rays.begin ? rays.begin[k] : 0.0f, end,
                                         rays.time ? rays.time[k] : 0.0f, is_first ? nullptr : &last, wanted[k], own);
      passed[k] = 0;
      if (found_count[k] == 0) return;
    }
    // The ray may end earlier than when the volumes were found.
    const EnteredVolume& next = own[passed[k]++];
    if (!(next.from < end)) return;
    ray[count] = int32_t(k), instance[count] = next.instance, from[count] = next.from, to[count] = std::min(next.to, end);
    ++count;
  }
};

// Medium of instances, in lanes.
template <int W>
struct MediumLanes {
  vint<W> row;
  PRIMRAY_INLINE MediumLanes(const VolumeTable& v, vint<W> instance)
      : row(gather<W>(v.in_media.of.data(), instance)), base_(reinterpret_cast<const int32_t*>(v.media.data())) {}
  PRIMRAY_INLINE vint<W> grid() const { return number(0); }
  PRIMRAY_INLINE vvec3<W> extinction() const { return {real(5), real(6), real(7)}; }
  PRIMRAY_INLINE AlbedoLookup<W> albedo() const {
    return {{real(8), real(9), real(10)}, number(1), {number(2), number(3), number(4)}};
  }
  PRIMRAY_INLINE vfloat<W> phase() const { return real(11); }

 private:
  const int32_t* base_;
  PRIMRAY_INLINE vint<W> number(int k) const { return gather<W>(base_ + k, row * vint<W>(12)); }
  PRIMRAY_INLINE vfloat<W> real(int k) const { return bit_cast<vfloat<W>>(number(k)); }
};

// Runs passes over `count` rays until none enters another volume. `track(tasks)` follows the tasks of a pass; rays for which
// `carries(ray)` is false then need not be followed.
template <int W, class Track, class Carries>
PRIMRAY_INLINE void pass_volumes(const GridTable& grids, const VolumePlacements& placed, const VolumeRays& rays, int count,
                                 VolumePasses& passes, const Track& track, const Carries& carries) {
  using I = vint<W>;
  const bool many = placed.size() > kFewVolumes;
  if (many) {
    passes.found.resize(size_t(VolumePasses::kMost) * kMostFound);
    for (int32_t* of : {passes.wanted, passes.found_count, passes.passed}) std::fill_n(of, count, 0);
  }
  for (int i = 0; i < count; i += W) {
    store(passes.left + i, lane_numbers<W>() + I(i));
    store(passes.last_instance + i, I(-1)), store(passes.last_from + i, vfloat<W>(0.0f));
  }
  // A ray enters each instance once.
  int left = count;
  for (size_t pass = 0; left > 0 && pass < placed.size(); ++pass) {
    int staying = 0;
    passes.count = 0;
    if (many)
      for (int k = 0; k < left; ++k) passes.append_next(grids, placed, rays, size_t(passes.left[k]));
    for (int at = 0; !many && at < left; at += W) {
      const vbool<W> m = lane_numbers<W>() < I(left - at);
      const I ray = select(m, load<W>(passes.left + at), I(0));
      const vvec3<W> o{gather<W>(rays.ox, ray), gather<W>(rays.oy, ray), gather<W>(rays.oz, ray)};
      const vvec3<W> d{gather<W>(rays.dx, ray), gather<W>(rays.dy, ray), gather<W>(rays.dz, ray)};
      const vfloat<W> begin = rays.begin ? gather<W>(rays.begin, ray) : vfloat<W>(0.0f);
      const NextVolume<W> last{gather<W>(passes.last_instance, ray), gather<W>(passes.last_from, ray), vfloat<W>(0.0f)};
      const NextVolume<W> next = next_volume(grids, placed, m, o, d, begin, gather<W>(rays.end, ray), rays.time_of(ray), last);
      const Compaction<W> c(m & (next.instance >= I(0)));
      c.append(passes.ray + passes.count, ray), c.append(passes.instance + passes.count, next.instance);
      c.append(passes.from + passes.count, next.from), c.append(passes.to + passes.count, next.to);
      passes.count += c.count;
    }
    if (passes.count == 0) return;
    const LaneSteps steps = track(passes);
    passes.steps.all += steps.all, passes.steps.busy += steps.busy;
    for (int k = 0; k < passes.count; ++k) {
      const int32_t ray = passes.ray[k];
      passes.last_instance[ray] = passes.instance[k], passes.last_from[ray] = passes.from[k];
      if (carries(ray)) passes.left[staying++] = ray;
    }
    left = staying;
  }
}

template <int W, class Track>
PRIMRAY_INLINE void pass_volumes(const GridTable& grids, const VolumePlacements& placed, const VolumeRays& rays, int count,
                                 VolumePasses& passes, const Track& track) {
  pass_volumes<W>(grids, placed, rays, count, passes, track, [](int32_t) { return true; });
}

// Returns the tracking tasks `numbers` of a pass in lanes `m`, without extinction.
template <int W>
PRIMRAY_INLINE TrackingTask<W> tracking_task(const VolumePlacements& placed, const VolumeRays& rays, const VolumePasses& passes,
                                             vbool<W> m, vint<W> numbers) {
  const vint<W> ray = gather<W>(passes.ray, numbers), instance = gather<W>(passes.instance, numbers);
  const GridRays<W> in_grid(placed, m, instance, {gather<W>(rays.ox, ray), gather<W>(rays.oy, ray), gather<W>(rays.oz, ray)},
                            {gather<W>(rays.dx, ray), gather<W>(rays.dy, ray), gather<W>(rays.dz, ray)}, rays.time_of(ray));
  const vuint<W> seed = bit_cast<vuint<W>>(gather<W>(reinterpret_cast<const int32_t*>(rays.number), ray));
  return {gather<W>(placed.grid.data(), instance),
          {in_grid.o, in_grid.d, gather<W>(passes.from, numbers), gather<W>(passes.to, numbers), vvec3<W>(vfloat<W>(0.0f))},
          seed ^ mix(bit_cast<vuint<W>>(instance) + vuint<W>(0x85ebca6bu)),
          rays.time_of(ray)};
}
template <int W>
PRIMRAY_INLINE TrackingTask<W> medium_task(const VolumeTable& volumes, const VolumeRays& rays, const VolumePasses& passes,
                                           vbool<W> m, vint<W> numbers) {
  TrackingTask<W> task = tracking_task(volumes.in_media, rays, passes, m, numbers);
  const vint<W> instance = gather<W>(passes.instance, numbers);
  task.segment.extinction = MediumLanes<W>(volumes, instance).extinction();
  if (const CameraVisibilityTable& camera = volumes.in_media.camera; camera.any()) {
    const vbool<W> looks = rays.from_camera(m, gather<W>(passes.ray, numbers));
    const vbool<W> hidden = camera.lanes_with(CameraVisibility::kHidden, looks, instance);
    task.segment.extinction = select(hidden, vvec3<W>(vfloat<W>(0.0f)), task.segment.extinction);
  }
  return task;
}

// First collisions of paths: in the arrays of their owner, by path.
struct CollisionColumns {
  float* end;         // in: the segments' ends; out: the collisions'
  float *r, *g, *b;   // throughput
  int32_t* instance;  // out, of collisions: the instance that the path collides with; elsewhere left alone
  float *albedo_r, *albedo_g, *albedo_b;
};

template <int W>
PRIMRAY_RARE void sample_collisions(const VolumeTable& volumes, const VolumeRays& rays, int count, VolumePasses& passes,
                                    const CollisionColumns& found) {
  pass_volumes<W>(volumes.grids, volumes.in_media, rays, count, passes, [&](const VolumePasses& tasks) {
    const auto load = [&](vbool<W> fresh, vint<W> numbers, CollisionEvents<W>& events) {
      const vint<W> ray = gather<W>(tasks.ray, numbers);
      const TrackingTask<W> task = medium_task<W>(volumes, rays, tasks, fresh, numbers);
      events.begin(fresh, task.segment, {gather<W>(found.r, ray), gather<W>(found.g, ray), gather<W>(found.b, ray)});
      return task;
    };
    const auto store = [&](vbool<W> done, vint<W> numbers, const CollisionEvents<W>& events) {
      const vint<W> instance = gather<W>(tasks.instance, numbers);
      vvec3<W> albedo(vfloat<W>(1.0f));
      if (any(done & events.happens)) {
        const AlbedoLookup<W> lookup = MediumLanes<W>(volumes, instance).albedo();
        albedo = lookup.at(volumes.grids, done & events.happens, events.voxel[0], events.voxel[1], events.voxel[2]);
      }
      for (uint32_t b = bits(done); b; b &= b - 1) {
        const int i = __builtin_ctz(b), ray = tasks.ray[numbers[i]];
        found.r[ray] = events.beta.x[i], found.g[ray] = events.beta.y[i], found.b[ray] = events.beta.z[i];
        if (!events.happens[i]) continue;
        found.end[ray] = events.t[i], found.instance[ray] = instance[i];
        found.albedo_r[ray] = albedo.x[i], found.albedo_g[ray] = albedo.y[i], found.albedo_b[ray] = albedo.z[i];
      }
    };
    return follow_segments<W, CollisionEvents<W>>(volumes.grids, tasks.count, load, store);
  });
}

// Multiplies what rays carry by the transmittance of all volumes; rays that carry nothing are not followed.
template <int W>
PRIMRAY_RARE void attenuate(const VolumeTable& volumes, const VolumeRays& rays, int count, VolumePasses& passes, float* r,
                            float* g, float* b) {
  pass_volumes<W>(
      volumes.grids, volumes.in_media, rays, count, passes,
      [&](const VolumePasses& tasks) {
        const auto load = [&](vbool<W> fresh, vint<W> numbers, TransmittanceEvents<W>& events) {
          const TrackingTask<W> task = medium_task<W>(volumes, rays, tasks, fresh, numbers);
          events.begin(fresh, task.segment);
          return task;
        };
        const auto store = [&](vbool<W> done, vint<W> numbers, const TransmittanceEvents<W>& events) {
          const vvec3<W> left = events.transmittance();
          for (uint32_t m = bits(done); m; m &= m - 1) {
            const int i = __builtin_ctz(m), ray = tasks.ray[numbers[i]];
            r[ray] *= left.x[i], g[ray] *= left.y[i], b[ray] *= left.z[i];
          }
        };
        return follow_segments<W, TransmittanceEvents<W>>(volumes.grids, tasks.count, load, store);
      },
      [&](int32_t ray) { return std::max({r[ray], g[ray], b[ray]}) > 0; });
}

}  // namespace primray
