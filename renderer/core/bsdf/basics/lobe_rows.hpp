// Where the rows of W lanes stand in a table of what a model's lobes are made of.
#pragma once

#include "math/vec3.hpp"

namespace primray {

template <int W>
struct LobeRows {
  const float* rows;
  vint<W> base;
  PRIMRAY_INLINE vfloat<W> operator()(int field) const { return gather<W>(rows + field, base); }
  // Three of these in one; no color is a row's last.
  PRIMRAY_INLINE vvec3<W> color(int field) const {
    const FourLanes<float, W> c = gather_four<W>(rows + field, base);
    return {c.x, c.y, c.z};
  }
};

}  // namespace primray
