// Sampling of a triangle by solid angle where it is near.
//
// A point is uniform over the spherical triangle, divided as in Arvo 1995, "Stratified Sampling of Spherical Triangles": first
// a share of its area by an arc from one corner, then a point on that arc. The end of the arc is found from tangents of half
// angles: in the triangle (v0, v1, x) half of the area A' has the tangent det(v0, v1, x) / (1 + v0.v1 + (v0 + v1).x) (van
// Oosterom and Strackee 1983, "The Solid Angle of a Plane Triangle"), and with x on the arc from v0 to v2 that is linear in the
// tangent of half of x's angle from v0.
#pragma once

#include "base/flush_denormals.hpp"
#include "math/transcendental.hpp"
#include "math/vec3.hpp"

namespace primray {

template <int W>
struct SphericalTriangle {
  vvec3<W> v0, v1, v2;  // unit vectors towards the corners, det(v0, v1, v2) >= 0
  vfloat<W> solid_angle;

  SphericalTriangle() = default;
  PRIMRAY_INLINE SphericalTriangle(const vvec3<W>& a, const vvec3<W>& b, const vvec3<W>& c)
      : v0(direction_of(a)), v1(direction_of(b)), v2(direction_of(c)) {
    const vfloat<W> det = dot(cross(v0, v1), v2);
    const vbool<W> turned = det < vfloat<W>(0.0f);
    const vvec3<W> first = v1;
    v1 = select(turned, v2, v1), v2 = select(turned, first, v2);
    solid_angle = 2.0f * atan2(abs(det), 1.0f + dot(v0, v1) + dot(v1, v2) + dot(v2, v0));
  }

  PRIMRAY_INLINE vvec3<W> sample(vfloat<W> u, vfloat<W> v) const {
    const SinCos<W> half = sincos_turns(u * solid_angle * (0.25f * kInvPi));
    const vvec3<W> t = direction_of(v2 - v0 * dot(v0, v2));
    const vfloat<W> p = half.cos * dot(cross(v0, v1), t) - half.sin * dot(v1, t), q = half.sin * (1.0f + dot(v0, v1));
    const vfloat<W> p2 = p * p, q2 = q * q, inverse = 1.0f / max(p2 + q2, kLeastNormal);
    const vvec3<W> x = v0 * ((p2 - q2) * inverse) + t * (2.0f * p * q * inverse);
    const vvec3<W> across = x - v1;
    const vfloat<W> down = v * 0.5f * dot(across, across);  // 1 - cosine of the angle from v1
    return v1 * (1.0f - down) + direction_of(x - v1 * dot(x, v1)) * safe_sqrt(down * (2.0f - down));
  }
};

// Whether the triangle with edges e1, e2 from `a` is so far that sampling its area does as well: its centroid is more than
// twice as far as its farthest corner is from the centroid.
template <int W>
PRIMRAY_INLINE vbool<W> triangle_is_far(const vvec3<W>& a, const vvec3<W>& e1, const vvec3<W>& e2) {
  const vvec3<W> half = (e1 + e2) * (1.0f / 3), middle = a + half, b = e1 - half, c = e2 - half;
  return dot(middle, middle) > 4.0f * max(dot(half, half), max(dot(b, b), dot(c, c)));
}

// Smallest solid angle sampled: below, it would be off by more than 1e-4 of itself, as a difference of numbers near 1.
constexpr float kSmallTriangle = 0.005f;

// Barycentrics of e1 and e2: Heitz 2019, "A Low-Distortion Map Between Triangle and Square".
template <int W>
PRIMRAY_INLINE void triangle_by_area(vfloat<W> u, vfloat<W> v, vfloat<W>& b1, vfloat<W>& b2) {
  const vbool<W> upper = v > u;
  b1 = select(upper, u * 0.5f, u - v * 0.5f), b2 = select(upper, v - u * 0.5f, v * 0.5f);
}

// Intersection of the ray along `w` from the origin with the plane of that triangle, in barycentrics clamped to it.
template <int W>
PRIMRAY_INLINE void triangle_along(const vvec3<W>& w, const vvec3<W>& a, const vvec3<W>& e1, const vvec3<W>& e2, vfloat<W>& b1,
                                   vfloat<W>& b2) {
  const vfloat<W> along = dot(w, cross(e1, e2)), inverse = 1.0f / select(along == vfloat<W>(0.0f), vfloat<W>(1.0f), along);
  b1 = clamp(dot(w, cross(e2, a)) * inverse, 0.0f, 1.0f), b2 = clamp(dot(w, cross(a, e1)) * inverse, 0.0f, 1.0f);
  const vfloat<W> within = 1.0f / max(b1 + b2, 1.0f);
  b1 *= within, b2 *= within;
}

}  // namespace primray
