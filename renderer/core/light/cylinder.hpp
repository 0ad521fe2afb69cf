// A cylinder along x, radius r, |x| <= h, emitting outwards from its lateral area, without caps.
//
// Around: uniform over the arc that the point can see. Along: equi-angular about the point for the chosen line, as Kulla and
// Fajardo 2012, "Importance Sampling Techniques for Path Tracing in Participating Media", section 4.1, do for a ray.
#pragma once

#include "light/local_shape.hpp"

namespace primray {

// The line of the cylinder at angle phi from the point's own: its distance from the point, and the angle between its ends as
// that of a difference, which a short line keeps.
template <int W>
struct CylinderLine {
  vfloat<W> distance, start, angle;  // start: of the line, from the point, along it

  // `gap`: rho - r. (rho - r)^2 + 2 rho r (1 - cos phi): no cancellation close to the surface.
  PRIMRAY_INLINE CylinderLine(vfloat<W> px, vfloat<W> rho, vfloat<W> gap, vfloat<W> r, vfloat<W> h, vfloat<W> one_minus_cos) {
    distance = sqrt(gap * gap + 2.0f * rho * r * one_minus_cos);
    start = -h - px;
    angle = atan2(2.0f * h * distance, distance * distance + start * (h - px));
  }
  // How far along the line from its start is what is seen at `part` of the angle: with a the angle to the start,
  // distance (tan(a + part) - tan a).
  PRIMRAY_INLINE vfloat<W> along(vfloat<W> part) const {
    const SinCos<W> a = sincos_turns(part * (0.5f * kInvPi));
    return a.sin * (distance * distance + start * start) / (distance * a.cos - start * a.sin);
  }
};

// `outside`: rho^2 - r^2, where rho is the distance from the axis.
template <int W>
PRIMRAY_INLINE LocalSample<W> cylinder_sample(const vvec3<W>& p, vfloat<W> r, vfloat<W> h, vfloat<W> outside, vfloat<W> u,
                                              vfloat<W> v) {
  const vfloat<W> rho = sqrt(p.y * p.y + p.z * p.z), gap = outside / (rho + r);
  const vfloat<W> phi_max = atan2(safe_sqrt(outside), r);
  // 1 - cos phi = 2 sin^2 (phi / 2).
  const SinCos<W> half = sincos_turns((2.0f * u - 1.0f) * phi_max * (0.25f * kInvPi));
  const vfloat<W> one_minus_cos = 2.0f * half.sin * half.sin, sin_phi = 2.0f * half.sin * half.cos;
  const CylinderLine<W> line(p.x, rho, gap, r, h, one_minus_cos);
  const vfloat<W> x = line.start + min(line.along(v * line.angle), 2.0f * h);
  // From the point: towards the axis, across, and along; then turned from the point's meridian to the light's frame.
  const vfloat<W> inwards = gap + r * one_minus_cos, across = r * sin_phi, cy = p.y / rho, cz = p.z / rho;
  const vvec3<W> to{x, -cy * inwards - cz * across, -cz * inwards + cy * across};
  const vfloat<W> d2 = dot(to, to), d = sqrt(d2);
  // The normal's cosine there: (rho cos phi - r) / d.
  const vfloat<W> cos_light = (gap - rho * one_minus_cos) / d;
  const vfloat<W> pdf = line.distance / (2.0f * phi_max * r * line.angle * cos_light);
  return {
      to * (1.0f / d), d,
      select((outside > vfloat<W>(0.0f)) & (cos_light > vfloat<W>(0.0f)) & (pdf < vfloat<W>(kInfinity)), pdf, vfloat<W>(0.0f))};
}

template <int W>
PRIMRAY_INLINE LocalHit<W> cylinder_hit(const vvec3<W>& p, const vvec3<W>& w, vfloat<W> r, vfloat<W> h, vfloat<W> outside) {
  const vfloat<W> rho = sqrt(p.y * p.y + p.z * p.z), gap = outside / (rho + r);
  const vfloat<W> a = w.y * w.y + w.z * w.z, b = -(p.y * w.y + p.z * w.z);
  const vfloat<W> s = b / a, cy = p.y + w.y * s, cz = p.z + w.z * s;
  const vfloat<W> discriminant = a * (r * r - (cy * cy + cz * cz));
  const vfloat<W> t = outside / (b + safe_sqrt(discriminant));
  const vbool<W> hit =
      (outside > vfloat<W>(0.0f)) & (b > vfloat<W>(0.0f)) & (discriminant > vfloat<W>(0.0f)) & (abs(p.x + w.x * t) <= h);
  if (!any(hit)) return {vfloat<W>(kInfinity), vfloat<W>(0.0f)};
  // The point met, from p's meridian: across it, then 1 - cos phi by the half-angle.
  const vfloat<W> across = (p.y * w.z - p.z * w.y) * t / (rho * r);
  const vfloat<W> cos_phi = safe_sqrt(1.0f - across * across), one_minus_cos = across * across / (1.0f + cos_phi);
  const CylinderLine<W> line(p.x, rho, gap, r, h, one_minus_cos);
  const vfloat<W> phi_max = atan2(safe_sqrt(outside), r);
  const vfloat<W> cos_light = (gap - rho * one_minus_cos) / t;
  const vfloat<W> pdf = line.distance / (2.0f * phi_max * r * line.angle * cos_light);
  const vbool<W> ok = hit & (cos_light > vfloat<W>(0.0f)) & (pdf < vfloat<W>(kInfinity));
  return {select(ok, t, vfloat<W>(kInfinity)), select(ok, pdf, vfloat<W>(0.0f))};
}

}  // namespace primray
