// Rectangle light in its plane z = 0, |x| <= hx, |y| <= hy, emitting along -z: sampled by solid angle where it is near.
//
// Near: the spherical rectangle of Urena, Fajardo and King 2013, "An Area-Preserving Parametrization for Spherical Rectangles".
// Far (its half-diagonal is less than half of the distance): by area, which has nearly the same variance. Near, but seen
// edge-on so that the solid angle would be imprecise: light/types/rect.hpp.
#pragma once

#include "light/shape/local_shape.hpp"
#include "light/types/light_type.hpp"

namespace primray {

// Sampling of a rectangle that is near but seen nearly edge-on, whose solid angle is too small for the precision of the
// spherical rectangle: chooses a strip along its longer side uniformly, and a point on the strip by its solid angle.
//
// Seen from height h over the plane and distance c from the strip's line, a piece dx of it has solid angle proportional to dx h
// / (c^2 + x^2)^(3/2), so s = x / sqrt(c^2 + x^2) is uniform, with x counted from the foot point on the line. The code stores q
// = 1 - |s|, which is precise if both ends are far away on one side. The density per solid angle is then that of the strip
// alone, c^2 / (2 half h (s1 - s0)).

// Smallest q: x = c / sqrt(2 q) stays finite.
constexpr float kFarAlong = 1e-30f;

template <int W>
class Sliver {
 public:
  // Rectangle |x| <= hx, |y| <= hy in the plane z = 0, seen from p.
  PRIMRAY_INLINE Sliver(const vvec3<W>& p, vfloat<W> hx, vfloat<W> hy)
      : turned_(hy > hx),
        across_(select(turned_, p.x, p.y)),
        half_(min(hx, hy)),
        x0_(-max(hx, hy) - select(turned_, p.y, p.x)),
        x1_(max(hx, hy) - select(turned_, p.y, p.x)),
        height_(-p.z) {}

  // Samples the vector from the point to a point of the rectangle.
  PRIMRAY_INLINE vvec3<W> sample(vfloat<W> u, vfloat<W> v) const {
    const vfloat<W> side = (2.0f * v - 1.0f) * half_ - across_;
    const vfloat<W> c = sqrt(side * side + height_ * height_);
    const vfloat<W> q0 = rest(x0_, c), q1 = rest(x1_, c), one(1.0f);
    // Both ends are on one side of the foot point: interpolate q between q0 and q1. Otherwise interpolate s, from -(1 - q0) to
    // 1 - q1.
    const vbool<W> beside = x0_ * x1_ > vfloat<W>(0.0f);
    const vfloat<W> s = q0 - one + u * (one - q0 + one - q1);
    const vfloat<W> q = max(select(beside, q0 + u * (q1 - q0), one - abs(s)), kFarAlong);
    const vfloat<W> x = c * (one - q) / sqrt(q * (2.0f - q));
    const vfloat<W> along = min(max(copysign(x, select(beside, x0_, s)), x0_), x1_);
    return {select(turned_, side, along), select(turned_, along, side), height_};
  }

  // Density per solid angle with which sample() chooses the point at `to`.
  PRIMRAY_INLINE vfloat<W> pdf(const vvec3<W>& to) const {
    const vfloat<W> side = select(turned_, to.x, to.y), c2 = side * side + height_ * height_, c = sqrt(c2);
    const vfloat<W> q0 = rest(x0_, c), q1 = rest(x1_, c);
    const vfloat<W> width = select(x0_ * x1_ > vfloat<W>(0.0f), abs(q0 - q1), (1.0f - q0) + (1.0f - q1));
    return c2 / (2.0f * half_ * height_ * width);
  }

 private:
  // 1 - |x| / sqrt(c^2 + x^2)
  static PRIMRAY_INLINE vfloat<W> rest(vfloat<W> x, vfloat<W> c) {
    const vfloat<W> far = sqrt(x * x + c * c);
    return c / far * (c / (far + abs(x)));
  }

  vbool<W> turned_;  // the longer side is y
  vfloat<W> across_, half_, x0_, x1_, height_;
};

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
  static double half_extent(const float* row, int axis) {
    const AxisParts a(row, axis);
    return double(row[kSize0]) * a.x + double(row[kSize1]) * a.y;
  }
  static double bounding_radius(const float* row) {
    const AxisLengths a(row);
    const double s0 = row[kSize0], s1 = row[kSize1];
    return int_at(row, kLightFlags) & kSheared ? s0 * a.x + s1 * a.y : std::hypot(s0, s1);
  }
  static TreeBounds tree_bounds(const float* row, LightBounds& b) {
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
