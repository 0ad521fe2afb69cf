// Pairs of triangles that share an edge, such as quads: Embree tests and stores both together, which takes two thirds of the
// memory and of the build time, and traces about a tenth faster than triangles (docs/decisions/tracing).
//
// A pair is two consecutive triangles, (a, c, d) and (a, b, c). Four of their six indices in a row, from the third on, are then
// Embree's quad (d, a, b, c), which it also splits from a to c: it reads the triangles' own indices.
#pragma once

#include <cstdint>
#include <span>

#include "math/lanes.hpp"
#include "ray/ray.hpp"

namespace primray {

constexpr uint32_t kPairGeometry = 3;  // beside those of scene.hpp
// Groups with fewer are not worth a separate geometry.
constexpr uint32_t kFewestPairs = 256;

// Returns how many triangles at the beginning of `indices` are in pairs.
inline uint32_t count_paired(std::span<const uint32_t> indices) {
  size_t i = 0;
  while (i + 6 <= indices.size() && indices[i] == indices[i + 3] && indices[i + 1] == indices[i + 5]) i += 6;
  return i / 3 < 2 * kFewestPairs ? 0 : uint32_t(i / 3);
}

// Converts hits of pairs to hits of their triangles. Embree's first triangle of a quad is (d, a, c), with u of a and v of c;
// its second is (b, c, a), with 1 - u of c and 1 - v of a.
template <int W>
PRIMRAY_INLINE void to_triangles(vint<W> geom, vint<W>& prim, vfloat<W>& u, vfloat<W>& v) {
  const vbool<W> pair = ((geom & vint<W>((1 << kGeometryBits) - 1)) == vint<W>(int32_t(kPairGeometry))) & (geom != vint<W>(-1));
  if (!any(pair)) return;
  const vfloat<W> one(1.0f), both = u + v, before = u;
  const vbool<W> second = both > one;
  prim = select(pair, prim + prim + select(second, vint<W>(1), vint<W>(0)), prim);
  u = select(pair, select(second, both - one, v), u);
  v = select(pair, select(second, one - before, max(one - both, 0.0f)), v);
}

}  // namespace primray
