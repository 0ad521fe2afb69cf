// Light samples along a ray rather than at one of its points: a light is chosen by what it could send to the whole segment, and
// a distance on it in proportion to the inverse square of the distance to the light (equiangular sampling; Kulla and Fajardo
// 2012, "Importance Sampling Techniques for Path Tracing in Participating Media"). Of a light with a cone, the part of the
// segment that the cone reaches is sampled.
#pragma once

#include <algorithm>
#include <vector>

#include "light/pivot.hpp"
#include "math/transcendental.hpp"

namespace primray {

template <int W>
struct Segment {
  vvec3<W> o, d;
  vfloat<W> from, to;
};

// Part of segments that a light reaches, and the angles of its ends seen from the light.
template <int W>
struct LitPart {
  using F = vfloat<W>;
  F from, to;      // distances
  F nearest, gap;  // distance at which the ray passes the light, and the distance between the two there
  F first, angle;  // the angle at `from`, and that between both ends

  PRIMRAY_INLINE LitPart(const Pivot& pivot, const Segment<W>& s) : from(s.from), to(s.to) {
    const vvec3<W> center{F(pivot.center.x), F(pivot.center.y), F(pivot.center.z)}, c = center - s.o;
    nearest = dot(c, s.d);
    const vvec3<W> aside = c - s.d * nearest;
    gap = sqrt(dot(aside, aside) + std::max(pivot.radius2, 1e-24f));
    if (pivot.cos_end > 0) clip_to_cone(pivot, s);
    first = angle_at(from), angle = max(angle_at(to) - first, 0.0f);
  }
  PRIMRAY_INLINE F angle_at(F t) const { return atan2(t - nearest, gap); }
  // Relative to other lights: power times the integral of the inverse squared distance.
  PRIMRAY_INLINE F weight(float power) const { return select(to > from, power * angle / gap, F(0.0f)); }
  PRIMRAY_INLINE F sample(F u) const {
    // tan(first + u angle), without the poles.
    const SinCos<W> a = sincos_turns((first + u * angle) * 0.159154943f);
    const F t = nearest + gap * a.sin / max(a.cos, 1e-12f);
    return min(max(t, from), to);
  }
  // Per length.
  PRIMRAY_INLINE F density(F t) const {
    const F along = t - nearest;
    const vbool<W> within = (t >= from) & (t <= to) & (angle > F(0.0f));
    return select(within, gap / (max(angle, 1e-20f) * (gap * gap + along * along)), F(0.0f));
  }

 private:
  PRIMRAY_INLINE void clip_to_cone(const Pivot& pivot, const Segment<W>& s) {
    const vvec3<W> axis{F(pivot.axis.x), F(pivot.axis.y), F(pivot.axis.z)};
    const vvec3<W> m = s.o - vvec3<W>(F(pivot.apex.x), F(pivot.apex.y), F(pivot.apex.z));
    const float c2 = pivot.cos_end * pivot.cos_end;
    const F along = dot(m, axis), slope = dot(s.d, axis);
    // (m + t d) . axis >= cos |m + t d|: its square is a t^2 + 2 b t + c >= 0.
    const F a = slope * slope - c2, b = along * slope - c2 * dot(m, s.d), c = along * along - c2 * dot(m, m);
    const F square = b * b - a * c, root = safe_sqrt(square), q = -(b + copysign(root, b));
    const F one = q / select(abs(a) < F(1e-12f), copysign(F(1e-12f), a), a);
    const F other = c / select(abs(q) < F(1e-30f), copysign(F(1e-30f), q), q);
    const F low = min(one, other), high = max(one, other), none(INFINITY);
    const vbool<W> steep = a > F(0.0f), real = square >= F(0.0f);
    // A steep ray is in the cone on one side of a root; others between the roots, or nowhere.
    const vbool<W> between = (!steep) & real & (along + slope * (low + high) * 0.5f > F(0.0f));
    const F begin = select(steep, select(slope > F(0.0f), high, -none), select(between, low, none));
    const F end = select(steep, select(slope > F(0.0f), none, low), select(between, high, -none));
    from = max(from, begin), to = min(to, end);
  }
};

// Light and distance chosen on a segment, and the density of both.
template <int W>
struct ChosenAlong {
  vint<W> light;
  vfloat<W> t, density;  // density per length; 0: no light reaches it
};

// What lights could send to a segment: the integral along it of their powers by squared distance, and the greatest value of
// one of them.
template <int W>
struct LightAlong {
  vfloat<W> total{0.0f}, peak{0.0f};

  PRIMRAY_INLINE LightAlong(const std::vector<Pivot>& pivots, const Segment<W>& s) {
    for (const Pivot& pivot : pivots) {
      const LitPart<W> part(pivot, s);
      const vfloat<W> w = part.weight(pivot.power), aside = min(max(part.nearest, part.from), part.to) - part.nearest;
      total += w;
      peak = max(peak, select(w > vfloat<W>(0.0f), pivot.power / (part.gap * part.gap + aside * aside), vfloat<W>(0.0f)));
    }
  }
};

// Chooses a light by `u`, and a distance by `v`; `total`: see LightAlong.
template <int W>
PRIMRAY_RARE ChosenAlong<W> choose_along(const std::vector<Pivot>& pivots, const Segment<W>& s, vfloat<W> total, vfloat<W> u,
                                         vfloat<W> v) {
  using F = vfloat<W>;
  ChosenAlong<W> chosen{vint<W>(0), s.from, F(0.0f)};
  const F wanted = u * total;
  F run(0.0f);
  for (const Pivot& pivot : pivots) {
    const LitPart<W> part(pivot, s);
    const F w = part.weight(pivot.power);
    const vbool<W> here = (run <= wanted) & (w > F(0.0f));
    run += w;
    if (!any(here)) continue;
    const F t = part.sample(v);
    chosen.light = select(here, vint<W>(pivot.light), chosen.light), chosen.t = select(here, t, chosen.t);
    chosen.density = select(here, part.density(t) * w / max(total, 1e-30f), chosen.density);
  }
  return chosen;
}

// Density with which choose_along() would have chosen `light` and distance `t`.
template <int W>
PRIMRAY_RARE vfloat<W> density_along(const std::vector<Pivot>& pivots, const Segment<W>& s, vfloat<W> total, vint<W> light,
                                     vfloat<W> t) {
  vfloat<W> density(0.0f);
  for (const Pivot& pivot : pivots) {
    const vbool<W> is = light == vint<W>(pivot.light);
    if (!any(is)) continue;
    const LitPart<W> part(pivot, s);
    density = select(is, part.density(t) * part.weight(pivot.power) / max(total, 1e-30f), density);
  }
  return density;
}

}  // namespace primray
