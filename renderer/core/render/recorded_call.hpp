// Rays of a recorded call as arguments of a kernel.
#pragma once

#include "base/flush_denormals.hpp"
#include "ray/rays.hpp"

namespace primray {

// Reads them from 9 W floats.
template <int W>
Rays<W> rays_of(const float* p) {
  const auto field = [&](int f) { return load<W>(p + f * W); };
  return {{field(0), field(1), field(2)}, {field(3), field(4), field(5)}, field(6), field(7), field(8)};
}

template <int W>
vbool<W> active_of(uint32_t mask) {
  vint<W> lanes;
  for (int i = 0; i < W; ++i) lanes.set(i, -int32_t(mask >> i & 1));
  return vbool<W>(lanes.v);
}

}  // namespace primray
