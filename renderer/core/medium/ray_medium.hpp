// Medium along rays: that of the innermost object, or outside of all objects with an interface the sum of the volumes around
// and of the fog; and what it emits.
#pragma once

#include "medium/fog.hpp"
#include "medium/medium_stack.hpp"
#include "medium/volume_sets.hpp"
#include "medium/walk_guide.hpp"

namespace primray {

// Radiance per length that the topmost objects emit in lanes `m`.
template <int W>
PRIMRAY_RARE vvec3<W> emission_in(const Scene& scene, const MediumStack<W>& stack, vbool<W> m) {
  const vvec3<W> none(vfloat<W>(0.0f));
  if (scene.interiors.emission.empty()) return none;
  const vbool<W> is = m & (stack.top() >= vint<W>(0));
  const vint<W> at = select(is, stack.top(), vint<W>(0)) * vint<W>(3);
  return select(is, gather_vec3<W>(&scene.interiors.emission[0].x, at), none);
}

// Without the fog, `Medium` is all that extinguishes.
template <int W>
struct RayMedium : Medium<W> {
  vvec3<W> emission{vfloat<W>(0.0f)};  // radiance per length, without the fog's
  FogAlong<W> fog;
  vint<W> row{0};  // of volumes in VolumeSets, where any contain the ray
  bool any_emission = false, any_fog = false, any_volumes = false, any_ended = false;
  vbool<W> ended{false}, by_guide{false};  // lanes whose rays end where they collide (integrator/end_rays.hpp)
  vvec3<W> drawn_by;                       // throughput of their paths
  const WalkDistance<W>* walk = nullptr;   // steps of guided walks

  RayMedium() = default;
  PRIMRAY_INLINE explicit RayMedium(const Medium<W>& m) : Medium<W>(m) {}

  // Adds the volumes of rows `at`, in lanes `m`, which are in no other medium.
  void add(vbool<W> m, const VolumeSets& sets, vint<W> at) {
    vvec3<W> shines;
    const Medium<W> sum = sets.medium(at, shines);
    this->extinction = select(m, sum.extinction, this->extinction);
    this->scattering = select(m, sum.scattering, this->scattering);
    this->phase = select(m, sum.phase, this->phase);
    emission = select(m, shines, emission);
    row = select(m, at, row), any_volumes = true;
  }
  void add(const FogAlong<W>& along, const Fog&) { fog = along, any_fog = true; }
  // In lanes `m`, for paths of throughput `beta`; in lanes `guided` at those of `steps`.
  PRIMRAY_INLINE void end_at_collisions(vbool<W> m, const vvec3<W>& beta, vbool<W> guided, const WalkDistance<W>& steps) {
    ended = m, drawn_by = beta, any_ended = true, by_guide = guided, walk = &steps;
  }

