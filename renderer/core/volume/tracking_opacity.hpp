// Opacity of grids along rays, with what is seen in them: each event adds the light that collides there, weighted by what is
// left of it (expected values of ratio tracking). Events also occur at a least rate, so that thin volumes have little variance.
#pragma once

#include "volume/albedo_lookup.hpp"
#include "volume/tracking.hpp"

namespace primray {

template <int W>
struct OpacityEvents {
  using F = vfloat<W>;
  using B = vbool<W>;
  using V = vvec3<W>;
  const GridTable* grids = nullptr;
  V k{F(0.0f)};  // extinction per unit of the grid's values and of distance
  F most{0.0f};  // its largest channel
  F greatest{0.0f}, least_rate{0.0f};
  AlbedoLookup<W> albedo;
  V left{F(1.0f)};                        // transmittance
  V colored{F(0.0f)};                     // integral of the albedo over what collides
  F weighted_distance{0.0f};              // integral of the distance, by the mean of the channels
  static constexpr float kLeast = 16;     // events in a grid's box
  static constexpr float kFaint = 1e-3f;  // transmittance below which the rest is left out

  PRIMRAY_INLINE void begin(B fresh, const GridSegment<W>& s, const AlbedoLookup<W>& of) {
    k = select(fresh, s.extinction, k), most = max_component(k);
    greatest = select(fresh, greatest_value(s, most), greatest);
    least_rate = select(fresh, kLeast / max(s.to - s.from, 1e-30f), least_rate);
    albedo.color = select(fresh, of.color, albedo.color), albedo.grid = select(fresh, of.grid, albedo.grid);
    for (int a = 0; a < 3; ++a) albedo.shift[a] = select(fresh, of.shift[a], albedo.shift[a]);
    left = select(fresh, V(F(1.0f)), left), colored = select(fresh, V(F(0.0f)), colored);
    weighted_distance = select(fresh, F(0.0f), weighted_distance);
  }
  PRIMRAY_INLINE CellSizes<W> cell_sizes() const { return CellSizes<W>::by_depth(most); }
  PRIMRAY_INLINE F rate(const CellWalk<W>& walk) const {
    return select(walk.high > F(0.0f), min(walk.high, greatest) * most + least_rate, F(0.0f));
  }
  PRIMRAY_INLINE B at_event(const GridRows<W>& grid, const CellWalk<W>& walk, const EventNumbers<W>& numbers, B event, F at) {
    const VoxelChoice<W> near = grid.voxel_at(walk.in_cell(at), numbers.voxel(), [&] { return numbers.velocity(); });
    const V collides = left * min(k * (grid.value(near.x, near.y, near.z) / max(rate(walk), 1e-30f)), 1.0f);
    colored = select(event, colored + collides * albedo.at(*grids, event, near.x, near.y, near.z), colored);
    weighted_distance += select(event, (collides.x + collides.y + collides.z) * (1.0f / 3) * at, F(0.0f));
    left = select(event, left - collides, left);
    return event & !(max_component(left) > F(kFaint));
  }
  PRIMRAY_INLINE void pass(B, const CellWalk<W>&, F) {}
};

}  // namespace primray
