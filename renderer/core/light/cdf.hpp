// Looking up a cumulative distribution by lane.
#pragma once

#include "math/vec3.hpp"

namespace primray {

// The last i in [0, n) with cdf[base + i] <= u, for cdf ascending from 0.
template <int W>
PRIMRAY_INLINE vint<W> find_interval(const float* cdf, vint<W> base, int n, vfloat<W> u) {
  vint<W> lo(0);
  for (int step = 1 << (31 - __builtin_clz(unsigned(n))); step > 0; step >>= 1) {
    const vint<W> mid = lo + vint<W>(step);
    const vbool<W> inside = mid < vint<W>(n);
    const vfloat<W> c = gather<W>(cdf, base + select(inside, mid, vint<W>(0)));
    lo = select(inside & (c <= u), mid, lo);
  }
  return lo;
}

}  // namespace primray
