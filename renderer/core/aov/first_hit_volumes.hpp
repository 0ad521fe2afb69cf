// Volumes before the first hits: grids of voxels, closed shapes that are filled with a medium, and fog.
//
// Coverage takes the collisions of the image's own camera rays, from the same random numbers: stages of the path loop are
// repeated here for paths that only pass straight (integrator/cross_volumes.hpp, integrator/cross_media.hpp). Filtered samples
// take opacities, whose variance is lower.
#pragma once

#include <functional>
#include <optional>

#include "integrator/rays/cross_grids.hpp"
#include "integrator/volume_state.hpp"
#include "medium/ray_medium.hpp"
#include "surface/interaction.hpp"
#include "volume/tracking_opacity.hpp"

namespace primray {

// A ray's way up to its next hit, in lanes.
template <int W>
struct WayToHit {
  Rays<W> ray;
  vfloat<W> end, light;       // distance of the surface, and of a light that covers what is behind it; kInfinity: none
  vbool<W> closed;            // a surface or the far plane ends it
  vint<W> sets;               // filled shapes that it is in (VolumeSets)
  vfloat<W> origin_distance;  // distance before the origin that media fill as well
};

// A volume that light collides with: a row of VolumeTable::media, a filled shape, or the fog.
struct SeenVolume {
  enum Kind { kGrid, kShape, kFog } kind;
  int32_t medium;
  VolumeObject object;
};

template <int W>
class FirstHitVolumes {
 public:
  using F = vfloat<W>;
  using I = vint<W>;
  using B = vbool<W>;
  using V = vvec3<W>;

  explicit FirstHitVolumes(const Scene& scene) : scene_(scene), grids_(scene.volumes && scene.volumes->in_media.any()) {
    if (scene.interiors.has_bounded()) sets_.emplace(scene.interiors);
  }
  bool any() const { return grids_ || scene_.interiors.has_added(); }
  I camera_sets() { return I(sets_ ? sets_->of_camera() : 0); }

  // Moves lanes `m` into the filled shapes whose boundaries they hit, or out of them.
  void cross(B m, const Hits<W>& hits, const Interaction<W>& it, const V& d, I& sets) {
    if (any_of(m)) cross_boundaries(scene_, *sets_, m, hits, it.surface, dot(it.ng, d) < F(0.0f), sets);
  }
  // Moves lanes `m` into the filled shapes that they leave at their hits without having entered them.
  void enter_missed_before(B m, const Hits<W>& hits, const Interaction<W>& it, const V& d, I& sets) {
    const B leaves = bounds_volume(scene_, m, it.surface) & (dot(it.ng, d) > F(0.0f));
    if (any_of(leaves)) enter_missed(scene_, *sets_, leaves, hits, it.surface, B(false), sets);
  }

  // Opacities up to the way's end, or a light before it.
  struct Opacity {
    V opacity{F(0.0f)}, colored{F(0.0f)};  // the latter times the albedo
    F weighted_distance{0.0f};             // mean distance of the collisions times the mean of `opacity`
  };
  Opacity opacity(B m, const WayToHit<W>& way, const Sampler<W>& sampler, I layer) {
    Opacity r;
    const F end = min(way.end, way.light);
    if (scene_.interiors.has_added()) add_homogeneous(m, way, end, sampler.single(layer + I(1), Purpose::kRoulette), r);
    if (!grids_) return r;
    put(m, way, end, volume_seed<W>(sampler.seed, sampler.reversed_index, layer));
    const V before = V(F(1.0f)) - r.opacity;
    for (int i = 0; i < W; ++i)
      for (int c = 0; c < 3; ++c) left_[c][i] = component(before, c)[i], colored_[c][i] = component(r.colored, c)[i];
    store(distance_, r.weighted_distance);
    const VolumeTable& volumes = *scene_.volumes;
    pass_volumes<W>(volumes.grids, volumes.in_media, columns(), W, passes_, [&](const VolumePasses& tasks) {
      const auto load_task = [&](B fresh, I numbers, OpacityEvents<W>& events) {
        const TrackingTask<W> task = medium_task<W>(volumes, columns(), tasks, fresh, numbers);
        const MediumLanes<W> medium(volumes, gather<W>(tasks.instance, numbers));
        events.grids = &volumes.grids;
        events.begin(fresh, task.segment, medium.albedo());
        return task;
      };
      const auto store_task = [&](B done, I numbers, const OpacityEvents<W>& events) {
        for (uint32_t b = bits(done); b; b &= b - 1) {
          const int i = __builtin_ctz(b), ray = tasks.ray[numbers[i]];
          distance_[ray] += events.weighted_distance[i] * (left_[0][ray] + left_[1][ray] + left_[2][ray]) * (1.0f / 3);
          for (int c = 0; c < 3; ++c) {
            colored_[c][ray] += left_[c][ray] * component(events.colored, c)[i];
            left_[c][ray] *= component(events.left, c)[i];
          }
        }
      };
      return follow_segments<W, OpacityEvents<W>>(volumes.grids, tasks.count, load_task, store_task);
    });
    r.opacity = V(F(1.0f)) - V{load<W>(left_[0]), load<W>(left_[1]), load<W>(left_[2])};
    r.colored = {load<W>(colored_[0]), load<W>(colored_[1]), load<W>(colored_[2])};
    r.weighted_distance = load<W>(distance_);
    return r;
  }

