// Parts of a path that splits: each carries its share, and they take the numbers after each other in a sequence so much longer.
#pragma once

#include "path/rays/pool.hpp"

namespace primray {

// One of `parts` in lanes `split`, without a number yet; elsewhere the path itself.
template <int W>
PRIMRAY_INLINE PathLanes<W> part_of(const PathLanes<W>& p, vbool<W> split, int parts) {
  PathLanes<W> part = p;
  part.beta = select(split, p.beta * (1.0f / float(parts)), p.beta);
  return part;
}

// Makes it the k-th.
template <int W>
PRIMRAY_INLINE void number_part(PathLanes<W>& part, const PathLanes<W>& p, vbool<W> split, int parts, int k) {
  const vuint<W> number = reverse_bits(p.sampler.reversed_index) * vuint<W>(uint32_t(parts)) + vuint<W>(uint32_t(k));
  part.sampler.reversed_index = select(split, reverse_bits(number), p.sampler.reversed_index);
}

}  // namespace primray
