// Points of emission in grids, as light samples. A cell is chosen by its greatest value times its volume, and a point of it
// uniformly. Rays that cross the emission have events there at a rate that is proportional to the same greatest value
// (volume/tracking_emission.hpp), so both techniques have one ratio of densities along a ray, c r^2 at distance r: a sample is
// like one of a surface with that density per solid angle, whose radiance is the emission by the rate.
#pragma once

#include "light/types/light_row.hpp"
#include "sampler/sampler.hpp"
#include "volume/grid_lookup.hpp"
#include "volume/next_volume.hpp"

namespace primray {

// Samples points of the emission that `light` is, seen from `from` at `time`, in lanes `m`, by the numbers `u`, `v` and `bits`.
template <int W>
PRIMRAY_RARE void sample_volume_point(const VolumeTable& volumes, vbool<W> m, vint<W> light, const vvec3<W>& from,
                                      vuint<W> bits_, vfloat<W> u, vfloat<W> v, vfloat<W> time, LightSample<W>& s) {
  using F = vfloat<W>;
  using I = vint<W>;
  const I instance = gather<W>(volumes.instance_of_light.data(), select(m, light, I(light[__builtin_ctz(bits(m))])));
  const auto emission = [&](int k) {
    const I row = gather<W>(volumes.in_emissions.of.data(), instance);
    return gather<W>(reinterpret_cast<const int32_t*>(volumes.emissions.data()) + k, row * I(6));
  };
  static_assert(sizeof(VolumeTable::Emission) == 6 * sizeof(int32_t) && sizeof(VolumeTable::Cell) == 5 * sizeof(int32_t));

  // Choose a cell
  const F choice = unit_float(bits_);
  I first = emission(1), count = emission(2);
  while (any(m & (count > I(1)))) {
    const I half = count >> 1;
    // The first half's last cell.
    const vbool<W> before = choice < gather<W>(volumes.cell_cdf.data(), first + max(half, I(1)) - I(1));
    const vbool<W> splits = count > I(1);
    first = select(splits & !before, first + half, first), count = select(splits, select(before, half, count - half), count);
  }
  const auto cell = [&](int k) { return gather<W>(reinterpret_cast<const int32_t*>(volumes.cells.data()) + k, first * I(5)); };
  const F side = to_float(cell(3)), most = bit_cast<F>(cell(4));

  // Choose a point of it, and a voxel around that
  const auto more = [&](uint32_t k) { return unit_float(mix(bits_ ^ vuint<W>(k * 0x9e3779b9u))); };
  const vvec3<W> p{to_float(cell(0)) + u * side, to_float(cell(1)) + v * side, to_float(cell(2)) + more(1) * side};
  const GridRows<W> grid(volumes.grids, emission(0), time);
  const VoxelChoice<W> near =
      grid.voxel_at(p, {more(2), more(3), more(4)}, [&] { return vvec3<W>(more(5), more(6), more(7)); });
  const vvec3<W> color = grid.color(near.x, near.y, near.z);

  // Compute its direction and radiance
  const EmissionPlaces<W> places(volumes, m, instance, time);
  const vvec3<W> to = places.core_from_grid.vector(p) + places.core_from_grid.o - from;
  const F d2 = max(dot(to, to), 1e-30f), d = sqrt(d2);
  const vvec3<W> radiance{bit_cast<F>(emission(3)), bit_cast<F>(emission(4)), bit_cast<F>(emission(5))};
  const vvec3<W> wi = to * (1.0f / d);
  const F part = emitting_part(volumes, m, instance, from, wi, time);
  const vvec3<W> L = radiance * color * (part / (most * gather<W>(volumes.events_per_value.data(), instance)));
  s.wi = select(m, wi, s.wi), s.t = select(m, d, s.t), s.L = select(m, L, s.L);
  s.pdf = select(m, places.relative_density * part * d2, s.pdf);
  s.is_delta &= !m;
}

}  // namespace primray
