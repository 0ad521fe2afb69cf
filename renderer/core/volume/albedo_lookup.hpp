// Albedo of media at voxels, in lanes: a colour, times that of a grid where a medium has one.
#pragma once

#include "volume/grid_lookup.hpp"
#include "volume/volume_table.hpp"

namespace primray {

template <int W>
struct AlbedoLookup {
  vvec3<W> color{vfloat<W>(0.0f)};
  vint<W> grid{-1};  // multiplied voxel by voxel; -1: none
  vint<W> shift[3] = {vint<W>(0), vint<W>(0), vint<W>(0)};

  // All lanes are in one medium.
  PRIMRAY_INLINE static AlbedoLookup of(const VolumeTable::Medium& medium) {
    using F = vfloat<W>;
    using I = vint<W>;
    const auto& [r, g, b] = medium.albedo;
    const auto& [x, y, z] = medium.albedo_shift;
    return {{F(r), F(g), F(b)}, I(medium.albedo_grid), {I(x), I(y), I(z)}};
  }
  // Albedo at the voxel (x, y, z) of the medium's density, in lanes `m`.
  PRIMRAY_INLINE vvec3<W> at(const GridTable& grids, vbool<W> m, vint<W> x, vint<W> y, vint<W> z) const {
    const vbool<W> varies = m & (grid >= vint<W>(0));
    if (!any(varies)) return color;
    const GridRows<W> rows(grids, select(varies, grid, vint<W>(0)));
    return select(varies, color * rows.color(x + shift[0], y + shift[1], z + shift[2]), color);
  }
};

}  // namespace primray
