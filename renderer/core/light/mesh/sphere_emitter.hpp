// Emissive spheres of the scene, sampled as sphere lights (light/types/sphere.hpp), in lanes.
#pragma once

#include "light/mesh/moving_emitter.hpp"
#include "light/types/light_row.hpp"

namespace primray {

// Whether p is certainly outside a sphere light that is geometry: a point on its own surface, seen from inside, may be rounded
// to either side and must not sample the outside.
template <int W>
PRIMRAY_INLINE vbool<W> is_outside(const LightRow<W>& row, const vvec3<W>& p, const vvec3<W>& local) {
  const vvec3<W> stretch = abs(row.vector(kInverseX)) + abs(row.vector(kInverseY)) + abs(row.vector(kInverseZ));
  const vfloat<W> doubt = max_component(stretch) * max_component(abs(p)) * (2 * kOffsetUlps);
  return length(local) > row(kSize0) * 1.00001f + doubt;
}

// Ends the shadow rays of lanes `m`, whose light is a sphere of the scene, before that sphere. A ray that grazes it hits it at
// an uncertain distance: the end is on a larger sphere, by which the discriminant exceeds its rounding error (about 4e-7 d^2).
template <int W>
PRIMRAY_INLINE void end_before_sphere(const LightRow<W>& row, vbool<W> m, const vvec3<W>& p, LightSample<W>& s) {
  const vvec3<W> o = row.to_light(p - row.vector(kOrigin)), d = row.to_light(s.wi);
  const vfloat<W> radius = row(kSize0), d2 = dot(o, o), r2 = radius * radius;
  const vfloat<W> larger = r2 + max(r2 * 2e-4f, d2 * 8e-7f);
  const vfloat<W> a = dot(d, d), b = dot(o, d);
  const vfloat<W> t = (-b - safe_sqrt(b * b - a * (d2 - larger))) / a;
  s.t = select(m, max(min(t, s.t), 0.0f), s.t);
  s.pdf = select(m & !is_outside(row, p, o), vfloat<W>(0.0f), s.pdf);
}

// Density with which sampling a sphere of the scene from `from` chooses its point along unit d.
template <int W>
PRIMRAY_INLINE vfloat<W> sphere_row_pdf(const LightRow<W>& row, const vvec3<W>& from, const vvec3<W>& d) {
  const vvec3<W> local = row.to_light(from - row.vector(kOrigin));
  const vfloat<W> radius = row(kSize0), d2 = dot(local, local), len = length(row.to_light(d));
  const vbool<W> sheared = (row.flags() & vint<W>(kSheared)) != vint<W>(0);
  const vfloat<W> cone = 1.0f / (2.0f * kPi * sphere_one_minus_cos(d2, radius, row.outside(from, radius, 1.0f)));
  const vfloat<W> stretched = select(sheared, cone * row(kInverseDet) / (len * len * len), cone);
  return select(is_outside(row, from, local), stretched, vfloat<W>(0.0f));
}

// Writes the frame of a sphere light that is the image of the unit sphere. If that is degenerate, no point of it is sampled.
inline void put_sphere_frame(daffine m, float* row) {
  if (!is_regular(m)) m = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, m.o}, row[kInverseDet] = 0;
  // Scale that keeps lengths in the frame close to those of the world.
  const double size = std::sqrt(std::max({dot(m.x, m.x), dot(m.y, m.y), dot(m.z, m.z)})), smaller = 1 / size;
  m.x = m.x * smaller, m.y = m.y * smaller, m.z = m.z * smaller;
  const daffine inv = inverse(m);
  put(row, kAxisX, m.x), put(row, kAxisY, m.y), put(row, kAxisZ, m.z), put(row, kOrigin, m.o);
  put(row, kInverseX, inv.x), put(row, kInverseY, inv.y), put(row, kInverseZ, inv.z);
  if (row[kInverseDet] != 0) row[kInverseDet] = float(std::fabs(1 / m.determinant()));
  row[kSize0] = float(size);
  put_int(row, kLightFlags, int_at(row, kLightFlags) | kSheared);
  put_anchor(row, m, SphereLight::kAxial);
}

// Rows of the sphere lights in lanes `m`, at the rays' times.
template <int W>
struct SphereRowsNow {
  alignas(64) float rows[W * kLightFields];

  SphereRowsNow(const Scene& scene, vbool<W> m, vint<W> light, vfloat<W> time) {
    for (int i = 0; i < W; ++i) {
      float* row = rows + i * kLightFields;
      std::fill(row, row + kLightFields, 0.0f);
      if (!m[i]) continue;
      const float* own = scene.lights.row(light[i]);
      std::copy(own, own + kLightFields, row);
      if (int_at(own, kLightFlags) & kMoving) put_sphere_frame(emitter_pose(scene, light[i], time[i]), row);
    }
  }
  LightRow<W> row() const { return LightRow<W>::by_lane(rows); }
};

// Replaces the samples of lanes `m` by samples of the spheres as they are at the rays' times.
template <int W>
PRIMRAY_RARE void sample_passing_sphere(const Scene& scene, vbool<W> m, vint<W> light, const vvec3<W>& p, vfloat<W> u,
                                        vfloat<W> v, vfloat<W> time, LightSample<W>& s) {
  const SphereRowsNow<W> now(scene, m, light, time);
  const LightRow<W> row = now.row();
  const vbool<W> moving = m & ((row.flags() & vint<W>(kMoving)) != vint<W>(0));
  if (any(moving)) {
    LightSample<W> r;
    to_world(row, moving, SphereLight::sample(row, p, row.to_light(p - row.vector(kOrigin)), u, v), r);
    r.L = row.vector(kRadiance);
    if (scene.lights.has_shaping) r.L *= moving_shaping(scene, row, moving, light, r.wi, time);
    s.wi = select(moving, r.wi, s.wi), s.t = select(moving, r.t, s.t), s.L = select(moving, r.L, s.L);
    s.pdf = select(moving, r.pdf, s.pdf);
  }
  end_before_sphere(row, m, p, s);
}

// Completes the samples of lanes `m`, whose light is a sphere of the scene.
template <int W>
PRIMRAY_INLINE void sample_sphere(const Scene& scene, vbool<W> m, vint<W> light, const vvec3<W>& p, vfloat<W> u, vfloat<W> v,
                                  vfloat<W> time, LightSample<W>& s) {
  if (scene.emitters.any_moving()) return sample_passing_sphere(scene, m, light, p, u, v, time, s);
  end_before_sphere(LightRow<W>(scene.lights, select(m, light, vint<W>(light[__builtin_ctz(bits(m))]))), m, p, s);
}

template <int W>
PRIMRAY_RARE vfloat<W> passing_sphere_pdf(const Scene& scene, vbool<W> m, vint<W> light, const vvec3<W>& from,
                                          const vvec3<W>& d, vfloat<W> time) {
  const SphereRowsNow<W> now(scene, m, light, time);
  return sphere_row_pdf(now.row(), from, d);
}

// Density for the lanes' spheres with rows `row`, at the rays' times.
template <int W>
PRIMRAY_INLINE vfloat<W> sphere_pdf(const Scene& scene, vbool<W> m, const LightRow<W>& row, vint<W> light, const vvec3<W>& from,
                                    const vvec3<W>& d, vfloat<W> time) {
  if (scene.emitters.any_moving()) return passing_sphere_pdf(scene, m, light, from, d, time);
  return sphere_row_pdf(row, from, d);
}

}  // namespace primray
