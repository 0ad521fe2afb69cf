// A disc of radius r in its plane z = 0, emitting along -z: sampled by solid angle.
//
// From a point a disc is seen as the inside of an elliptic cone. In the equal-area map of the sphere about the cone's axis it
// is nearly the ellipse through the ends of its axes (exactly so for a circle): the angle about the axis is chosen as of a
// point in that ellipse, and then the height uniformly. The density is even to 1 part in 50 all around, to 1 in 8 as seen from
// the disc's very rim, and no direction is lost. (Guillen et al. 2017, "Area-Preserving
// Parameterizations for Spherical Ellipses", is exact, by elliptic integrals in tables; Gamito 2016, "Solid Angle Sampling of
// Disk and Cylinder Lights", rejects directions from a rectangle.)
#pragma once

#include "light/local_shape.hpp"

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

// The cone in which a disc is seen. With near and far the distances of the ends of the diameter that lies in one plane with the
// point and the disc's axis, and d that of its middle: the cone's axis halves the angle between the ends, the half angle in
// that plane has the tangent 2 r z / g, the half angle across it the sine 2 r / (near + far), where g = near far + d^2 - r^2.
template <int W>
struct DiskCone {
  vfloat<W> z, rho, r;                // of the point: below the plane, and from the axis
  vfloat<W> farthest;                 // distance
  vfloat<W> towards_x, towards_y;     // unit, in the plane: from the point to the axis
  vfloat<W> axis_out, axis_up;        // the cone's axis: along towards, and up
  vfloat<W> tan2_across, tan2_ratio;  // squared tangents of the half angles: of that across, and it over the other
  vfloat<W> map_ratio;                // across over along in the map of equal area

  PRIMRAY_INLINE DiskCone(const vvec3<W>& p, vfloat<W> radius) : z(-p.z), r(radius) {
    rho = sqrt(p.x * p.x + p.y * p.y);
    const vbool<W> off_axis = rho > vfloat<W>(0.0f);
    const vfloat<W> inverse = -1.0f / select(off_axis, rho, vfloat<W>(1.0f));
    towards_x = select(off_axis, p.x * inverse, vfloat<W>(1.0f));
    towards_y = select(off_axis, p.y * inverse, vfloat<W>(0.0f));
    const vfloat<W> gap = rho - r, span = rho + r, z2 = z * z;
    const vfloat<W> nearest = sqrt(gap * gap + z2);
    farthest = sqrt(span * span + z2);
    const vfloat<W> product = nearest * farthest, outside = gap * span + z2, size = 2.0f * r * z;
    const vfloat<W> g = select(outside > vfloat<W>(0.0f), product + outside, size * (size / (product - outside)));
    const vfloat<W> sum = nearest + farthest, cos2_across = 2.0f * g / (sum * sum);
    const vfloat<W> out = rho * cos2_across, length = 1.0f / sqrt(out * out + z2);
    axis_out = out * length;
    axis_up = z * length;
    const vfloat<W> tan_along = size / g;
    tan2_across = min(2.0f * r * r / g, 1e30f);
    tan2_ratio = min(0.5f * g / z2, 1e30f);  // by squares of tangents it would be lost for the smallest discs
    map_ratio = sqrt(tan2_ratio * stretch2(tan2_across) / stretch2(min(tan_along * tan_along, 1e30f)));
  }

  // 2 (1 - cos) / tan^2: from the tangent plane to the map of equal area.
  static PRIMRAY_INLINE vfloat<W> stretch2(vfloat<W> tan2) {
    const vfloat<W> secant = sqrt(1.0f + tan2);
    return 2.0f / (secant * (1.0f + secant));
  }
  // 1 - cos of the half angle in the direction whose squared cosine and sine about the axis are given.
  PRIMRAY_INLINE vfloat<W> one_minus_cos(vfloat<W> cos2, vfloat<W> sin2) const {
    const vfloat<W> tan2 = tan2_across / (cos2 * tan2_ratio + sin2);
    return 0.5f * tan2 * stretch2(tan2);
  }
  // Density per solid angle in that direction, whose one_minus_cos is `height`.
  PRIMRAY_INLINE vfloat<W> pdf(vfloat<W> cos2, vfloat<W> sin2, vfloat<W> height) const {
    return map_ratio / ((cos2 * map_ratio * map_ratio + sin2) * (2.0f * kPi) * height);
  }
};

