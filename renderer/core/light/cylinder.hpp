// A cylinder along x, radius r, |x| <= h, emitting outwards from its lateral area, without caps: sampled by solid angle.
//
// With theta the angle around the cylinder's direction as seen from the point, from the axis, and beta the elevation above the
// plane across it, the solid angle is d theta d sin(beta). Theta is chosen evenly over the angle in which the cylinder is seen,
// then sin(beta) evenly between the ends of the line that is met at theta. The density is even but for how that line's solid
// angle changes with theta: not at all for a cylinder that is far, or long.
#pragma once

#include "light/shape/local_shape.hpp"

namespace primray {

// The line of the cylinder at a distance from the point, across the axis: the sine of the elevation of its farther end, as
// what is missing to 1, and the difference between those of its ends, both without cancellation.
template <int W>
struct CylinderLine {
  vfloat<W> distance, farther, nearer;  // farther, nearer: along the axis from the point, positive towards the farther end
  vfloat<W> missing, difference;
  vbool<W> forwards;  // farther is the end at +h

  PRIMRAY_INLINE CylinderLine(vfloat<W> px, vfloat<W> h, vfloat<W> across) : distance(across), forwards(px < vfloat<W>(0.0f)) {
    farther = h + abs(px);
    nearer = abs(px) - h;
    const vfloat<W> distance2 = distance * distance, to_farther = sqrt(distance2 + farther * farther);
    const vfloat<W> to_nearer = sqrt(distance2 + nearer * nearer);
    missing = distance2 / (to_farther * (to_farther + farther));
    // Of sines a / A and b / B, with a^2 B^2 - b^2 A^2 = distance^2 (a^2 - b^2), and a - b = 2 h.
    const vfloat<W> cross = farther * to_nearer, other = nearer * to_farther;
    const vfloat<W> beyond = distance2 * (2.0f * h) * (farther + nearer) / (cross + other);
    difference = select(nearer > vfloat<W>(0.0f), beyond, cross - other) / (to_farther * to_nearer);
  }
  // Along the axis from the point, towards +x.
  PRIMRAY_INLINE vfloat<W> along(vfloat<W> v) const {
    const vfloat<W> below = missing + v * difference;  // 1 - sin(beta)
    const vfloat<W> x = distance * (1.0f - below) / sqrt(max(below * (2.0f - below), 1e-30f));
    const vfloat<W> kept = max(min(x, farther), nearer);
    return select(forwards, kept, -kept);
  }
};

// `outside`: rho^2 - r^2, where rho is the distance from the axis.
template <int W>
PRIMRAY_INLINE LocalSample<W> cylinder_sample(const vvec3<W>& p, vfloat<W> r, vfloat<W> h, vfloat<W> outside, vfloat<W> u,
                                              vfloat<W> v) {
  const vfloat<W> rho = sqrt(p.y * p.y + p.z * p.z);
  const vfloat<W> theta_max = atan2(r, safe_sqrt(outside));
  const SinCos<W> theta = sincos_turns((2.0f * u - 1.0f) * theta_max * (0.5f * kInvPi));
  // Half the chord across the cylinder: r^2 - rho^2 sin^2, by what is outside.
  const vfloat<W> chord = safe_sqrt(r * r * theta.cos * theta.cos - outside * theta.sin * theta.sin);
  const vfloat<W> distance = outside / (rho * theta.cos + chord);
  const CylinderLine<W> line(p.x, h, distance);
  // Towards the axis and across, then turned from the point's meridian to the light's frame.
  const vfloat<W> inwards = distance * theta.cos, across = distance * theta.sin, cy = p.y / rho, cz = p.z / rho;
  const vvec3<W> to{line.along(v), -cy * inwards - cz * across, -cz * inwards + cy * across};
  const vfloat<W> d = length(to), pdf = 1.0f / (2.0f * theta_max * line.difference);
  const vbool<W> seen = (outside > vfloat<W>(0.0f)) & (pdf > vfloat<W>(0.0f)) & (pdf < vfloat<W>(kInfinity));
  return {to * (1.0f / d), d, select(seen, pdf, vfloat<W>(0.0f))};
}

template <int W>
PRIMRAY_INLINE LocalHit<W> cylinder_hit(const vvec3<W>& p, const vvec3<W>& w, vfloat<W> r, vfloat<W> h, vfloat<W> outside) {
  const vfloat<W> a = w.y * w.y + w.z * w.z, b = -(p.y * w.y + p.z * w.z);
  const vfloat<W> s = b / a, cy = p.y + w.y * s, cz = p.z + w.z * s;
  const vfloat<W> discriminant = a * (r * r - (cy * cy + cz * cz));
  const vfloat<W> t = outside / (b + safe_sqrt(discriminant));
  const vbool<W> hit =
      (outside > vfloat<W>(0.0f)) & (b > vfloat<W>(0.0f)) & (discriminant > vfloat<W>(0.0f)) & (abs(p.x + w.x * t) <= h);
  if (!any(hit)) return {vfloat<W>(kInfinity), vfloat<W>(0.0f)};
  const CylinderLine<W> line(p.x, h, t * sqrt(a));
  const vfloat<W> pdf = 1.0f / (2.0f * atan2(r, safe_sqrt(outside)) * line.difference);
  const vbool<W> ok = hit & (pdf > vfloat<W>(0.0f)) & (pdf < vfloat<W>(kInfinity));
  return {select(ok, t, vfloat<W>(kInfinity)), select(ok, pdf, vfloat<W>(0.0f))};
}

}  // namespace primray
