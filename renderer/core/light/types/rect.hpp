// Rectangle light in its plane z = 0, |x| <= hx, |y| <= hy, emitting along -z: sampled by solid angle where it is near.
//
// Near: the spherical rectangle of Urena, Fajardo and King 2013, "An Area-Preserving Parametrization for Spherical Rectangles".
// Far (its half-diagonal is less than half of the distance): by area, which has nearly the same variance. Near, but seen
// edge-on so that the solid angle would be imprecise: light/shape/sliver.hpp.
#pragma once

#include "light/shape/sliver.hpp"
#include "light/types/light_type.hpp"

namespace primray {

template <int W>
struct SphericalRect {
  vfloat<W> x0, x1, y0, y1, z0;  // corners relative to the point, z0 < 0
  vfloat<W> b0, b1, k, solid_angle;

  // Solid angle as a sum of arc sines, which stays precise for a small rectangle straight ahead.
  PRIMRAY_INLINE SphericalRect(const vvec3<W>& p, vfloat<W> hx, vfloat<W> hy)
      : x0(-hx - p.x), x1(hx - p.x), y0(-hy - p.y), y1(hy - p.y), z0(p.z) {
    const vfloat<W> z2 = z0 * z0;
    const vfloat<W> n0 = -y0 / sqrt(y0 * y0 + z2), n1 = x1 / sqrt(x1 * x1 + z2);
    const vfloat<W> n2 = y1 / sqrt(y1 * y1 + z2), n3 = -x0 / sqrt(x0 * x0 + z2);
    const vfloat<W> a0 = 0.5f * kPi - acos(n0 * n1), a1 = 0.5f * kPi - acos(n1 * n2);
    const vfloat<W> a2 = 0.5f * kPi - acos(n2 * n3), a3 = 0.5f * kPi - acos(n3 * n0);
    b0 = n0, b1 = n2;
    k = kPi - a2 - a3;
    solid_angle = a0 + a1 + a2 + a3;
  }

  PRIMRAY_INLINE vvec3<W> sample(vfloat<W> u, vfloat<W> v) const {
    const vfloat<W> au = u * solid_angle + k;
    const SinCos<W> a = sincos_turns(au * (0.5f * kInvPi));
    const vfloat<W> fu = (a.cos * b0 - b1) / a.sin;
    const vfloat<W> cu = clamp(copysign(1.0f / sqrt(fu * fu + b0 * b0), fu), -0.999999f, 0.999999f);
    const vfloat<W> xu = min(max(-(cu * z0) / sqrt(1.0f - cu * cu), x0), x1);
    const vfloat<W> d2 = xu * xu + z0 * z0;
    const vfloat<W> h0 = y0 / sqrt(d2 + y0 * y0), h1 = y1 / sqrt(d2 + y1 * y1);
    const vfloat<W> hv = h0 + v * (h1 - h0), hv2 = hv * hv;
    const vfloat<W> yv = select(hv2 < vfloat<W>(0.999999f), hv * sqrt(d2 / max(1.0f - hv2, 1e-7f)), y1);
    return {xu, min(max(yv, y0), y1), z0};
  }
};

// The arc sines leave an error of 2e-6 in the solid angle: that of a smaller sliver would be off by more than 1e-4.
constexpr float kSliver = 0.02f;

template <int W>
PRIMRAY_INLINE vbool<W> rect_is_far(const vvec3<W>& p, vfloat<W> hx, vfloat<W> hy) {
  return dot(p, p) > 4.0f * (hx * hx + hy * hy);
}

// Density of rect_sample() towards the point at `to`, seen from p, which is in front; `by_area` if it is sampled by area.
template <int W>
PRIMRAY_INLINE vfloat<W> near_rect_pdf(const vvec3<W>& p, vfloat<W> hx, vfloat<W> hy, const vvec3<W>& to, vbool<W> far,
                                       vfloat<W> by_area) {
  const vfloat<W> solid_angle = SphericalRect<W>(p, hx, hy).solid_angle;
  const vbool<W> thin = solid_angle < vfloat<W>(kSliver);
  vfloat<W> pdf = select(far, by_area, 1.0f / solid_angle);
  if (any(thin & !far)) pdf = select(thin & !far, Sliver<W>(p, hx, hy).pdf(to), pdf);
  return pdf;
}

template <int W>
PRIMRAY_INLINE LocalSample<W> rect_sample(const vvec3<W>& p, vfloat<W> hx, vfloat<W> hy, vfloat<W> u, vfloat<W> v) {
  const vbool<W> front = p.z < vfloat<W>(0.0f), far = rect_is_far(p, hx, hy);
  // Coordinates relative to the point: the plane is at -p.z along +z.
  vvec3<W> to{(2.0f * u - 1.0f) * hx - p.x, (2.0f * v - 1.0f) * hy - p.y, -p.z};
  vfloat<W> near_pdf(0.0f);
  if (any(front & !far)) {
    const SphericalRect<W> sphere(p, hx, hy);
    const vbool<W> thin = front & !far & (sphere.solid_angle < vfloat<W>(kSliver));
    const vvec3<W> q = sphere.sample(u, v);
    to = select(far, to, vvec3<W>(q.x, q.y, -q.z));
    near_pdf = 1.0f / sphere.solid_angle;
    if (any(thin)) {
      const Sliver<W> sliver(p, hx, hy);
      to = select(thin, sliver.sample(u, v), to);
      near_pdf = select(thin, sliver.pdf(to), near_pdf);
    }
  }
  const vfloat<W> d2 = dot(to, to), d = sqrt(d2);
  const vfloat<W> far_pdf = d2 * d / (4.0f * hx * hy * -p.z);
  const vfloat<W> pdf = select(far, far_pdf, near_pdf);
  return {to * (1.0f / d), d, select(front & (pdf > vfloat<W>(0.0f)) & (pdf < vfloat<W>(kInfinity)), pdf, vfloat<W>(0.0f))};
}

// Density of rect_sample() towards the point at `to`, seen from p.
template <int W>
PRIMRAY_INLINE vfloat<W> rect_pdf(const vvec3<W>& p, vfloat<W> hx, vfloat<W> hy, const vvec3<W>& to) {
  const vbool<W> far = rect_is_far(p, hx, hy);
  const vfloat<W> distance = length(to), by_area = distance * distance * distance / (4.0f * hx * hy * -p.z);
  return all(far) ? by_area : near_rect_pdf(p, hx, hy, to, far, by_area);
}

template <int W>
PRIMRAY_INLINE LocalHit<W> rect_hit(const vvec3<W>& p, const vvec3<W>& w, vfloat<W> hx, vfloat<W> hy) {
  const vfloat<W> t = -p.z / w.z;
  const vvec3<W> to = w * t;
  const vbool<W> hit = (p.z < vfloat<W>(0.0f)) & (w.z > vfloat<W>(0.0f)) & (abs(p.x + to.x) <= hx) & (abs(p.y + to.y) <= hy);
  if (!any(hit)) return {vfloat<W>(kInfinity), vfloat<W>(0.0f)};
  const vbool<W> far = rect_is_far(p, hx, hy);
  vfloat<W> pdf = t * t / (4.0f * hx * hy * w.z);
  if (any(hit & !far)) pdf = near_rect_pdf(p, hx, hy, to, far, pdf);
  return {select(hit, t, vfloat<W>(kInfinity)), select(hit, pdf, vfloat<W>(0.0f))};
}

struct RectLight : FlatLight {
  static constexpr LightType kType = LightType::kRect;
  static constexpr const char* kName = "RECT";

