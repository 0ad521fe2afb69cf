// Depth of what paths of a deep picture hit (integrator/deep_layers.hpp), along the camera's axis as the depth AOV has it.
#pragma once

#include "integrator/emission.hpp"
#include "integrator/round.hpp"

namespace primray {

// Returns the depth at distance `t` along the i-th ray, in scene units.
template <int W>
PRIMRAY_INLINE float depth_at(const Scene& scene, const Rays<W>& ray, float t, int i) {
  const Affine<float> camera = scene.camera.pose_at(ray.time[i]);
  const dvec3 o{ray.o.x[i], ray.o.y[i], ray.o.z[i]}, d{ray.d.x[i], ray.d.y[i], ray.d.z[i]};
  return float(-dot(o + d * double(t) - dvec3(camera.o), dvec3(camera.z)) / scene.scale);
}

// Returns slots for light that is placed apart (place_light()): those of paths that have not scattered name no layer.
template <int W>
PRIMRAY_INLINE vint<W> unplaced(const Round& round, vint<W> slot) {
  if (!round.deep) return slot;
  return select((slot & vint<W>(kSettled)) != vint<W>(0), slot, slot & vint<W>(kSumMask));
}

// Adds `light` that covers nothing at distance `t` to the layers of paths that have not scattered.
template <int W>
PRIMRAY_RARE void place_light(Round& round, vfloat<W> t, const vvec3<W>& light, const PathLanes<W>& p) {
  for (uint32_t b = bits(max_component(light) > vfloat<W>(0.0f)); b; b &= b - 1) {
    const int i = __builtin_ctz(b);
    if (p.slot[i] & kSettled) continue;
    const int32_t slot = round.deep->lit(p.slot[i], depth_at(round.scene, p.ray, t[i], i), true);
    round.deep->add_light(slot, light.x[i], light.y[i], light.z[i]);
  }
}

// Part of its sample's coverage that a straight path carries.
template <int W>
PRIMRAY_INLINE float carried_coverage(const PathLanes<W>& p, int i) {
  return (p.beta.x[i] + p.beta.y[i] + p.beta.z[i]) * (1.0f / 3);
}

// Places the events at distance `t` of lanes `m`, unless the paths have scattered before.
template <int W>
PRIMRAY_RARE void place_events(Round& round, vbool<W> m, vfloat<W> t, bool in_volume, PathLanes<W>& p) {
  for (uint32_t b = bits(m); b; b &= b - 1) {
    const int i = __builtin_ctz(b);
    if (p.slot[i] & kSettled) continue;
    const float depth = depth_at(round.scene, p.ray, t[i], i);
    p.slot.set(i, round.deep->placed(p.slot[i], depth, in_volume, carried_coverage(p, i)));
  }
}

// Places what the rays of lanes `active` end at: a light's body, a surface or a collision (lanes `hit`), or nothing. Light from
// behind everything belongs to the surface through which it is seen, unless that is a gap. `looks` as for gather_emission().
template <int W>
PRIMRAY_RARE void place_in_depth(Round& round, vbool<W> active, vbool<W> looks, vbool<W> hit, const Hits<W>& hits,
                                 bool in_volume, PathLanes<W>& p) {
  const vbool<W> open = active & ((p.slot & vint<W>(kSettled)) == vint<W>(0));
  if (!any(open)) return;
  vvec3<W> ignored(vfloat<W>(0.0f));
  const LightHits<W> bodies = intersect_lights(round.scene.lights, open & looks, hit, p, hits.t, ignored);
  place_events(round, open & bodies.covered, bodies.nearest, false, p);
  place_events(round, open & hit & !bodies.covered, hits.t, in_volume, p);
  for (uint32_t b = bits(open & !hit & !bodies.covered); b; b &= b - 1) {
    const int i = __builtin_ctz(b);
    if (key_of(p.slot[i]) != 0 && round.worker.a[p.slot[i] & kSumMask] < kThroughGaps) continue;
    p.slot.set(i, round.deep->placed_far(p.slot[i], carried_coverage(p, i)));
  }
}

}  // namespace primray