  // Finds the collisions of camera rays of the image, whose throughput is `beta`. Calls cover(lane, volume, share) for each
  // volume that takes the share of what is left of the ray, and multiplies `left` by what remains. Returns the lanes that go
  // on.
  using Cover = std::function<void(int, const SeenVolume&, float)>;
  B collide(B m, const WayToHit<W>& way, const Sampler<W>& sampler, I vertex, V& beta, F& left, const Cover& cover) {
    F end = way.end;
    I instance(-1);
    if (grids_) {
      put(m, way, end, volume_seed<W>(sampler.seed, sampler.reversed_index, vertex));
      store(left_[0], beta.x), store(left_[1], beta.y), store(left_[2], beta.z), store(instance_, instance);
      sample_collisions<W>(*scene_.volumes, columns(), W, passes_,
                           {end_, left_[0], left_[1], left_[2], instance_, colored_[0], colored_[1], colored_[2]});
      beta = select(m, V{load<W>(left_[0]), load<W>(left_[1]), load<W>(left_[2])}, beta);
      instance = select(m, load<W>(instance_), instance), end = select(m, load<W>(end_), end);
    }
    // A light before the collision covers the rest.
    const B lit = way.light < end;
    end = min(end, way.light);
    B in_fog(false), in_shapes(false);
    RayMedium<W> medium;
    if (scene_.interiors.has_added()) {
      medium = medium_around(m, way);
      const Fog& fog = scene_.interiors.fog;
      end += way.origin_distance;
      if (medium.any_fog && fog.extinction > 0) {
        if (fog.scatters()) {
          const F t = medium.fog.collision(sampler.pair(vertex + I(kFogDimensions), Purpose::kLens).u);
          in_fog = m & (t < end), end = select(in_fog, t, end);
        } else {
          absorb(m, V(medium.fog.transmittance(end)), {SeenVolume::kFog, 0, {}}, beta, left, cover);
        }
      }
      const B scatters = m & medium.scatters();
      if (medium.any_volumes) {
        for (uint32_t b = bits(m & !scatters); b; b &= b - 1)
          absorb_in_shapes(__builtin_ctz(b), medium, end, beta, left, cover);
        if (any_of(scatters)) {
          const Pair<W> u = sampler.pair(vertex + I(1), Purpose::kLens);
          const DistanceSample<W> step = sample_distance(medium, beta, end, u.u, u.v);
          beta = select(scatters, step.beta, beta), in_shapes = scatters & step.scatters;
        }
      }
    }
    const B in_grid = m & (instance >= I(0)) & !(lit | in_fog | in_shapes);
    in_fog &= !in_shapes;
    for (uint32_t b = bits(in_grid | in_fog | in_shapes); b; b &= b - 1) {
      const int i = __builtin_ctz(b);
      if (in_shapes[i])
        divide(i, medium.row[i], left[i], cover);
      else if (in_fog[i])
        cover(i, {SeenVolume::kFog, 0, {}}, left[i]);
      else if (!is_matte(size_t(instance[i])))
        cover(i, {SeenVolume::kGrid, scene_.volumes->in_media.of[size_t(instance[i])], {}}, left[i]);
    }
    return m & !(in_grid | in_fog | in_shapes);
  }

 private:
  // Mattes cover nothing.
  bool is_matte(size_t instance) const {
    const CameraVisibilityTable& camera = scene_.volumes->in_media.camera;
    return camera.any() && camera.of_surface[instance] == int32_t(CameraVisibility::kMatte);
  }
  static bool any_of(B m) { return primray::any(m); }
  static F component(const V& v, int c) { return c == 0 ? v.x : c == 1 ? v.y : v.z; }

  // Stores the ways of lanes `m` up to `end`; other lanes have none.
  void put(B m, const WayToHit<W>& way, F end, vuint<W> seed) {
    const Rays<W>& r = way.ray;
    store(ray_[0], r.o.x), store(ray_[1], r.o.y), store(ray_[2], r.o.z);
    store(ray_[3], r.d.x), store(ray_[4], r.d.y), store(ray_[5], r.d.z);
    store(ray_[6], r.tnear), store(ray_[7], r.time);
    store(end_, select(m, end, F(0.0f))), store(number_, seed);
  }
  VolumeRays columns() const {
    return {ray_[0], ray_[1], ray_[2], ray_[3], ray_[4], ray_[5], ray_[6], end_, number_, scene_.moves() ? ray_[7] : nullptr,
            depth_};
  }