  template <int W>
  static PRIMRAY_INLINE LocalSample<W> sample(const LightRow<W>& row, const vvec3<W>&, const vvec3<W>& local, vfloat<W> u,
                                              vfloat<W> v) {
    return rect_sample(local, row(kSize0), row(kSize1), u, v);
  }
  template <int W>
  static PRIMRAY_INLINE LocalHit<W> hit(const LightRow<W>& row, const vvec3<W>&, const vvec3<W>& local, const vvec3<W>& w) {
    return rect_hit(local, w, row(kSize0), row(kSize1));
  }
  template <int W>
  static PRIMRAY_INLINE vfloat<W> importance(const float* row, const vvec3<W>& to, vfloat<W> d2, vfloat<W> power) {
    return importance_of(row, 4 * row[kSize0] * row[kSize1], to, d2, power);
  }
  static double reach(const float* row, int axis) {
    const AxisParts a(row, axis);
    return double(row[kSize0]) * a.x + double(row[kSize1]) * a.y;
  }
  static double ball(const float* row) {
    const AxisLengths a(row);
    const double s0 = row[kSize0], s1 = row[kSize1];
    return int(row[kLightFlags]) & kSheared ? s0 * a.x + s1 * a.y : std::hypot(s0, s1);
  }
  static LightSpread spread(const float* row, LightBounds& b) {
    return spread_of(row, 4 * double(row[kSize0]) * double(row[kSize1]), b);
  }
  static bool is_round(const daffine& m) { return is_perpendicular(m.x, m.y); }
  static void sizes(const LightSize& light, const dvec3& axes, double scale, double (&size)[2]) {
    size[0] = 0.5 * light.width * axes.x * scale, size[1] = 0.5 * light.height * axes.y * scale;
  }
  template <class Camera>
  static void outline(const float* row, Camera& camera) {
    const dvec3 o = light_vector(row, kOrigin), u = light_vector(row, kAxisX) * double(row[kSize0]),
                v = light_vector(row, kAxisY) * double(row[kSize1]);
    const dvec3 corners[4] = {o - u - v, o + u - v, o + u + v, o - u + v};
    for (int k = 0; k < 4; ++k) camera.line(corners[k], corners[(k + 1) % 4]);
  }
};

}  // namespace primray
