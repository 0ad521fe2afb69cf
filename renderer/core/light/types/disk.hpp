// Disk light of radius r in its plane z = 0, emitting along -z: sampled by solid angle, if far away by area.
//
// From a point a disk is seen as the inside of an elliptic cone. In the equal-area map of the sphere about the cone's axis it
// is nearly the ellipse through the ends of its axes (exactly so for a circle): the angle about the axis is chosen as that of a
// point in the ellipse, and then the height uniformly. The density is uniform to 1 part in 50 all around, to 1 in 8 as seen
// from the disk's very rim, and no direction is lost. (Guillen et al. 2017, "Area-Preserving Parameterizations for Spherical
// Ellipses", is exact, with tabulated elliptic integrals; Gamito 2016, "Solid Angle Sampling of Disk and Cylinder Lights",
// rejects directions from a rectangle.)
#pragma once

#include "light/types/light_type.hpp"

namespace primray {

// Maps the square to the unit disk, preserving strata: Shirley and Chiu 1997, "A Low Distortion Map Between Disk and Square".
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

// Whether the disk is so far that uniform area sampling is nearly uniform in solid angle: relative variance 0.0003 straight
// below it, at most 0.07 in its plane, where it contributes little.
template <int W>
PRIMRAY_INLINE vbool<W> disk_is_far(const vvec3<W>& p, vfloat<W> r) {
  return dot(p, p) > 32.0f * r * r;
}

// Elliptic cone in which a disk is seen. With near and far the distances to the ends of the diameter in the plane of the point
// and the disk's axis, and d the distance to its centre: the cone's axis bisects the angle between the ends, the half angle in
// that plane has the tangent 2 r z / g, and the half angle across it the sine 2 r / (near + far), where g = near far + d^2 -
// r^2.
template <int W>
struct DiskCone {
  vfloat<W> z, farthest;              // depth of the point below the plane; and the greatest distance
  vfloat<W> towards_x, towards_y;     // unit vector in the plane, from the point to the disk's axis
  vfloat<W> axis_out, axis_up;        // cone axis: components along `towards`, and up
  vfloat<W> tan2_across, tan2_ratio;  // squared tangents of the half angles: across, and across over the other
  vfloat<W> map2_ratio;               // across over along in the equal-area map, squared

  PRIMRAY_INLINE DiskCone(const vvec3<W>& p, vfloat<W> r) : z(-p.z) {
    const vfloat<W> rho = sqrt(p.x * p.x + p.y * p.y);
    const vbool<W> off_axis = rho > vfloat<W>(0.0f);
    const vfloat<W> inverse = -1.0f / select(off_axis, rho, vfloat<W>(1.0f));
    towards_x = select(off_axis, p.x * inverse, vfloat<W>(1.0f));
    towards_y = select(off_axis, p.y * inverse, vfloat<W>(0.0f));
    const vfloat<W> gap = rho - r, span = rho + r, z2 = z * z;
    const vfloat<W> nearest = sqrt(gap * gap + z2);
    farthest = sqrt(span * span + z2);
    const vfloat<W> product = nearest * farthest, outside = gap * span + z2, size = 2.0f * r * z;
    const vfloat<W> g = select(outside > vfloat<W>(0.0f), product + outside, size * (size / (product - outside)));
    const vfloat<W> sum = nearest + farthest, out = rho * (2.0f * g / (sum * sum)), length = 1.0f / sqrt(out * out + z2);
    axis_out = out * length;
    axis_up = z * length;
    const vfloat<W> inverse_g = 1.0f / g, along_over_across = 2.0f * z2 * inverse_g;
    tan2_across = min(2.0f * r * r * inverse_g, 1e30f);
    tan2_ratio = 1.0f / max(along_over_across, 1e-30f);
    map2_ratio = tan2_ratio * (steepness(tan2_across * along_over_across) / steepness(tan2_across));
  }

