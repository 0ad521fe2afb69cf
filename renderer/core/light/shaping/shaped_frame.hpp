// The frame by which a light's shaping knows directions, where the light stands so.
#pragma once

#include <algorithm>
#include <cmath>

#include "math/matrix.hpp"

namespace primray {

// The light's axes in the world; perpendicular ones in place of those that a flat matrix lacks.
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

// As a row of the ShapingTable has it: its -z, unit, in the world, and columns of the photometric profile's frame from world.
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
