// Cylinder light along x, radius r, |x| <= h, emitting outwards from its lateral area, without caps: sampled by solid angle.
//
// With theta the angle around the cylinder's direction as seen from the point, from the axis, and beta the elevation above the
// plane across it, the solid angle is d theta d sin(beta). Theta is chosen uniformly over the angle that the cylinder subtends,
// then sin(beta) uniformly between the ends of the line hit at theta. The density only varies with that line's solid angle over
// theta: not at all for a cylinder that is far, or long.
#pragma once

#include "light/types/light_type.hpp"

namespace primray {

// Line of the cylinder at a distance from the point, across the axis: the sine of its farther end's elevation, as the
// complement to 1, and the difference of the sines of both ends, both without cancellation.
template <int W>
struct CylinderLine {
  vfloat<W> distance, farther, nearer;  // farther, nearer: along the axis from the point, positive towards the farther end
  vfloat<W> missing, difference;
  vbool<W> forwards;  // the farther end is at +h

  PRIMRAY_INLINE CylinderLine(vfloat<W> px, vfloat<W> h, vfloat<W> across) : distance(across), forwards(px < vfloat<W>(0.0f)) {
    farther = h + abs(px);
    nearer = abs(px) - h;
    const vfloat<W> distance2 = distance * distance, to_farther = sqrt(distance2 + farther * farther);
    const vfloat<W> to_nearer = sqrt(distance2 + nearer * nearer);
    missing = distance2 / (to_farther * (to_farther + farther));
    // For sines a / A and b / B, with a^2 B^2 - b^2 A^2 = distance^2 (a^2 - b^2), and a - b = 2 h.
    const vfloat<W> cross = farther * to_nearer, other = nearer * to_farther;
    const vfloat<W> beyond = distance2 * (2.0f * h) * (farther + nearer) / (cross + other);
    difference = select(nearer > vfloat<W>(0.0f), beyond, cross - other) / (to_farther * to_nearer);
  }
  // Sampled coordinate along the axis from the point, towards +x.
  PRIMRAY_INLINE vfloat<W> along(vfloat<W> v) const {
    const vfloat<W> below = missing + v * difference;  // 1 - sin(beta)
    const vfloat<W> x = distance * (1.0f - below) / sqrt(max(below * (2.0f - below), 1e-30f));
    const vfloat<W> kept = max(min(x, farther), nearer);
    return select(forwards, kept, -kept);
  }
};

// Samples the cylinder from p. `outside`: rho^2 - r^2, where rho is the distance from the axis.
template <int W>
PRIMRAY_INLINE LocalSample<W> cylinder_sample(const vvec3<W>& p, vfloat<W> r, vfloat<W> h, vfloat<W> outside, vfloat<W> u,
                                              vfloat<W> v) {
  const vfloat<W> rho = sqrt(p.y * p.y + p.z * p.z);
  const vfloat<W> theta_max = atan2(r, safe_sqrt(outside));
  const SinCos<W> theta = sincos_turns((2.0f * u - 1.0f) * theta_max * (0.5f * kInvPi));
  // Half the chord across the cylinder: r^2 - rho^2 sin^2, computed from `outside`.
  const vfloat<W> chord = safe_sqrt(r * r * theta.cos * theta.cos - outside * theta.sin * theta.sin);
  const vfloat<W> distance = outside / (rho * theta.cos + chord);
  const CylinderLine<W> line(p.x, h, distance);
  // Offset towards the axis and across, then rotated from the point's meridian to the light's frame.
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

struct CylinderLight : LightTypeDefaults {
  static constexpr LightType kType = LightType::kCylinder;
  static constexpr const char* kName = "CYLINDER";
  static constexpr float kAxial = 0;  // weight of its axis in LightRow::outside()

  template <int W>
  static PRIMRAY_INLINE LocalSample<W> sample(const LightRow<W>& row, const vvec3<W>& p, const vvec3<W>& local, vfloat<W> u,
                                              vfloat<W> v) {
    const vfloat<W> r = row(kSize0);
    return cylinder_sample(local, r, row(kSize1), row.outside(p, r, kAxial), u, v);
  }
  template <int W>
  static PRIMRAY_INLINE LocalHit<W> hit(const LightRow<W>& row, const vvec3<W>& p, const vvec3<W>& local, const vvec3<W>& w) {
    const vfloat<W> r = row(kSize0);
    return cylinder_hit(local, w, r, row(kSize1), row.outside(p, r, kAxial));
  }
  template <int W>
  static PRIMRAY_INLINE vfloat<W> importance(const float* row, const vvec3<W>& to, vfloat<W> d2, vfloat<W> power) {
    const LightRow<W> r(row);
    const vfloat<W> x = abs(r.vector(kInverseX).x * to.x + r.vector(kInverseY).x * to.y + r.vector(kInverseZ).x * to.z);
    const vfloat<W> beyond = max(x - row[kSize1], 0.0f);
    const vfloat<W> near2 = max(d2 - x * x, row[kSize0] * row[kSize0]) + beyond * beyond;
    return power * min(4 * row[kSize0] * row[kSize1] / near2, kPi);
  }
  static double half_extent(const float* row, int axis) {
    const AxisParts a(row, axis);
    return double(row[kSize1]) * a.x + double(row[kSize0]) * std::sqrt(a.y * a.y + a.z * a.z);
  }
  static double bounding_radius(const float* row) {
    const AxisLengths a(row);
    const double s0 = row[kSize0], s1 = row[kSize1];
    return int_at(row, kLightFlags) & kSheared ? s1 * a.x + s0 * std::hypot(a.y, a.z) : std::hypot(s0, s1);
  }
  static TreeBounds tree_bounds(const float* row, LightBounds& b) {
    const double s0 = row[kSize0], s1 = row[kSize1];
    b.exact = true;
    return {4 * s0 * s1, s0 * s0 + s1 * s1 / 3};
  }
  static bool is_round(const daffine& m) { return is_orthogonal(m) && is_as_long(m.y, m.z); }
  static void sizes(const LightSize& light, const dvec3& axes, double scale, double (&size)[2]) {
    size[0] = light.radius * axes.y * scale, size[1] = 0.5 * light.length * axes.x * scale;
  }
  // Outline: its ends, and its sides as lines where the camera sees the middle of the cylinder end.
  template <class Camera>
  static void outline(const float* row, Camera& camera) {
    const dvec3 x = light_vector(row, kAxisX), y = light_vector(row, kAxisY), z = light_vector(row, kAxisZ);
    const dvec3 o = light_vector(row, kOrigin);
    const double s0 = row[kSize0];
    const dvec3 side = normalize(cross(x, camera.eye() - o)) * s0, half = x * double(row[kSize1]);
    camera.circle(o - half, y * s0, z * s0), camera.circle(o + half, y * s0, z * s0);
    camera.line(o - half - side, o + half - side), camera.line(o - half + side, o + half + side);
  }
};

}  // namespace primray
