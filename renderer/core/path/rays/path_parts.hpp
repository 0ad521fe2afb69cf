// Parts of a split path: each carries an equal share of the throughput, and they take consecutive indices of a sample sequence
// that is `parts` times longer.
#pragma once

#include "path/rays/pool.hpp"

namespace primray {

// Returns one of `parts` parts in lanes `split`, not yet numbered; other lanes keep the path.
template <int W>
PRIMRAY_INLINE PathLanes<W> part_of(const PathLanes<W>& p, vbool<W> split, int parts) {
  PathLanes<W> part = p;
  part.beta = select(split, p.beta * (1.0f / float(parts)), p.beta);
  return part;
}

// Makes `part` the k-th of its path.
template <int W>
PRIMRAY_INLINE void number_part(PathLanes<W>& part, const PathLanes<W>& p, vbool<W> split, int parts, int k) {
  const vuint<W> number = reverse_bits(p.sampler.reversed_index) * vuint<W>(uint32_t(parts)) + vuint<W>(uint32_t(k));
  part.sampler.reversed_index = select(split, reverse_bits(number), p.sampler.reversed_index);
}

}  // namespace primray
