// A disc of radius r in its plane z = 0, emitting along -z.
//
// Far: by area, concentric map. Near: by the solid angle of the square around it; a direction that misses the disc carries
// nothing (Gamito 2016, "Solid Angle Sampling of Disk and Cylinder Lights", rejects such directions; keeping them keeps the
// points' stratification).
#pragma once

#include "light/rect.hpp"

namespace primray {

// Uniform point of the unit disc that keeps strata together: Shirley and Chiu 1997, "A Low Distortion Map Between Disk and
// Square".
template <int W>
PRIMRAY_INLINE void concentric_disk(vfloat<W> u, vfloat<W> v, vfloat<W>& x, vfloat<W>& y) {
  const vfloat<W> a = 2.0f * u - 1.0f, b = 2.0f * v - 1.0f;
  const vbool<W> wide = abs(a) > abs(b);
  const vfloat<W> r = select(wide, a, b), other = select(wide, b, a);
  const vfloat<W> ratio = other / select(r == vfloat<W>(0.0f), vfloat<W>(1.0f), r);
  const SinCos<W> phi = sincos_turns(ratio * 0.125f);
  x = r * select(wide, phi.cos, phi.sin);
  y = r * select(wide, phi.sin, phi.cos);
}

template <int W>
PRIMRAY_INLINE LocalSample<W> disk_sample(const vvec3<W>& p, vfloat<W> r, vfloat<W> u, vfloat<W> v) {
  const vbool<W> front = p.z < vfloat<W>(0.0f);
  vbool<W> far = rect_is_far(p, r, r);
  vfloat<W> x, y;
  concentric_disk(u, v, x, y);
  vvec3<W> to{x * r - p.x, y * r - p.y, -p.z};
  vfloat<W> near_pdf(0.0f);
  if (any(front & !far)) {
    const SphericalRect<W> square(p, r, r);
    far |= square.solid_angle < vfloat<W>(kSliver);
    const vvec3<W> q = square.sample(u, v);
    const vfloat<W> dx = q.x + p.x, dy = q.y + p.y;
    to = select(far, to, vvec3<W>(q.x, q.y, -q.z));
    near_pdf = select(dx * dx + dy * dy <= r * r, 1.0f / square.solid_angle, vfloat<W>(0.0f));
  }
  const vfloat<W> d2 = dot(to, to), d = sqrt(d2);
  const vfloat<W> pdf = select(far, d2 * d / (kPi * r * r * -p.z), near_pdf);
  return {to * (1.0f / d), d, select(front & (pdf > vfloat<W>(0.0f)), pdf, vfloat<W>(0.0f))};
}

template <int W>
PRIMRAY_INLINE LocalHit<W> disk_hit(const vvec3<W>& p, const vvec3<W>& w, vfloat<W> r) {
  const vfloat<W> t = -p.z / w.z, x = p.x + w.x * t, y = p.y + w.y * t;
  const vbool<W> hit = (p.z < vfloat<W>(0.0f)) & (w.z > vfloat<W>(0.0f)) & (x * x + y * y <= r * r);
  if (!any(hit)) return {vfloat<W>(kInfinity), vfloat<W>(0.0f)};
  const vbool<W> far = rect_is_far(p, r, r);
  vfloat<W> pdf = t * t / (kPi * r * r * w.z);
  if (any(hit & !far)) {
    const vfloat<W> solid_angle = SphericalRect<W>(p, r, r).solid_angle;
    pdf = select(far | (solid_angle < vfloat<W>(kSliver)), pdf, 1.0f / solid_angle);
  }
  return {select(hit, t, vfloat<W>(kInfinity)), select(hit, pdf, vfloat<W>(0.0f))};
}

}  // namespace primray