  PRIMRAY_INLINE vbool<W> exists() const {
    vbool<W> r = Medium<W>::exists();
    if (any_emission) r |= max_component(emission) > vfloat<W>(0.0f);
    if (any_fog) r |= fog.lanes;
    return r;
  }
  // Transmittance over distance `t`; along rays that end where they collide, divided by the probability with which they are as
  // long as that.
  PRIMRAY_INLINE vvec3<W> transmittance(vfloat<W> t) const {
    vvec3<W> r = Medium<W>::transmittance(t);
    if (any_ended) {
      const vfloat<W> sum = drawn_by.x + drawn_by.y + drawn_by.z;
      vfloat<W> longer = dot(drawn_by, r) / max(sum, 1e-30f);
      if (any(by_guide)) longer = select(by_guide, walk->survival(min(t, kEndless)), longer);
      r = select(ended, r * (1.0f / max(longer, 1e-30f)), r);
    }
    return any_fog ? r * fog.transmittance(t) : r;
  }
};

// Integral over distance `t` of the transmittance of a medium that has `extinction`.
template <int W>
PRIMRAY_INLINE vvec3<W> integral_of_transmittance(const vvec3<W>& extinction, vfloat<W> t) {
  // Without extinction, an endless medium's light would have no bound: such a medium is taken to be an open mesh.
  const vfloat<W> way = select(t < vfloat<W>(kEndless), t, vfloat<W>(0.0f));
  const auto integral = [&](vfloat<W> e) {
    return select((t >= vfloat<W>(kEndless)) & (e > vfloat<W>(0.0f)), 1.0f / max(e, 1e-30f), way * mean_of_exp(e * way));
  };
  return {integral(extinction.x), integral(extinction.y), integral(extinction.z)};
}

// Transmittance of the volumes and the fog around a shadow ray; see transmittance_along().
template <int W>
PRIMRAY_RARE vvec3<W> added_transmittance(const Scene& scene, const ShadowMedia<W>& media, const Rays<W>& rays, vfloat<W> t,
                                          vbool<W> reaches) {
  const vbool<W> outside = media.stack.top() < vint<W>(0), in_volumes = outside & reaches & (media.volumes != vint<W>(0));
  RayMedium<W> medium;
  if (any(in_volumes)) {
    const vint<W> row = VolumeSets::row_of(select(in_volumes, media.volumes, vint<W>(0)), vbool<W>(false));
    medium.add(in_volumes, *media.sets, row);
  }
  if (scene.interiors.fog.any())
    medium.add(FogAlong<W>(scene.interiors.fog, outside, rays.o - rays.d * media.origin_distance, rays.d), scene.interiors.fog);
  return medium.transmittance(t + media.origin_distance);
}

// Transmittance of a shadow ray's medium from `o` along `d`, over distance `t` and what the medium fills before the origin.
// `reaches`: lanes that end at a surface, or at a point that they were aimed at.
template <int W>
PRIMRAY_INLINE vvec3<W> transmittance_along(const Scene& scene, const ShadowMedia<W>& media, const Rays<W>& rays, vfloat<W> t,
                                            vbool<W> reaches) {
  vvec3<W> r = medium_of(scene, media.stack).transmittance(t + media.origin_distance);
  if (scene.interiors.has_added()) r = r * added_transmittance(scene, media, rays, t, reaches);
  return r;
}

// Returns the distance at which rays that hit the boundary of a volume at distance `t` go on; always a later one.
template <int W>
PRIMRAY_INLINE vfloat<W> behind_boundary(vfloat<W> t, vfloat<W> offset) {
  return t * (1 + 0x1p-21f) + offset * 0.125f;
}

// Moves lanes `m`, which hit surfaces of volumes, into these or out of them.
template <int W>
PRIMRAY_RARE void cross_boundaries(const Scene& scene, VolumeSets& sets, vbool<W> m, const Hits<W>& hits, vint<W> surface,
                                   vbool<W> front, vint<W>& volumes) {
  const HitGroup<W> in(scene, m, hits);
  for (uint32_t b = bits(m); b; b &= b - 1) {
    const int i = __builtin_ctz(b);
    volumes.set(i, sets.after(volumes[i], volume_object_at(scene, in, surface[i], i), front[i]));
  }
}
// Adds to `volumes` those that lanes `m` leave at their hits without having entered them: an entry that coincides with another
// surface is not found.
template <int W>
PRIMRAY_RARE void enter_missed(const Scene& scene, VolumeSets& sets, vbool<W> m, const Hits<W>& hits, vint<W> surface,
                               vbool<W> front, vint<W>& volumes) {
  cross_boundaries(scene, sets, m & !front, hits, surface, vbool<W>(true), volumes);
}
// Returns the lanes of `m` whose surface bounds a volume.
template <int W>
PRIMRAY_INLINE vbool<W> bounds_volume(const Scene& scene, vbool<W> m, vint<W> surface) {
  if (!scene.interiors.has_bounded()) return vbool<W>(false);
  return m & (gather<W>(scene.interiors.volume_of.data(), select(m, surface, vint<W>(0))) >= vint<W>(0));
}

}  // namespace primray
