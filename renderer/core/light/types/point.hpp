// Point light with the same radiant intensity in all directions. Rays never hit it.
#pragma once

#include "light/types/light_type.hpp"

namespace primray {

struct PointLight : LightTypeDefaults {
  static constexpr LightType kType = LightType::kPoint;
  static constexpr const char* kName = "POINT";

  template <int W>
  static PRIMRAY_INLINE void sample_world(const LightRow<W>& row, vbool<W> m, const vvec3<W>& p, vfloat<W>, LightSample<W>& r) {
    const vvec3<W> to = row.vector(kOrigin) - p;
    const vfloat<W> d2 = dot(to, to), d = sqrt(d2);
    r.wi = select(m, to * (1.0f / d), r.wi);
    r.t = select(m, d, r.t);
    r.pdf = select(m, select(d2 > vfloat<W>(0.0f), vfloat<W>(1.0f), vfloat<W>(0.0f)), r.pdf);
    r.L = select(m, r.L * (1.0f / d2), r.L);
    r.is_delta |= m;
  }
  template <int W>
  static PRIMRAY_INLINE vfloat<W> importance(const float*, const vvec3<W>&, vfloat<W> d2, vfloat<W> power) {
    return power / d2;
  }
  static double emission_scale(const double (&)[2], const double (&)[2], double scale) { return scale * scale; }
  static void place(daffine& m) { m.x = {1, 0, 0}, m.y = {0, 1, 0}, m.z = {0, 0, 1}; }
};

}  // namespace primray