template <int W>
PRIMRAY_INLINE LocalSample<W> disk_sample(const vvec3<W>& p, vfloat<W> r, vfloat<W> u, vfloat<W> v) {
  const vbool<W> front = p.z < vfloat<W>(0.0f);
  const DiskCone<W> cone(p, r);
  vfloat<W> x, y;
  concentric_disk(u, v, x, y);
  const vfloat<W> across = y * cone.map_ratio, flat2 = x * x + across * across;
  const vbool<W> aside = flat2 > vfloat<W>(0.0f);
  const vfloat<W> inverse = 1.0f / sqrt(select(aside, flat2, vfloat<W>(1.0f)));
  const vfloat<W> cos_phi = select(aside, x * inverse, vfloat<W>(1.0f)), sin_phi = across * inverse;
  const vfloat<W> cos2 = cos_phi * cos_phi, sin2 = sin_phi * sin_phi, edge = cone.one_minus_cos(cos2, sin2);
  const vfloat<W> height = (x * x + y * y) * edge, sine = safe_sqrt(height * (2.0f - height));
  // Where that meets the plane, along `towards` and across it; rounding leads neither beyond the far end nor out of the disc.
  const vfloat<W> up = cone.axis_up * (1.0f - height) - cone.axis_out * sine * cos_phi;
  const vfloat<W> out = cone.axis_out * (1.0f - height) + cone.axis_up * sine * cos_phi;
  const vfloat<W> distance = cone.z / max(up, cone.z / cone.farthest);
  const vfloat<W> from_center = out * distance - cone.rho, beside = sine * sin_phi * distance;
  const vfloat<W> shrink = min(r / sqrt(from_center * from_center + beside * beside), 1.0f);
  const vfloat<W> a = cone.rho + from_center * shrink, b = beside * shrink;
  const vvec3<W> to{cone.towards_x * a - cone.towards_y * b, cone.towards_y * a + cone.towards_x * b, cone.z};
  const vfloat<W> d = length(to), pdf = cone.pdf(cos2, sin2, edge);
  return {to * (1.0f / d), d, select(front & (pdf > vfloat<W>(0.0f)) & (pdf < vfloat<W>(kInfinity)), pdf, vfloat<W>(0.0f))};
}

template <int W>
PRIMRAY_INLINE LocalHit<W> disk_hit(const vvec3<W>& p, const vvec3<W>& w, vfloat<W> r) {
  const vfloat<W> t = -p.z / w.z, x = p.x + w.x * t, y = p.y + w.y * t;
  const vbool<W> hit = (p.z < vfloat<W>(0.0f)) & (w.z > vfloat<W>(0.0f)) & (x * x + y * y <= r * r);
  if (!any(hit)) return {vfloat<W>(kInfinity), vfloat<W>(0.0f)};
  const DiskCone<W> cone(p, r);
  const vfloat<W> out = w.x * cone.towards_x + w.y * cone.towards_y;
  const vfloat<W> along = cone.axis_up * out - cone.axis_out * w.z, across = w.y * cone.towards_x - w.x * cone.towards_y;
  const vfloat<W> both = along * along + across * across;
  const vbool<W> aside = both > vfloat<W>(0.0f);
  const vfloat<W> inverse = 1.0f / select(aside, both, vfloat<W>(1.0f)), sin2 = across * across * inverse;
  const vfloat<W> cos2 = select(aside, along * along * inverse, vfloat<W>(1.0f));
  const vfloat<W> pdf = cone.pdf(cos2, sin2, cone.one_minus_cos(cos2, sin2));
  const vbool<W> ok = hit & (pdf < vfloat<W>(kInfinity));
  return {select(ok, t, vfloat<W>(kInfinity)), select(ok, pdf, vfloat<W>(0.0f))};
}

}  // namespace primray
