// A line along the unit axis: the limit of a cylinder whose radius goes to 0 while its power stays. Rays never meet it.
//
// A piece dx sends I dx sin psi along a direction at angle psi from the axis. From a point at distance rho from the line, a
// piece at t along it, d away, gives I rho / d^3 dt of irradiance across the ray, which is I / rho ds with s = t / d: so s is
// sampled uniformly, and every sample carries the same.
#pragma once

#include "light/shape/local_shape.hpp"

namespace primray {

// The point chosen (unit wi, distance t), and what all of the line is worth there, per unit of I; `usable`: not on the line.
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
  // sb - sa = (b da - a db) / (da db); where both ends lie to one side its numerator is rho^2 (b^2 - a^2) / (b da + a db).
  const vbool<W> aside = a * b > none;
  const F numerator = select(aside, rho2 * (4.0f * half_length * middle) / (b * da + a * db), b * da - a * db);
  const F width = numerator / (da * db);
  // s from whichever end of [-1, 1] is nearer, as the difference c from it; of an end beyond, 1 - |s| = rho^2 / (d (d + |t|)).
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

}  // namespace primray
