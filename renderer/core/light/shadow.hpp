// Shadow properties of lights (UsdLux ShadowAPI and shadow linking). "Special" lights have shadows that differ from those of
// the geometry: they are only found by light sampling, so that their occlusion is computed in one place
// (integrator/rays/shadow_rays.hpp).
#pragma once

#include "light/tree/linking.hpp"
#include "math/transcendental.hpp"

namespace primray {

enum ShadowField : int {
  kCasters,  // number of the collection of casters
  kCastsShadows,
  kShadowColor,
  kShadowEnd = kShadowColor + 3,  // distance beyond which occluders cast no shadow; infinite if there is no limit
  kShadowFade,                    // width of the zone before that distance in which shadows fade
  kShadowGamma,
  kShadowFields
};

// Shadow properties of each lane's light.
template <int W>
struct ShadowLanes {
  vint<W> casters;
  vbool<W> enabled;
  vvec3<W> color;
  vfloat<W> end, fade, gamma;

  PRIMRAY_INLINE ShadowLanes(const std::vector<float>& rows, vint<W> light) {
    const vint<W> at = light * vint<W>(kShadowFields);
    const auto field = [&](int k) { return gather<W>(rows.data() + k, at); };
    casters = bit_cast<vint<W>>(field(kCasters)), enabled = field(kCastsShadows) > vfloat<W>(0.0f);
    color = {field(kShadowColor), field(kShadowColor + 1), field(kShadowColor + 2)};
    end = field(kShadowEnd), fade = field(kShadowFade), gamma = field(kShadowGamma);
  }
  // Strength of the shadow of an occluder at `distance` from the surface: 1 before the fading zone, 0 beyond its end, and
  // within it the remaining share of the zone to the power of gamma (ShadowAPI's text, read as strength^gamma).
  PRIMRAY_INLINE vfloat<W> strength(vfloat<W> distance) const {
    const vfloat<W> left = end - distance;
    const vbool<W> fades = (left > vfloat<W>(0.0f)) & (left < fade);
    const vfloat<W> share = clamp(left / select(fades, fade, vfloat<W>(1.0f)), 0.0f, 1.0f);
    const vfloat<W> whole = select(left > vfloat<W>(0.0f), vfloat<W>(1.0f), vfloat<W>(0.0f));
    return any(fades) ? select(fades, power_of_unit<W>(share, gamma), whole) : whole;
  }
};

}  // namespace primray
