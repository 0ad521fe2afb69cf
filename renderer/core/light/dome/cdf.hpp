// Lookup in cumulative distributions, by lane.
#pragma once

#include <vector>

#include "math/vec3.hpp"

namespace primray {

// Returns the last i in [0, n) with cdf[base + i] <= u, for cdf ascending from 0.
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

// Returns the same index by a guide table from add_cuts(), of pieces + 1 numbers from `cut_base` on. Chen and Asau 1974, "On
// Generating Random Variates from an Empirical Distribution".
template <int W>
PRIMRAY_INLINE vint<W> find_interval(const float* cdf, vint<W> base, const int32_t* cuts, vint<W> cut_base, int pieces,
                                     vfloat<W> u) {
  const vint<W> piece = cut_base + truncate(u * float(pieces));
  vint<W> lo = gather<W>(cuts, piece), hi = gather<W>(cuts + 1, piece);
  while (any(lo < hi)) {
    const vint<W> mid = (lo + hi + vint<W>(1)) >> 1;
    const vbool<W> below = gather<W>(cdf, base + mid) <= u;
    lo = select(below, mid, lo), hi = select(below, hi, mid - vint<W>(1));
  }
  return lo;
}

// Number of pieces: a power of two, so that u * pieces is exact.
inline int pieces_of(int n) { return n < 8 ? 1 : 1 << (28 - __builtin_clz(unsigned(n))); }
// Appends the guide table: the positions of 0, 1 / pieces, ... 1 in a distribution of n.
inline void add_cuts(const float* cdf, int n, std::vector<int32_t>& cuts) {
  const int pieces = pieces_of(n);
  int i = 0;
  for (int k = 0; k <= pieces; ++k) {
    while (i + 1 < n && cdf[i + 1] <= float(k) / float(pieces)) ++i;
    cuts.push_back(i);
  }
}

}  // namespace primray
