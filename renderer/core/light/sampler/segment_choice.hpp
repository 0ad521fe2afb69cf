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

// One light for all lanes, or one for each.
template <int W>
struct PivotLanes {
  using F = vfloat<W>;
  vvec3<W> center, axis, apex;
  F radius2, power, cos_end;
  bool any_cone;

  explicit PRIMRAY_INLINE PivotLanes(const Pivot& p)
      : center(lanes(p.center)),
        axis(lanes(p.axis)),
        apex(lanes(p.apex)),
        radius2(p.radius2),
        power(p.power),
        cos_end(p.cos_end),
        any_cone(p.cos_end > 0) {}
  PRIMRAY_INLINE PivotLanes(const PivotTable& table, vint<W> number) {
    static_assert(sizeof(Pivot) == 13 * sizeof(float));
    const float* base = reinterpret_cast<const float*>(table.pivots.data());
    const vint<W> at = number * vint<W>(13);
    const auto vector = [&](int k) { return gather_vec3<W>(base + k, at); };
    center = vector(0), radius2 = gather<W>(base + 3, at), power = gather<W>(base + 4, at);
    axis = vector(5), apex = vector(8), cos_end = gather<W>(base + 11, at);
    any_cone = any(cos_end > F(0.0f));
  }

 private:
  static PRIMRAY_INLINE vvec3<W> lanes(const vec3& v) { return {F(v.x), F(v.y), F(v.z)}; }
};

// Part of segments that a light reaches, and how it is seen from the light.
template <int W>
struct LitPart {
  using F = vfloat<W>;
  F from, to;      // distances
  F nearest, gap;  // distance at which the ray passes the light, and the distance between the two there
  F angle;         // between both ends

  PRIMRAY_INLINE LitPart(const PivotLanes<W>& pivot, const Segment<W>& s) : from(s.from), to(s.to) {
    const vvec3<W> c = pivot.center - s.o;
    nearest = dot(c, s.d);
    const vvec3<W> aside = c - s.d * nearest;
    gap = sqrt(dot(aside, aside) + max(pivot.radius2, 1e-24f));
    if (pivot.any_cone) clip_to_cone(pivot, s);
    const F a = (from - nearest) / gap, b = min((to - nearest) / gap, 1e12f);
    angle = select(to > from, atan2(b - a, 1.0f + a * b), F(0.0f));
  }
  // Relative to other lights: power times the integral of the inverse squared distance.
  PRIMRAY_INLINE F weight(F power) const { return power * angle / gap; }
  // The greatest value of power by squared distance.
  PRIMRAY_INLINE F peak(F power) const {
    const F aside = min(max(nearest, from), to) - nearest;
    return select(angle > F(0.0f), power / (gap * gap + aside * aside), F(0.0f));
  }
  PRIMRAY_INLINE F sample(F u) const {
    // tan(first + u angle), without the poles.
    const F first = atan2(from - nearest, gap);
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
  PRIMRAY_INLINE void clip_to_cone(const PivotLanes<W>& pivot, const Segment<W>& s) {
    const vvec3<W> m = s.o - pivot.apex;
    const F c2 = pivot.cos_end * pivot.cos_end, along = dot(m, pivot.axis), slope = dot(s.d, pivot.axis);
    // (m + t d) . axis >= cos |m + t d|: its square is a t^2 + 2 b t + c >= 0.
    const F a = slope * slope - c2, b = along * slope - c2 * dot(m, s.d), c = along * along - c2 * dot(m, m);
    const F square = b * b - a * c, root = safe_sqrt(square), q = -(b + copysign(root, b));
    const F one = q / select(abs(a) < F(1e-12f), copysign(F(1e-12f), a), a);
    const F other = c / select(abs(q) < F(1e-30f), copysign(F(1e-30f), q), q);
    const F low = min(one, other), high = max(one, other), none(INFINITY);
    const vbool<W> steep = a > F(0.0f), real = square >= F(0.0f), cone = pivot.cos_end > F(0.0f);
    // A steep ray is in the cone on one side of a root; others between the roots, or nowhere.
    const vbool<W> between = (!steep) & real & (along + slope * (low + high) * 0.5f > F(0.0f));
    const F begin = select(steep, select(slope > F(0.0f), high, -none), select(between, low, none));
    const F end = select(steep, select(slope > F(0.0f), none, low), select(between, high, -none));
    from = select(cone, max(from, begin), from), to = select(cone, min(to, end), to);
  }
};

// Light and distance chosen on a segment, and the density of both.
template <int W>
struct ChosenAlong {
  vint<W> light;
  vfloat<W> t, density;  // density per length; 0: no light reaches it
};

// What lights could send to a segment: the integral along it of their powers by squared distance.
template <int W>
struct LightAlong {
  using F = vfloat<W>;
  F total{0.0f};
  F peak{0.0f};  // the greatest value of one light

  // Weighs all lights; `sums`: W numbers for each, which sample() reads.
  PRIMRAY_INLINE LightAlong(const PivotTable& table, const Segment<W>& s, float* sums) {
    for (size_t k = 0; k < table.pivots.size(); ++k) {
      const PivotLanes<W> pivot(table.pivots[k]);
      const LitPart<W> part(pivot, s);
      total += part.weight(pivot.power), peak = max(peak, part.peak(pivot.power));
      store(sums + k * W, total);
    }
  }
  // Chooses a light by `u`, and a distance by `v`.
  PRIMRAY_INLINE ChosenAlong<W> sample(const PivotTable& table, const Segment<W>& s, const float* sums, F u, F v) const {
    // The first light whose sum exceeds what is wanted.
    const F wanted = u * total;
    vint<W> number(0);
    for (size_t k = 0; k + 1 < table.pivots.size(); ++k) number -= minus_one_where(load<W>(sums + k * W) <= wanted);
    const PivotLanes<W> pivot(table, number);
    const LitPart<W> part(pivot, s);
    const F t = part.sample(v);
    return {gather<W>(&table.pivots[0].light, number * vint<W>(13)), t,
            part.density(t) * part.weight(pivot.power) / max(total, 1e-30f)};
  }
};

// Density with which LightAlong::sample() would have chosen `light` and distance `t`; `total`: LightAlong's.
template <int W>
PRIMRAY_RARE vfloat<W> density_along(const PivotTable& table, const Segment<W>& s, vfloat<W> total, vint<W> light,
                                     vfloat<W> t) {
  const vint<W> number = gather<W>(table.of_light.data(), light);
  const vbool<W> is = number >= vint<W>(0);
  if (!any(is)) return vfloat<W>(0.0f);
  const PivotLanes<W> pivot(table, select(is, number, vint<W>(0)));
  const LitPart<W> part(pivot, s);
  return select(is, part.density(t) * part.weight(pivot.power) / max(total, 1e-30f), vfloat<W>(0.0f));
}

}  // namespace primray
