// Rows of W lanes in a table of lobe parameters.
#pragma once

#include "math/vec3.hpp"

namespace primray {

template <int W>
struct LobeRows {
  const float* rows;
  vint<W> base;
  PRIMRAY_INLINE vfloat<W> operator()(int field) const { return gather<W>(rows + field, base); }
  // Reads three columns at once; no colour is the last of a row.
  PRIMRAY_INLINE vvec3<W> color(int field) const {
    const FourLanes<float, W> c = gather_four<W>(rows + field, base);
    return {c.x, c.y, c.z};
  }
};

}  // namespace primray
