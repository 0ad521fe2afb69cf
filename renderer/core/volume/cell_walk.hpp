// Cells of a grid along a ray, nearest first, with the range of values in each: a digital differential analyser over leaves,
// and over nodes where a node is a cell of its own (Amanatides and Woo 1987, "A Fast Voxel Traversal Algorithm for Ray
// Tracing"; two levels as in Museth 2014, "Hierarchical Digital Differential Analyzer for Efficient Ray-Marching in OpenVDB").
#pragma once

#include "math/vec3.hpp"
#include "volume/grid_lookup.hpp"

namespace primray {

template <int W>
struct CellWalk {
  using F = vfloat<W>;
  using I = vint<W>;

  vvec3<W> o, d, inverse;  // ray in the grid's coordinates; distances along it are the world's
  F t, end;                // where the walk is, and where it ends
  F next;                  // where the ray leaves the cell
  F low, high;             // range of the cell's values
  I x[3], side;            // the cell's lowest leaf, in units of leaves, and its side: 1 or 16
  F thin;                  // nodes with less than this product of value and distance are cells of their own

  // Begins at `from`. `per_value`: optical depth per unit of value and distance.
  PRIMRAY_INLINE void begin(const GridRows<W>& grid, vbool<W> m, const vvec3<W>& origin, const vvec3<W>& direction, F from,
                            F to, F per_value) {
    const auto away = [](F a) { return select(abs(a) < F(1e-18f), copysign(F(1e-18f), a), a); };
    o = origin, d = {away(direction.x), away(direction.y), away(direction.z)};
    inverse = {1.0f / d.x, 1.0f / d.y, 1.0f / d.z};
    t = from, end = to;
    thin = kThinNode / max(per_value, 1e-30f);
    const vvec3<W> p = at(from);
    x[0] = floor_to_int(p.x * 0.125f), x[1] = floor_to_int(p.y * 0.125f), x[2] = floor_to_int(p.z * 0.125f);
    look(grid, m);
  }
  PRIMRAY_INLINE vvec3<W> at(F distance) const { return o + d * distance; }
  // The ray's position at `distance`, which is within the current cell, whatever rounding does.
  PRIMRAY_INLINE vvec3<W> in_cell(F distance) const {
    const vvec3<W> p = at(distance);
    const auto within = [&](F a, int axis) {
      const F first = to_float(x[axis]) * 8.0f;
      return min(max(a, first), first + to_float(side) * 8.0f);
    };
    return {within(p.x, 0), within(p.y, 1), within(p.z, 2)};
  }
  // Advances the lanes `m` to the cell behind the current one.
  PRIMRAY_INLINE void advance(const GridRows<W>& grid, vbool<W> m) {
    const F exits[3] = {exit(0), exit(1), exit(2)};
    const vbool<W> by_x = (exits[0] <= exits[1]) & (exits[0] <= exits[2]), by_y = (!by_x) & (exits[1] <= exits[2]);
    const vbool<W> by[3] = {by_x, by_y, !(by_x | by_y)};
    const vvec3<W> p = at(next);
    const F places[3] = {p.x, p.y, p.z}, ways[3] = {d.x, d.y, d.z};
    for (int a = 0; a < 3; ++a) {
      const I first = x[a], last = first + side - I(1);
      const vbool<W> up = ways[a] > F(0.0f);
      const I inside = min(max(floor_to_int(places[a] * 0.125f), first), last);
      x[a] = select(m, select(by[a], select(up, last + I(1), first - I(1)), inside), first);
    }
    t = select(m, next, t);
    look(grid, m);
  }

 private:
  static constexpr float kThinNode = 0.25f;

  // Distance at which the ray leaves the cell along an axis.
  PRIMRAY_INLINE F exit(int axis) const {
    const F way = axis == 0 ? d.x : axis == 1 ? d.y : d.z, from = axis == 0 ? o.x : axis == 1 ? o.y : o.z;
    const F per = axis == 0 ? inverse.x : axis == 1 ? inverse.y : inverse.z;
    const I bound = x[axis] + select(way > F(0.0f), side, I(0));
    return (to_float(bound) * 8.0f - from) * per;
  }
  PRIMRAY_INLINE F nearest_exit() const { return min(exit(0), min(exit(1), exit(2))); }

  // Reads the cell that has the leaf x.
  PRIMRAY_INLINE void look(const GridRows<W>& grid, vbool<W> m) {
    const I node = grid.node(x[0] >> 4, x[1] >> 4, x[2] >> 4), leaf[3] = {x[0], x[1], x[2]}, was = side;
    const float* nodes = grid.table.node_ranges.data();
    F least = gather<W>(nodes, node << 1), most = gather<W>(nodes + 1, node << 1);
    // Take the whole node as a cell where little happens in it.
    const I mask(~(kNodeLeaves - 1));
    for (int a = 0; a < 3; ++a) x[a] = select(m, x[a] & mask, x[a]);
    side = select(m, I(kNodeLeaves), was);
    const vbool<W> fine = m & (most * (nearest_exit() - t) > thin) & (least < most);
    if (any(fine)) {
      const I entry = GridRows<W>::entry(node, leaf[0], leaf[1], leaf[2]) << 1;
      const float* leaves = grid.table.leaf_ranges.data();
      least = select(fine, gather<W>(leaves, entry), least), most = select(fine, gather<W>(leaves + 1, entry), most);
      for (int a = 0; a < 3; ++a) x[a] = select(fine, leaf[a], x[a]);
      side = select(fine, I(1), side);
    }
    low = select(m, least, low), high = select(m, most, high);
    next = select(m, max(min(nearest_exit(), end), t), next);
  }
};

}  // namespace primray
