// Shaping of emissive geometry, which turns with its instance, in lanes.
#pragma once

#include "emitter/passing_emitter.hpp"
#include "light/shaping/shaped_frame.hpp"

namespace primray {

// Variant of emitter_shaping() for scenes in which some lights move.
template <int W>
PRIMRAY_RARE vvec3<W> passing_shaping(const Scene& scene, const LightRow<W>& row, vbool<W> m, vint<W> light, const vvec3<W>& wi,
                                      vfloat<W> time) {
  ShapedLanes<W> now{vvec3<W>(vfloat<W>(0.0f)), vvec3<W>(vfloat<W>(0.0f)), vvec3<W>(vfloat<W>(0.0f)),
                     vvec3<W>(vfloat<W>(0.0f))};
  for (uint32_t b = bits(m & (truncate(row(kShaping)) != vint<W>(0))); b; b &= b - 1) {
    const int i = __builtin_ctz(b);
    const float* own = scene.lights.row(light[i]);
    const float* shaped = scene.lights.shaping.row(int(own[kShaping]));
    ShapedFrame f{light_vector(shaped, kShapedAxis), light_vector(shaped, kIesFrame), light_vector(shaped, kIesFrame + 3),
                  light_vector(shaped, kIesFrame + 6)};
    if (int(own[kLightFlags]) & kPassing) f = shaped_frame(emitter_stance(scene, light[i], time[i]));
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
  if (scene.emitters.any_moving()) return passing_shaping(scene, row, m, light, wi, time);
  return light_shaping(scene.lights, row, m, wi);
}

}  // namespace primray