  // Media of filled shapes and fog around the ways.
  RayMedium<W> medium_around(B m, const WayToHit<W>& way) const {
    RayMedium<W> r;
    const B in_shapes = m & way.closed & (way.sets != I(0));
    if (any_of(in_shapes)) r.add(in_shapes, *sets_, VolumeSets::row_of(select(in_shapes, way.sets, I(0)), B(true)));
    const Fog& fog = scene_.interiors.fog;
    if (fog.any() && !fog.hidden) r.add(FogAlong<W>(fog, m, way.ray.o - way.ray.d * way.origin_distance, way.ray.d), fog);
    return r;
  }
  void add_homogeneous(B m, const WayToHit<W>& way, F end, F u, Opacity& r) const {
    const RayMedium<W> medium = medium_around(m, way);
    const F length = end + way.origin_distance;
    const auto add = [&](B lanes, const V& transmittance, const V& albedo, const auto& distance_of) {
      const V seen = select(lanes, (V(F(1.0f)) - transmittance) * (V(F(1.0f)) - r.opacity), V(F(0.0f)));
      const F share = (seen.x + seen.y + seen.z) * (1.0f / 3);
      const F chance = 1.0f - (transmittance.x + transmittance.y + transmittance.z) * (1.0f / 3);
      const F t = min(distance_of(u * chance), length) - way.origin_distance;
      r.opacity += seen, r.colored += seen * albedo;
      r.weighted_distance += select(share > F(0.0f), share * t, F(0.0f));
    };
    if (medium.any_volumes) {
      const V& e = medium.extinction;
      const V albedo = medium.scattering * V{1.0f / max(e.x, 1e-30f), 1.0f / max(e.y, 1e-30f), 1.0f / max(e.z, 1e-30f)};
      const F mean = (e.x + e.y + e.z) * (1.0f / 3);
      add(m & (mean > F(0.0f)), medium.Medium<W>::transmittance(length), albedo,
          [&](F y) { return depth_of(y) / max(mean, 1e-30f); });
    }
    if (medium.any_fog) {
      const vec3& a = scene_.interiors.fog.albedo;
      add(m, V(medium.fog.transmittance(length)), {F(a.x), F(a.y), F(a.z)}, [&](F y) { return medium.fog.collision(y); });
    }
  }

  // Covers by `volume` what a medium that only absorbs takes.
  void absorb(B m, const V& transmittance, const SeenVolume& volume, V& beta, F& left, const Cover& cover) {
    for (uint32_t b = bits(m); b; b &= b - 1) {
      const int i = __builtin_ctz(b);
      const float passes = share_left(i, transmittance, beta);
      if (passes < 1) cover(i, volume, left[i] * (1 - passes));
      left.set(i, left[i] * passes);
    }
    beta = select(m, beta * transmittance, beta);
  }
  void absorb_in_shapes(int i, const RayMedium<W>& medium, F end, V& beta, F& left, const Cover& cover) {
    const V transmittance = medium.Medium<W>::transmittance(end);
    const float passes = share_left(i, transmittance, beta);
    if (passes < 1) divide(i, medium.row[i], left[i] * (1 - passes), cover);
    left.set(i, left[i] * passes);
    beta.x.set(i, beta.x[i] * transmittance.x[i]), beta.y.set(i, beta.y[i] * transmittance.y[i]);
    beta.z.set(i, beta.z[i] * transmittance.z[i]);
  }
  static float share_left(int i, const V& t, const V& beta) {
    const float before = beta.x[i] + beta.y[i] + beta.z[i];
    return before > 0 ? (beta.x[i] * t.x[i] + beta.y[i] * t.y[i] + beta.z[i] * t.z[i]) / before : 0.0f;
  }
  // Divides a share among the filled shapes of a row of media by their extinctions; mattes cover nothing.
  void divide(int i, int32_t row, float share, const Cover& cover) const {
    const auto weight = [&](const VolumeObject& o) {
      const Volume& v = scene_.interiors.volumes[size_t(o.volume)];
      return v.camera == CameraVisibility::kHidden ? 0.0f : v.extinction.x + v.extinction.y + v.extinction.z;
    };
    float total = 0;
    for (const VolumeObject& o : sets_->objects(row / 2)) total += weight(o);
    for (const VolumeObject& o : sets_->objects(row / 2))
      if (weight(o) > 0 && scene_.interiors.volumes[size_t(o.volume)].camera == CameraVisibility::kSeen)
        cover(i, {SeenVolume::kShape, 0, o}, share * weight(o) / total);
  }

  const Scene& scene_;
  const bool grids_;
  std::optional<VolumeSets> sets_;
  VolumePasses passes_;
  alignas(64) float ray_[8][W + 16], end_[W + 16], left_[3][W + 16], colored_[3][W + 16], distance_[W + 16];
  alignas(64) int32_t instance_[W + 16], depth_[W + 16] = {};
  alignas(64) uint32_t number_[W + 16];
};

}  // namespace primray
