// Values of grids at positions in lanes; each lane may read another grid.
#pragma once

#include <cstddef>

#include "math/lane_checks.hpp"
#include "volume/grid_table.hpp"

namespace primray {

// 16-bit floats (IEEE 754 binary16) in the low bits of `h`, exactly; renders flush denormals, which those of halves are not.
template <int W>
PRIMRAY_INLINE vfloat<W> from_half(vint<W> h) {
  const vint<W> size = h & vint<W>(0x7fff);
  const vfloat<W> normal = bit_cast<vfloat<W>>((size << 13) + vint<W>(112 << 23));
  const vfloat<W> value = select(size < vint<W>(1 << 10), to_float(size) * 0x1p-24f, normal);
  return select((h & vint<W>(0x8000)) != vint<W>(0), -value, value);
}

// The voxel at which interpolation is sampled at `p` by numbers `u` in [0, 1): one of the eight around it, each with its weight
// as probability. The mean of the values is that of trilinear interpolation, so estimators that are linear in the value stay
// unbiased at an eighth of the reads (Hofmann and Evans 2021, "Efficient Unbiased Volume Path Tracing on the GPU").
template <int W>
struct VoxelChoice {
  vint<W> x, y, z;
  PRIMRAY_INLINE VoxelChoice(const vvec3<W>& p, const vvec3<W>& u)
      : x(along(p.x, u.x)), y(along(p.y, u.y)), z(along(p.z, u.z)) {}

 private:
  static PRIMRAY_INLINE vint<W> along(vfloat<W> p, vfloat<W> u) {
    const vint<W> below = floor_to_int(p);
    return below - minus_one_where(u < p - to_float(below));
  }
};

// Rows of grids, one per lane, at the times of rays.
template <int W>
struct GridRows {
  const GridTable* table;
  vint<W> first[3], along[3], node_base, channels;
  vbool<W> is_half;
  // Of blurred grids: the row of the velocities, and the time since the frame.
  vbool<W> is_blurred{false};
  vint<W> velocity{0}, velocity_shift[3] = {vint<W>(0), vint<W>(0), vint<W>(0)};
  vfloat<W> since{0.0f};

  PRIMRAY_INLINE GridRows(const GridTable& t, vint<W> grid, vfloat<W> time) : GridRows(t, grid) {
    if (t.any_blurred) set_blur(grid, time);
  }
  PRIMRAY_INLINE GridRows(const GridTable& t, vint<W> grid) : table(&t) {
    PRIMRAY_ASSERT(are_rows(grid, t.rows.size()));
    static_assert(sizeof(GridTable::Row) % sizeof(int32_t) == 0);
    const auto* base = reinterpret_cast<const int32_t*>(t.rows.data());
    const vint<W> row = grid * vint<W>(int32_t(sizeof(GridTable::Row) / sizeof(int32_t)));
    for (int a = 0; a < 3; ++a) first[a] = gather<W>(base + a, row), along[a] = gather<W>(base + 3 + a, row);
    node_base = gather<W>(base + 6, row), channels = gather<W>(base + 7, row);
    is_half = gather<W>(base + 8, row) != vint<W>(0);
  }

