// Emissive geometry in moving instances: its pose and its shaping at a time. Its light rows (kMoving) have the bounding spheres
// of its path, since lights are chosen without a time.
#pragma once

#include "light/light.hpp"
#include "light/shaping/shaping.hpp"
#include "scene/scene.hpp"

namespace primray {

// World from the frame of `light`, which moves, at a time.
inline daffine emitter_pose(const Scene& scene, int light, float time) {
  const EmitterTable& table = scene.emitters;
  const int32_t instance = table.moving_instance[size_t(light)];
  const MovingInstances& in = *scene.motion.find(instance);
  return scene.motion.at(in, uint32_t(instance - in.first), time) *
         table.frames[size_t(int_at(scene.lights.row(light), kPoseIndex))];
}

// Variant of emitter_shaping() for scenes in which some lights move.
template <int W>
PRIMRAY_RARE vvec3<W> moving_shaping(const Scene& scene, const LightRow<W>& row, vbool<W> m, vint<W> light, const vvec3<W>& wi,
                                     vfloat<W> time) {
  ShapedLanes<W> now{vvec3<W>(vfloat<W>(0.0f)), vvec3<W>(vfloat<W>(0.0f)), vvec3<W>(vfloat<W>(0.0f)),
                     vvec3<W>(vfloat<W>(0.0f))};
  for (uint32_t b = bits(m & (row.integer(kShaping) != vint<W>(0))); b; b &= b - 1) {
    const int i = __builtin_ctz(b);
    const float* own = scene.lights.row(light[i]);
    const float* shaped = scene.lights.shaping.row(int_at(own, kShaping));
    ShapedFrame f{light_vector(shaped, kShapedAxis), light_vector(shaped, kIesFrame), light_vector(shaped, kIesFrame + 3),
                  light_vector(shaped, kIesFrame + 6)};
    if (int_at(own, kLightFlags) & kMoving) f = shaped_frame(emitter_pose(scene, light[i], time[i]));
    const auto set = [i](vvec3<W>& to, const dvec3& v) {
      to.x.set(i, float(v.x)), to.y.set(i, float(v.y)), to.z.set(i, float(v.z));
    };
    set(now.axis, f.axis), set(now.x, f.x), set(now.y, f.y), set(now.z, f.z);
  }
  return light_shaping(scene.lights, row, m, wi, &now);
}

// Shaping factor of emissive geometry, for emission towards the origin of rays along wi.
template <int W>
PRIMRAY_INLINE vvec3<W> emitter_shaping(const Scene& scene, const LightRow<W>& row, vbool<W> m, vint<W> light,
                                        const vvec3<W>& wi, vfloat<W> time) {
  if (scene.emitters.any_moving()) return moving_shaping(scene, row, m, light, wi, time);
  return light_shaping(scene.lights, row, m, wi);
}

}  // namespace primray
