// Cells of a grid along a ray, nearest first, with the range of values in each: a digital differential analyser over leaves,
// over nodes where little happens in a node, and over voxels where a leaf is dense (Amanatides and Woo 1987, "A Fast Voxel
// Traversal Algorithm for Ray Tracing"; two levels as in Museth 2014, "Hierarchical Digital Differential Analyzer for Efficient
// Ray-Marching in OpenVDB").
#pragma once

#include "math/vec3.hpp"
#include "volume/grid_lookup.hpp"

namespace primray {

// Products of value and distance up to which a node is one cell, and from which a leaf is divided into voxels.
template <int W>
struct CellSizes {
  vfloat<W> thin, dense;

  // `per_value`: optical depth per unit of value and distance.
  static PRIMRAY_INLINE CellSizes by_depth(vfloat<W> per_value) {
    constexpr float kThinNode = 0.25f, kDenseLeaf = 256;
    const vfloat<W> unit = 1.0f / max(per_value, 1e-30f);
    return {kThinNode * unit, kDenseLeaf * unit};
  }
  // Leaves, and nodes with one value.
  static PRIMRAY_INLINE CellSizes leaves() { return {vfloat<W>(0.0f), vfloat<W>(INFINITY)}; }
};

template <int W>
struct CellWalk {
  using F = vfloat<W>;
  using I = vint<W>;

  // Ray in the grid's coordinates; distances along it are the world's.
  vvec3<W> o{F(0.0f)}, d{F(1.0f)}, inverse{F(1.0f)};
  F t{0.0f}, end{0.0f};                  // where the walk is, and where it ends
  F next{0.0f};                          // where the ray leaves the cell
  F low{0.0f}, high{0.0f};               // range of the cell's values
  I x[3] = {I(0), I(0), I(0)}, side{1};  // the cell's lowest voxel, and its side: 1, 8 or 128 voxels
  F thin{0.0f}, dense{0.0f};             // see CellSizes

  // Begins in lanes `m` at `from`.
  PRIMRAY_INLINE void begin(const GridRows<W>& grid, vbool<W> m, const vvec3<W>& origin, const vvec3<W>& direction, F from,
                            F to, const CellSizes<W>& sizes) {
    const auto away = [](F a) { return select(abs(a) < F(1e-18f), copysign(F(1e-18f), a), a); };
    o = select(m, origin, o), d = select(m, vvec3<W>(away(direction.x), away(direction.y), away(direction.z)), d);
    inverse = {1.0f / d.x, 1.0f / d.y, 1.0f / d.z};
    t = select(m, from, t), end = select(m, to, end);
    thin = select(m, sizes.thin, thin), dense = select(m, sizes.dense, dense);
    const vvec3<W> p = at(from);
    x[0] = select(m, floor_to_int(p.x), x[0]), x[1] = select(m, floor_to_int(p.y), x[1]);
    x[2] = select(m, floor_to_int(p.z), x[2]);
    look(grid, m);
  }
  PRIMRAY_INLINE vvec3<W> at(F distance) const { return o + d * distance; }
  // The ray's position at `distance`, which is within the current cell, whatever rounding does.
  PRIMRAY_INLINE vvec3<W> in_cell(F distance) const {
    const vvec3<W> p = at(distance);
    const auto within = [&](F a, int axis) {
      const F first = to_float(x[axis]);
      return min(max(a, first), first + to_float(side));
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
      const I inside = min(max(floor_to_int(places[a]), first), last);
      x[a] = select(m, select(by[a], select(up, last + I(1), first - I(1)), inside), first);
    }
    t = select(m, next, t);
    look(grid, m);
  }

 private:
  // Distance at which the ray leaves the cell along an axis.
  PRIMRAY_INLINE F exit(int axis) const {
    const F way = axis == 0 ? d.x : axis == 1 ? d.y : d.z, from = axis == 0 ? o.x : axis == 1 ? o.y : o.z;
    const F per = axis == 0 ? inverse.x : axis == 1 ? inverse.y : inverse.z;
    const I bound = x[axis] + select(way > F(0.0f), side, I(0));
    return (to_float(bound) - from) * per;
  }
  PRIMRAY_INLINE F nearest_exit() const { return min(exit(0), min(exit(1), exit(2))); }

  // Makes the cell of lanes `m` the one of that side that has the voxel `voxel`.
  PRIMRAY_INLINE void set_cell(vbool<W> m, const I (&voxel)[3], int new_side) {
    for (int a = 0; a < 3; ++a) x[a] = select(m, voxel[a] & I(-new_side), x[a]);
    side = select(m, I(new_side), side);
  }
  // Reads the cell that has the voxel x.
  PRIMRAY_INLINE void look(const GridRows<W>& grid, vbool<W> m) {
    const I voxel[3] = {x[0], x[1], x[2]}, node = grid.node(voxel[0] >> 7, voxel[1] >> 7, voxel[2] >> 7);
    const float* nodes = grid.table->node_ranges.data();
    F least = gather<W>(nodes, node << 1), most = gather<W>(nodes + 1, node << 1);
    set_cell(m, voxel, kNodeSide);
    const vbool<W> by_leaf = m & (most * (nearest_exit() - t) > thin) & (least < most);
    if (any(by_leaf)) {
      const I entry = GridRows<W>::entry(node, voxel[0] >> 3, voxel[1] >> 3, voxel[2] >> 3) << 1;
      const float* leaves = grid.table->leaf_ranges.data();
      least = select(by_leaf, gather<W>(leaves, entry), least), most = select(by_leaf, gather<W>(leaves + 1, entry), most);
      set_cell(by_leaf, voxel, kLeafSide);
      // Voxels' corners do not bound the values that velocities carry there.
      const vbool<W> by_voxel = by_leaf & (most * (nearest_exit() - t) > dense) & (least < most) & !grid.is_blurred;
      if (any(by_voxel)) {
        set_cell(by_voxel, voxel, 1);
        look_at_corners(grid, by_voxel, voxel, least, most);
      }
    }
    low = select(m, least, low), high = select(m, most, high);
    next = select(m, max(min(nearest_exit(), end), t), next);
  }

  // Sets the range of the values at the corners of cells of one voxel.
  PRIMRAY_RARE void look_at_corners(const GridRows<W>& grid, vbool<W> m, const I (&voxel)[3], F& least, F& most) const {
    F low_corner(kInfinity), high_corner(-kInfinity);
    for (int c = 0; c < 8; ++c) {
      const F value = grid.value(voxel[0] + I(c >> 2), voxel[1] + I(c >> 1 & 1), voxel[2] + I(c & 1));
      low_corner = min(low_corner, value), high_corner = max(high_corner, value);
    }
    least = select(m, low_corner, least), most = select(m, high_corner, most);
  }
};

}  // namespace primray