  // Number of the node at (x, y, z), in units of nodes; 0, which holds zeros, outside the grid's box.
  PRIMRAY_INLINE vint<W> node(vint<W> x, vint<W> y, vint<W> z) const {
    const vint<W> i = x - first[0], j = y - first[1], k = z - first[2], zero(0);
    const vbool<W> inside = (i >= zero) & (j >= zero) & (k >= zero) & (i < along[0]) & (j < along[1]) & (k < along[2]);
    return gather<W>(table->node_of.data(), select(inside, node_base + (i * along[1] + j) * along[2] + k, zero));
  }
  // Entry of the leaf at (x, y, z), in units of leaves, in a node's arrays.
  static PRIMRAY_INLINE vint<W> entry(vint<W> node, vint<W> x, vint<W> y, vint<W> z) {
    const vint<W> low(kNodeLeaves - 1);
    return (node << 12) + ((x & low) << 8) + ((y & low) << 4) + (z & low);
  }
  // Value of the voxel at (x, y, z); of grids with one channel.
  PRIMRAY_INLINE vfloat<W> value(vint<W> x, vint<W> y, vint<W> z) const { return number(block(x, y, z) + voxel(x, y, z)); }
  // Color of the voxel at (x, y, z); grids with one channel are gray.
  PRIMRAY_INLINE vvec3<W> color(vint<W> x, vint<W> y, vint<W> z) const {
    const vint<W> at = block(x, y, z) + voxel(x, y, z) * channels,
                  step = select(channels == vint<W>(1), vint<W>(0), vint<W>(1));
    return {number(at), number(at + step), number(at + step + step)};
  }
  // Returns the voxel at which interpolation is sampled at `p` by numbers `u`. Blurred grids take further numbers, `more()`,
  // for the voxel whose velocity displaces `p`.
  template <class More>
  PRIMRAY_INLINE VoxelChoice<W> voxel_at(const vvec3<W>& p, const vvec3<W>& u, const More& more) const {
    if (table->any_blurred && any(is_blurred)) return VoxelChoice<W>(displaced(p, more()), u);
    return VoxelChoice<W>(p, u);
  }

 private:
  PRIMRAY_RARE void set_blur(vint<W> grid, vfloat<W> time) {
    static_assert(offsetof(GridTable::Row, velocity) == 18 * sizeof(int32_t));
    const auto* base = reinterpret_cast<const int32_t*>(table->rows.data());
    const vint<W> row = grid * vint<W>(int32_t(sizeof(GridTable::Row) / sizeof(int32_t)));
    const vint<W> of = gather<W>(base + 18, row);
    is_blurred = of >= vint<W>(0), velocity = max(of, vint<W>(0));
    for (int a = 0; a < 3; ++a) velocity_shift[a] = gather<W>(base + 19 + a, row);
    since = time - bit_cast<vfloat<W>>(gather<W>(base + 22, row));
  }
  // Returns where the value that is at `p` now is in the grid, by the velocity of a voxel that the numbers `u` choose.
  PRIMRAY_RARE vvec3<W> displaced(const vvec3<W>& p, const vvec3<W>& u) const {
    const VoxelChoice<W> near(p, u);
    const vvec3<W> v =
        GridRows<W>(*table, velocity).color(near.x + velocity_shift[0], near.y + velocity_shift[1], near.z + velocity_shift[2]);
    return select(is_blurred, p - v * since, p);
  }
  // Index of the first value of the block that has the voxel at (x, y, z).
  PRIMRAY_INLINE vint<W> block(vint<W> x, vint<W> y, vint<W> z) const {
    return gather<W>(table->leaf_of.data(), entry(node(x >> 7, y >> 7, z >> 7), x >> 3, y >> 3, z >> 3)) << 9;
  }
  // Number of the voxel at (x, y, z) within its block.
  static PRIMRAY_INLINE vint<W> voxel(vint<W> x, vint<W> y, vint<W> z) {
    const vint<W> low(kLeafSide - 1);
    return ((x & low) << 6) + ((y & low) << 3) + (z & low);
  }
  PRIMRAY_INLINE vfloat<W> number(vint<W> at) const {
    vfloat<W> r(0.0f);
    if (any(is_half)) {
      const vint<W> i = select(is_half, at, vint<W>(0));
      const vint<W> two = gather<W>(reinterpret_cast<const int32_t*>(table->halves.data()), i >> 1);
      r = from_half(select((i & vint<W>(1)) != vint<W>(0), (two >> 16), two) & vint<W>(0xffff));
    }
    if (!all(is_half)) r = select(is_half, r, gather<W>(table->floats.data(), select(is_half, vint<W>(0), at)));
    return r;
  }
};

}  // namespace primray
