// Indices of dispersive glass at three wavelengths, one per channel: 611, 549 and 464 nm, at the primaries of Rec.709.
#pragma once

#include "math/lanes.hpp"

namespace primray {

constexpr double per_square(double nm) { return 1 / (nm * nm); }
constexpr double kDispersionRange = per_square(486.1) - per_square(656.3);  // of the Fraunhofer lines F and C
constexpr float channel_at(double nm) { return float((per_square(nm) - per_square(587.6)) / kDispersionRange); }
constexpr float kChannels[3] = {channel_at(611), channel_at(549), channel_at(464)};

// Value for each lane's channel: 0, 1 or 2.
template <int W>
PRIMRAY_INLINE vfloat<W> channel_of(vint<W> k) {
  using F = vfloat<W>;
  return select(k == vint<W>(0), F(kChannels[0]), select(k == vint<W>(1), F(kChannels[1]), F(kChannels[2])));
}

// Cauchy's formula: n = n_d + (n_d - 1) / V (1 / l^2 - 1 / l_d^2) / (1 / l_F^2 - 1 / l_C^2), from `index` n_d, 1 / V, and a
// value of kChannels.
template <int W>
PRIMRAY_INLINE vfloat<W> dispersed_index(vfloat<W> index, vfloat<W> inverse_abbe, vfloat<W> channel) {
  return index + (index - 1.0f) * inverse_abbe * channel;
}

}  // namespace primray
