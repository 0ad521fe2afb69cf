// Frame in which a light's shaping is evaluated, from the light's transform.
#pragma once

#include <algorithm>
#include <cmath>

#include "math/matrix.hpp"

namespace primray {

// World axes of the light; axes that a degenerate matrix lacks are replaced by perpendicular ones.
inline daffine whole_axes(const daffine& m) {
  if (m.determinant() != 0) return m;
  const double x = length(m.x), y = length(m.y), z = length(m.z);
  dvec3 n = z > 0 ? m.z * (1 / z) : cross(m.x, m.y);
  if (!(length(n) > 0)) n = x > 0 ? Frame<double>(normalize(m.x)).s : y > 0 ? Frame<double>(normalize(m.y)).s : dvec3{0, 0, 1};
  n = normalize(n);
  dvec3 s = m.x - n * dot(n, m.x);
  if (!(length(s) > 1e-9 * x)) s = Frame<double>(n).s;
  s = normalize(s);
  return {s, cross(n, s), n, m.o};
}

// Frame fields of a row of the ShapingTable: the light's -z axis (unit, world space), and the columns of profile_from_world.
struct ShapedFrame {
  dvec3 axis, x, y, z;
};

inline ShapedFrame shaped_frame(const daffine& world_from_light) {
  const daffine m = whole_axes(world_from_light), inv = inverse(m);
  // The profile's horizontal angles begin at the light's -X: see textures/ies.py.
  double largest = 0;
  for (const dvec3& c : {inv.x, inv.y, inv.z})
    largest = std::max(largest, max_component(dvec3{std::fabs(c.x), std::fabs(c.y), std::fabs(c.z)}));
  const dvec3 turned{-1 / largest, -1 / largest, 1 / largest};
  return {normalize(m.z) * -1.0, inv.x * turned, inv.y * turned, inv.z * turned};
}

}  // namespace primray
