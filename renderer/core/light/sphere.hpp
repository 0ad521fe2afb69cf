// A sphere of radius r about the origin, emitting outwards: sampled uniformly over the cone in which it is seen.
//
// Pharr, Jakob and Humphreys, Physically Based Rendering 4th ed., 6.2.4, with 1 - cos by sin^2 / (1 + cos) so that small
// and far spheres keep their digits.
#pragma once

#include "light/shape/local_shape.hpp"

namespace primray {

// 1 - cos of the half-angle under which the sphere is seen; `outside`: d2 - r^2.
template <int W>
PRIMRAY_INLINE vfloat<W> sphere_one_minus_cos(vfloat<W> d2, vfloat<W> r, vfloat<W> outside) {
  return r * r / d2 / (1.0f + safe_sqrt(outside / d2));
}

// Distance along unit w to the sphere's near side, infinite if missed; accurate for far spheres: Haines et al. 2019, "Precision
// Improvements for Ray/Sphere Intersection".
template <int W>
PRIMRAY_INLINE vfloat<W> sphere_distance(const vvec3<W>& p, const vvec3<W>& w, vfloat<W> r, vfloat<W> outside) {
  const vfloat<W> b = -dot(p, w);
  const vvec3<W> closest = p + w * b;
  const vfloat<W> discriminant = r * r - dot(closest, closest);
  const vfloat<W> q = b + safe_sqrt(discriminant);
  return select((discriminant >= vfloat<W>(0.0f)) & (b > vfloat<W>(0.0f)), outside / q, vfloat<W>(kInfinity));
}

template <int W>
PRIMRAY_INLINE LocalSample<W> sphere_sample(const vvec3<W>& p, vfloat<W> r, vfloat<W> outside, vfloat<W> u, vfloat<W> v) {
  const vfloat<W> d2 = dot(p, p), d = sqrt(d2);
  const vfloat<W> spread = sphere_one_minus_cos(d2, r, outside);
  const vfloat<W> one_minus_cos = u * spread;
  const vfloat<W> sin_theta = safe_sqrt(one_minus_cos * (2.0f - one_minus_cos)), cos_theta = 1.0f - one_minus_cos;
  const SinCos<W> phi = sincos_turns(v);
  const Frame<vfloat<W>> frame(p * (-1.0f / d));
  const vvec3<W> w = frame.to_world({sin_theta * phi.cos, sin_theta * phi.sin, cos_theta});
  const vfloat<W> chord = safe_sqrt(r * r - d2 * sin_theta * sin_theta);
  const vfloat<W> t = outside / (d * cos_theta + chord);
  return {w, t, select(outside > vfloat<W>(0.0f), 1.0f / (2.0f * kPi * spread), vfloat<W>(0.0f))};
}

template <int W>
PRIMRAY_INLINE LocalHit<W> sphere_hit(const vvec3<W>& p, const vvec3<W>& w, vfloat<W> r, vfloat<W> outside) {
  const vfloat<W> t = sphere_distance(p, w, r, outside);
  const vbool<W> hit = (outside > vfloat<W>(0.0f)) & (t < vfloat<W>(kInfinity));
  return {select(hit, t, vfloat<W>(kInfinity)),
          select(hit, 1.0f / (2.0f * kPi * sphere_one_minus_cos(dot(p, p), r, outside)), vfloat<W>(0.0f))};
}

}  // namespace primray
