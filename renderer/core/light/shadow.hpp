// What lights do to their shadows (UsdLux ShadowAPI and shadow linking). "Special" lights are those whose shadows are not what
// the geometry casts: light sampling alone finds them, so that their occlusion is decided in one place
// (path/rays/shadow_rays.hpp).
#pragma once

#include "light/choice/linking.hpp"
#include "math/power.hpp"

namespace primray {

enum ShadowField : int {
  kCasters,  // a collection's number
  kCastsShadows,
  kShadowColor,
  kShadowEnd = kShadowColor + 3,  // occluders from here on cast none; infinite where there is no such limit
  kShadowFade,                    // size of the zone before that end in which shadows fade
  kShadowGamma,
  kShadowFields
};

// One lane's light each.
template <int W>
struct ShadowLanes {
  vint<W> casters;
  vbool<W> enabled;
  vvec3<W> color;
  vfloat<W> end, fade, gamma;

  PRIMRAY_INLINE ShadowLanes(const std::vector<float>& rows, vint<W> light) {
    const vint<W> at = light * vint<W>(kShadowFields);
    const auto field = [&](int k) { return gather<W>(rows.data() + k, at); };
    casters = truncate(field(kCasters)), enabled = field(kCastsShadows) > vfloat<W>(0.0f);
    color = {field(kShadowColor), field(kShadowColor + 1), field(kShadowColor + 2)};
    end = field(kShadowEnd), fade = field(kShadowFade), gamma = field(kShadowGamma);
  }
  // How much of a shadow an occluder casts that is `distance` from the surface: all of it before the zone, none from its end
  // on, in between the share of the zone that is left, to the power of gamma (ShadowAPI's text, read as strength^gamma).
  PRIMRAY_INLINE vfloat<W> strength(vfloat<W> distance) const {
    const vfloat<W> left = end - distance;
    const vbool<W> fades = (left > vfloat<W>(0.0f)) & (left < fade);
    const vfloat<W> share = clamp(left / select(fades, fade, vfloat<W>(1.0f)), 0.0f, 1.0f);
    const vfloat<W> whole = select(left > vfloat<W>(0.0f), vfloat<W>(1.0f), vfloat<W>(0.0f));
    return any(fades) ? select(fades, power_of_unit<W>(share, gamma), whole) : whole;
  }
};

}  // namespace primray
