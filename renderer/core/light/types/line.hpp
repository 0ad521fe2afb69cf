// Line light along the unit axis: the limit of a cylinder whose radius goes to 0 at constant power. Rays never hit it.
//
// A piece dx emits I dx sin psi in a direction at angle psi from the axis. From a point at distance rho from the line, a piece
// at t along it, at distance d, causes irradiance I rho / d^3 dt across the ray, which is I / rho ds with s = t / d: so s is
// sampled uniformly, and every sample has the same contribution.
#pragma once

#include "light/types/light_type.hpp"

namespace primray {

// Sampled point (unit wi, distance t), and the irradiance of the whole line there, per unit of I; `usable`: not on the line.
template <int W>
struct LineSample {
  vvec3<W> wi;
  vfloat<W> t, worth;
  vbool<W> usable;
};

// `to_center`: from the point to the line's centre.
template <int W>
PRIMRAY_RARE LineSample<W> line_sample(const vvec3<W>& to_center, const vvec3<W>& axis, vfloat<W> half_length, vfloat<W> u) {
  using F = vfloat<W>;
  const F none(0.0f), middle = dot(to_center, axis), a = middle - half_length, b = middle + half_length;
  const vvec3<W> across = to_center - axis * middle;
  const F rho2 = dot(across, across), rho = sqrt(rho2), da = sqrt(rho2 + a * a), db = sqrt(rho2 + b * b);
  // sb - sa = (b da - a db) / (da db); if both ends are on one side its numerator is rho^2 (b^2 - a^2) / (b da + a db).
  const vbool<W> aside = a * b > none;
  const F numerator = select(aside, rho2 * (4.0f * half_length * middle) / (b * da + a * db), b * da - a * db);
  const F width = numerator / (da * db);
  // s from whichever end of [-1, 1] is nearer, as the difference c from it; for an end beyond, 1 - |s| = rho^2 / (d (d + |t|)).
  const F ca = select(a > none, 1.0f + a / da, rho2 / (da * (da - min(a, 0.0f))));
  const F cb = select(b < none, 1.0f - b / db, rho2 / (db * (db + max(b, 0.0f))));
  const F from_a = ca + u * width, from_b = cb + (1.0f - u) * width;
  const vbool<W> ahead = from_b < from_a;
  const F c = select(ahead, from_b, from_a);
  const F t = copysign(rho * (1.0f - c) / sqrt(c * (2.0f - c)), select(ahead, F(1.0f), F(-1.0f)));
  const vvec3<W> to = across + axis * min(max(t, a), b);
  const F distance = length(to), worth = width / rho;
  return {to * (1.0f / distance), distance, worth, (rho > none) & (width > none) & (worth < F(kInfinity))};
}

struct LineLight : LightTypeDefaults {
  static constexpr LightType kType = LightType::kLine;
  static constexpr const char* kName = "LINE";

  template <int W>
  static PRIMRAY_INLINE void sample_world(const LightRow<W>& row, vbool<W> m, const vvec3<W>& p, vfloat<W> u,
                                          LightSample<W>& r) {
    const LineSample<W> l = line_sample(row.vector(kOrigin) - p, row.vector(kAxisX), row(kSize1), u);
    r.wi = select(m, l.wi, r.wi), r.t = select(m, l.t, r.t);
    r.pdf = select(m, select(l.usable, vfloat<W>(1.0f), vfloat<W>(0.0f)), r.pdf);
    r.L = select(m, r.L * l.worth, r.L);
    r.is_delta |= m;
  }
  template <int W>
  static PRIMRAY_INLINE vfloat<W> importance(const float* row, const vvec3<W>& to, vfloat<W> d2, vfloat<W> power) {
    const vvec3<W> axis = LightRow<W>(row).vector(kAxisX);
    const vfloat<W> x = abs(axis.x * to.x + axis.y * to.y + axis.z * to.z);
    const vfloat<W> beyond = max(x - row[kSize1], 0.0f), rho2 = max(d2 - x * x, 1e-6f * d2);
    return power * min(2 * row[kSize1] / (rho2 + beyond * beyond), 2.0f / sqrt(rho2));
  }
  static double half_extent(const float* row, int axis) { return double(row[kSize1]) * AxisParts(row, axis).x; }
  static double bounding_radius(const float* row) { return row[kSize1]; }
  static TreeBounds tree_bounds(const float* row, LightBounds& b) {
    const double s1 = row[kSize1];
    b.exact = true;
    return {2 * s1, s1 * s1 / 3};
  }
  static void sizes(const LightSize& light, const dvec3& axes, double scale, double (&size)[2]) {
    size[0] = size[1] = 0.5 * light.length * axes.x * scale;
  }
  static double emission_scale(const double (&size)[2], const double (&kept)[2], double scale) {
    return scale * size[1] / kept[1];
  }
  static void place(daffine& m) {
    const Frame<double> across(normalize(m.x));
    m.x = across.n, m.y = across.s, m.z = across.t;
  }
};

}  // namespace primray
