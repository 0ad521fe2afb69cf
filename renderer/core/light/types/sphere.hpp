// Sphere light of radius r about the origin, emitting outwards: sampled uniformly over the cone that it subtends.
//
// Pharr, Jakob and Humphreys, Physically Based Rendering 4th ed., 6.2.4, with 1 - cos as sin^2 / (1 + cos), which stays precise
// for small and distant spheres.
#pragma once

#include "light/types/light_type.hpp"

namespace primray {

// 1 - cos of the half-angle that the sphere subtends; `outside`: d2 - r^2.
template <int W>
PRIMRAY_INLINE vfloat<W> sphere_one_minus_cos(vfloat<W> d2, vfloat<W> r, vfloat<W> outside) {
  return r * r / d2 / (1.0f + safe_sqrt(outside / d2));
}

// Distance along unit w to the sphere's near side, infinite if missed; precise for distant spheres: Haines et al. 2019,
// "Precision Improvements for Ray/Sphere Intersection".
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

struct SphereLight : LightTypeDefaults {
  static constexpr LightType kType = LightType::kSphere;
  static constexpr const char* kName = "SPHERE";
  static constexpr float kAxial = 1;  // weight of its axis in LightRow::outside()

  template <int W>
  static PRIMRAY_INLINE LocalSample<W> sample(const LightRow<W>& row, const vvec3<W>& p, const vvec3<W>& local, vfloat<W> u,
                                              vfloat<W> v) {
    const vfloat<W> r = row(kSize0);
    return sphere_sample(local, r, row.outside(p, r, kAxial), u, v);
  }
  template <int W>
  static PRIMRAY_INLINE LocalHit<W> hit(const LightRow<W>& row, const vvec3<W>& p, const vvec3<W>& local, const vvec3<W>& w) {
    const vfloat<W> r = row(kSize0);
    return sphere_hit(local, w, r, row.outside(p, r, kAxial));
  }
  template <int W>
  static PRIMRAY_INLINE vfloat<W> importance(const float* row, const vvec3<W>&, vfloat<W> d2, vfloat<W> power) {
    return power * (kPi * row[kSize0] * row[kSize0]) / max(d2, row[kSize0] * row[kSize0]);
  }
  static double half_extent(const float* row, int axis) {
    const AxisParts a(row, axis);
    return row[kSize0] * std::sqrt(a.x * a.x + a.y * a.y + a.z * a.z);
  }
  static double bounding_radius(const float* row) {
    const AxisLengths a(row);
    const double r = row[kSize0];
    return int_at(row, kLightFlags) & kSheared ? r * std::hypot(a.x, a.y, a.z) : r;
  }
  static TreeBounds tree_bounds(const float* row, LightBounds&) {
    const double r = row[kSize0];
    return {std::numbers::pi * r * r, r * r};
  }
  static bool is_round(const daffine& m) { return is_orthogonal(m) && is_as_long(m.x, m.y) && is_as_long(m.y, m.z); }
  static void sizes(const LightSize& light, const dvec3& axes, double scale, double (&size)[2]) {
    size[0] = size[1] = light.radius * axes.x * scale;
  }
  // Outline; of a sheared sphere, that of a sphere of about the same size.
  template <class Camera>
  static void outline(const float* row, Camera& camera) {
    const dvec3 x = light_vector(row, kAxisX), y = light_vector(row, kAxisY), z = light_vector(row, kAxisZ);
    camera.sphere(light_vector(row, kOrigin), row[kSize0] * std::cbrt(std::fabs(dot(cross(x, y), z))));
  }
};

}  // namespace primray
