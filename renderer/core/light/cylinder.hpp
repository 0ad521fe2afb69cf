// A cylinder along x, radius r, |x| <= h, emitting outwards from its lateral area, without caps.
//
// Around: uniform over the arc that the point can see. Along: equi-angular about the point for the chosen line, as Kulla and
// Fajardo 2012, "Importance Sampling Techniques for Path Tracing in Participating Media", section 4.1, do for a ray.
#pragma once

#include "light/local_shape.hpp"

namespace primray {

// The line of the cylinder at angle phi from the point's own: its distance from the point and the angles to its ends.
template <int W>
struct CylinderLine {
  vfloat<W> distance, a0, a1;

  PRIMRAY_INLINE CylinderLine(vfloat<W> px, vfloat<W> rho, vfloat<W> r, vfloat<W> h, vfloat<W> cos_phi) {
    // (rho - r)^2 + 2 rho r (1 - cos phi): no cancellation close to the surface.
    const vfloat<W> gap = rho - r;
    distance = sqrt(gap * gap + 2.0f * rho * r * (1.0f - cos_phi));
    a0 = atan2(-h - px, distance);
    a1 = atan2(h - px, distance);
  }
};

template <int W>
PRIMRAY_INLINE LocalSample<W> cylinder_sample(const vvec3<W>& p, vfloat<W> r, vfloat<W> h, vfloat<W> u, vfloat<W> v) {
  const vfloat<W> rho = sqrt(p.y * p.y + p.z * p.z);
  const vbool<W> outside = rho > r;
  const vfloat<W> phi_max = acos(r / max(rho, 1e-30f));
  const SinCos<W> phi = sincos_turns((2.0f * u - 1.0f) * phi_max * (0.5f * kInvPi));
  const CylinderLine<W> line(p.x, rho, r, h, phi.cos);
  const SinCos<W> a = sincos_turns((line.a0 + v * (line.a1 - line.a0)) * (0.5f * kInvPi));
  const vfloat<W> x = min(max(p.x + line.distance * (a.sin / a.cos), -h), h);
  // Turn back from the point's meridian to the light's frame.
  const vfloat<W> cy = p.y / rho, cz = p.z / rho;
  const vfloat<W> ny = cy * phi.cos - cz * phi.sin, nz = cz * phi.cos + cy * phi.sin;
  const vvec3<W> to{x - p.x, ny * r - p.y, nz * r - p.z};
  const vfloat<W> d2 = dot(to, to), d = sqrt(d2);
  const vfloat<W> cos_light = (rho * phi.cos - r) / d;
  const vfloat<W> pdf = line.distance / (2.0f * phi_max * r * (line.a1 - line.a0) * cos_light);
  return {to * (1.0f / d), d,
          select(outside & (cos_light > vfloat<W>(0.0f)) & (pdf < vfloat<W>(kInfinity)), pdf, vfloat<W>(0.0f))};
}

template <int W>
PRIMRAY_INLINE LocalHit<W> cylinder_hit(const vvec3<W>& p, const vvec3<W>& w, vfloat<W> r, vfloat<W> h) {
  const vfloat<W> rho2 = p.y * p.y + p.z * p.z, rho = sqrt(rho2);
  const vfloat<W> a = w.y * w.y + w.z * w.z, b = -(p.y * w.y + p.z * w.z);
  const vfloat<W> s = b / a, cy = p.y + w.y * s, cz = p.z + w.z * s;
  const vfloat<W> discriminant = a * (r * r - (cy * cy + cz * cz));
  const vfloat<W> t = (rho2 - r * r) / (b + safe_sqrt(discriminant));
  const vbool<W> hit = (rho > r) & (b > vfloat<W>(0.0f)) & (discriminant > vfloat<W>(0.0f)) & (abs(p.x + w.x * t) <= h);
  if (!any(hit)) return {vfloat<W>(kInfinity), vfloat<W>(0.0f)};
  const vfloat<W> ny = (p.y + w.y * t) / r, nz = (p.z + w.z * t) / r;
  const vfloat<W> cos_phi = min((p.y * ny + p.z * nz) / rho, 1.0f);
  const CylinderLine<W> line(p.x, rho, r, h, cos_phi);
  const vfloat<W> phi_max = acos(r / max(rho, 1e-30f));
  const vfloat<W> cos_light = (rho * cos_phi - r) / t;
  const vfloat<W> pdf = line.distance / (2.0f * phi_max * r * (line.a1 - line.a0) * cos_light);
  const vbool<W> ok = hit & (cos_light > vfloat<W>(0.0f)) & (pdf < vfloat<W>(kInfinity));
  return {select(ok, t, vfloat<W>(kInfinity)), select(ok, pdf, vfloat<W>(0.0f))};
}

}  // namespace primray
