// Light samples along a ray rather than at one of its points: a light is chosen by what it could send to the whole segment, and
// a distance on it in proportion to the inverse square of the distance to the light (equiangular sampling; Kulla and Fajardo
// 2012, "Importance Sampling Techniques for Path Tracing in Participating Media"). Of a light with a cone, the part of the
// segment that the cone reaches is sampled. Where media scatter forwards or backwards, both choices follow the phase function
// as well: it depends on the angle that is sampled evenly otherwise.
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
  // Relative to other lights: power times the integral of the phase function by the squared distance, approximately.
  PRIMRAY_INLINE F weight(const PhaseByAngle& phase, F power) const {
    return power * (phase.any() ? about_mass(phase) : angle) / gap;
  }
  // The greatest value of power by squared distance.
  PRIMRAY_INLINE F peak(F power) const {
    const F aside = min(max(nearest, from), to) - nearest;
    return select(angle > F(0.0f), power / (gap * gap + aside * aside), F(0.0f));
  }
  PRIMRAY_INLINE F sample(const PhaseByAngle& phase, F u) const {
    // tan(first + u angle), without the poles.
    const F first = atan2(from - nearest, gap);
    const F passed = phase.any() ? first + angle_of(phase, u, first) : first + u * angle;
    const SinCos<W> a = sincos_turns(passed * 0.159154943f);
    const F t = nearest + gap * a.sin / max(a.cos, 1e-12f);
    return min(max(t, from), to);
  }
  // Per length.
  PRIMRAY_INLINE F density(const PhaseByAngle& phase, F t) const {
    const F along = t - nearest;
    const vbool<W> within = (t >= from) & (t <= to) & (angle > F(0.0f));
    const F even = gap / (max(angle, 1e-20f) * (gap * gap + along * along));
    return select(within, phase.any() ? even * relative_density(phase, t) : even, F(0.0f));
  }

 private:
  // Integral of the phase function over the angle, from its value where that is greatest; at most the integral over all angles.
  PRIMRAY_INLINE F about_mass(const PhaseByAngle& phase) const {
    const F end = phase.mean_cosine > 0 ? from : to;
    const F a = clamp((end - nearest) / gap, -1e12f, 1e12f), sine = a * quick_rsqrt(1.0f + a * a);
    const F g(phase.mean_cosine), r = quick_rsqrt(max(1.0f + g * g + 2.0f * g * sine, 1e-6f));
    return angle * PhaseByAngle::kEvenShare + min(angle * (r * r * r * phase.scale), phase.most);
  }
  // Angles of less than a hundredth of a cell, whose ends rounding would blur, are sampled evenly.
  PRIMRAY_INLINE vbool<W> is_narrow() const { return angle < F(0.01f * PhaseByAngle::kWidth); }
  static PRIMRAY_INLINE vint<W> cell_of(F a) {
    const F at = (a + 0.5f * 3.14159265f) * (1 / PhaseByAngle::kWidth);
    return truncate(min(max(at, 0.0f), float(PhaseByAngle::kCells) - 0.5f));
  }
  static PRIMRAY_INLINE F start_of(vint<W> cell) { return to_float(cell) * PhaseByAngle::kWidth - 0.5f * 3.14159265f; }
  static PRIMRAY_INLINE F integral_to(const PhaseByAngle& phase, F a, vint<W> cell) {
    return gather<W>(phase.before.data(), cell) + (a - start_of(cell)) * gather<W>(phase.value.data(), cell);
  }
  // Integral of the phase function over the angle, which begins at `first`.
  PRIMRAY_INLINE F mass(const PhaseByAngle& phase, F first) const {
    const vint<W> a = cell_of(first), b = cell_of(first + angle);
    const F whole = integral_to(phase, first + angle, b) - integral_to(phase, first, a);
    return select(a == b, angle * gather<W>(phase.value.data(), a), max(whole, 1e-20f));
  }
  // Density of distances relative to even angles.
  PRIMRAY_RARE F relative_density(const PhaseByAngle& phase, F t) const {
    const F value = gather<W>(phase.value.data(), cell_of(atan2(t - nearest, gap)));
    return select(is_narrow(), F(1.0f), value * angle / max(mass(phase, atan2(from - nearest, gap)), 1e-20f));
  }
  // Angle from `first` over which the share `u` of the integral lies.
  PRIMRAY_RARE F angle_of(const PhaseByAngle& phase, F u, F first) const {
    const vint<W> begin = cell_of(first);
    const vbool<W> even = is_narrow() | (cell_of(first + angle) == begin);
    const F integral = u * mass(phase, first) + integral_to(phase, first, begin);
    // The last cell that begins below the integral.
    vint<W> cell(0);
    for (int step = PhaseByAngle::kCells / 2; step; step /= 2) {
      const vint<W> next = cell + vint<W>(step);
      cell = select(gather<W>(phase.before.data(), next) <= integral, next, cell);
    }
    const F inside = (integral - gather<W>(phase.before.data(), cell)) / gather<W>(phase.value.data(), cell);
    return select(even, u * angle, min(max(start_of(cell) + inside - first, 0.0f), angle));
  }
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
      total += part.weight(table.phase, pivot.power), peak = max(peak, part.peak(pivot.power));
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
    const F t = part.sample(table.phase, v);
    return {gather<W>(&table.pivots[0].light, number * vint<W>(13)), t,
            part.density(table.phase, t) * part.weight(table.phase, pivot.power) / max(total, 1e-30f)};
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
  return select(is, part.density(table.phase, t) * part.weight(table.phase, pivot.power) / max(total, 1e-30f), vfloat<W>(0.0f));
}

}  // namespace primray