  // tan^2 / (1 - cos).
  static PRIMRAY_INLINE vfloat<W> steepness(vfloat<W> tan2) {
    const vfloat<W> secant = sqrt(1.0f + tan2);
    return secant + secant * secant;
  }
  // 1 - cos of the half angle in the direction about the axis with these squared cosine and sine.
  PRIMRAY_INLINE vfloat<W> one_minus_cos(vfloat<W> cos2, vfloat<W> sin2) const {
    const vfloat<W> tan2 = tan2_across / (cos2 * tan2_ratio + sin2);
    return tan2 / steepness(tan2);
  }
  // Density per solid angle in that direction, whose one_minus_cos() is `height`.
  PRIMRAY_INLINE vfloat<W> pdf(vfloat<W> cos2, vfloat<W> sin2, vfloat<W> height) const {
    return sqrt(map2_ratio) / ((cos2 * map2_ratio + sin2) * (2.0f * kPi) * height);
  }
  // Sample for a point (x, y) of the unit disk.
  PRIMRAY_INLINE void sample(vfloat<W> x, vfloat<W> y, LocalSample<W>& s) const {
    const vfloat<W> across = y * sqrt(map2_ratio), flat2 = x * x + across * across;
    const vbool<W> aside = flat2 > vfloat<W>(0.0f);
    const vfloat<W> inverse = 1.0f / sqrt(select(aside, flat2, vfloat<W>(1.0f)));
    const vfloat<W> cos_phi = select(aside, x * inverse, vfloat<W>(1.0f)), sin_phi = across * inverse;
    const vfloat<W> cos2 = cos_phi * cos_phi, sin2 = sin_phi * sin_phi, edge = one_minus_cos(cos2, sin2);
    const vfloat<W> height = (x * x + y * y) * edge, sine = safe_sqrt(height * (2.0f - height));
    const vfloat<W> up = axis_up * (1.0f - height) - axis_out * sine * cos_phi;
    const vfloat<W> out = axis_out * (1.0f - height) + axis_up * sine * cos_phi, beside = sine * sin_phi;
    s.w = {towards_x * out - towards_y * beside, towards_y * out + towards_x * beside, up};
    s.t = select(up > vfloat<W>(0.0f), min(z / up, farthest), farthest);  // rounding must not lead beyond the far end
    s.pdf = pdf(cos2, sin2, edge);
  }
};

template <int W>
PRIMRAY_INLINE LocalSample<W> disk_sample(const vvec3<W>& p, vfloat<W> r, vfloat<W> u, vfloat<W> v) {
  const vbool<W> front = p.z < vfloat<W>(0.0f), far = disk_is_far(p, r);
  vfloat<W> x, y;
  concentric_disk(u, v, x, y);
  const vvec3<W> to{x * r - p.x, y * r - p.y, -p.z};
  const vfloat<W> d2 = dot(to, to), d = sqrt(d2);
  LocalSample<W> s{to * (1.0f / d), d, d2 * d / (kPi * r * r * -p.z)};
  if (any(front & !far)) {
    LocalSample<W> near;
    DiskCone<W>(p, r).sample(x, y, near);
    s = {select(far, s.w, near.w), select(far, s.t, near.t), select(far, s.pdf, near.pdf)};
  }
  s.pdf = select(front & (s.pdf > vfloat<W>(0.0f)) & (s.pdf < vfloat<W>(kInfinity)), s.pdf, vfloat<W>(0.0f));
  return s;
}

template <int W>
PRIMRAY_INLINE LocalHit<W> disk_hit(const vvec3<W>& p, const vvec3<W>& w, vfloat<W> r) {
  const vfloat<W> t = -p.z / w.z, x = p.x + w.x * t, y = p.y + w.y * t;
  const vbool<W> hit = (p.z < vfloat<W>(0.0f)) & (w.z > vfloat<W>(0.0f)) & (x * x + y * y <= r * r);
  if (!any(hit)) return {vfloat<W>(kInfinity), vfloat<W>(0.0f)};
  const vbool<W> far = disk_is_far(p, r);
  vfloat<W> pdf = t * t / (kPi * r * r * w.z);
  if (any(hit & !far)) {
    const DiskCone<W> cone(p, r);
    const vfloat<W> out = w.x * cone.towards_x + w.y * cone.towards_y;
    const vfloat<W> along = cone.axis_up * out - cone.axis_out * w.z, across = w.y * cone.towards_x - w.x * cone.towards_y;
    const vfloat<W> both = along * along + across * across;
    const vbool<W> aside = both > vfloat<W>(0.0f);
    const vfloat<W> inverse = 1.0f / select(aside, both, vfloat<W>(1.0f)), sin2 = across * across * inverse;
    const vfloat<W> cos2 = select(aside, along * along * inverse, vfloat<W>(1.0f));
    pdf = select(far, pdf, cone.pdf(cos2, sin2, cone.one_minus_cos(cos2, sin2)));
  }
  const vbool<W> ok = hit & (pdf < vfloat<W>(kInfinity));
  return {select(ok, t, vfloat<W>(kInfinity)), select(ok, pdf, vfloat<W>(0.0f))};
}

struct DiskLight : FlatLight {
  static constexpr LightType kType = LightType::kDisk;
  static constexpr const char* kName = "DISK";

  template <int W>
  static PRIMRAY_INLINE LocalSample<W> sample(const LightRow<W>& row, const vvec3<W>&, const vvec3<W>& local, vfloat<W> u,
                                              vfloat<W> v) {
    return disk_sample(local, row(kSize0), u, v);
  }
  template <int W>
  static PRIMRAY_INLINE LocalHit<W> hit(const LightRow<W>& row, const vvec3<W>&, const vvec3<W>& local, const vvec3<W>& w) {
    return disk_hit(local, w, row(kSize0));
  }
  template <int W>
  static PRIMRAY_INLINE vfloat<W> importance(const float* row, const vvec3<W>& to, vfloat<W> d2, vfloat<W> power) {
    return importance_of(row, kPi * row[kSize0] * row[kSize0], to, d2, power);
  }
  static double half_extent(const float* row, int axis) {
    const AxisParts a(row, axis);
    return row[kSize0] * std::sqrt(a.x * a.x + a.y * a.y);
  }
  static double bounding_radius(const float* row) {
    const AxisLengths a(row);
    const double r = row[kSize0];
    return int_at(row, kLightFlags) & kSheared ? r * std::hypot(a.x, a.y) : r;
  }
  static TreeBounds tree_bounds(const float* row, LightBounds& b) {
    const double r = row[kSize0];
    return spread_of(row, std::numbers::pi * r * r, b);
  }
  static bool is_round(const daffine& m) { return is_perpendicular(m.x, m.y) && is_as_long(m.x, m.y); }
  static void sizes(const LightSize& light, const dvec3& axes, double scale, double (&size)[2]) {
    size[0] = size[1] = light.radius * axes.x * scale;
  }
  template <class Camera>
  static void outline(const float* row, Camera& camera) {
    const double r = row[kSize0];
    camera.circle(light_vector(row, kOrigin), light_vector(row, kAxisX) * r, light_vector(row, kAxisY) * r);
  }
};

}  // namespace primray
