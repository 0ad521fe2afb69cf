// Bilinear interpolation of a light's image, rows of three floats per texel.
#pragma once

#include "math/vec3.hpp"

namespace primray {

// Texels before and after a coordinate in texels (the centre of the first is at 0.5), and the weight of the second.
template <int W>
struct BilinearAxis {
  vint<W> first, second;
  vfloat<W> weight;

  // Clamps at the edges.
  PRIMRAY_INLINE BilinearAxis(vfloat<W> at, int size) {
    const vfloat<W> x = at - 0.5f;
    const vint<W> i = floor_to_int(x), last(size - 1);
    weight = x - to_float(i);
    first = min(max(i, 0), last), second = min(max(i + vint<W>(1), 0), last);
  }
  // Wraps around: the first texel follows the last; `at` is in [0, size).
  PRIMRAY_INLINE static BilinearAxis around(vfloat<W> at, int size) {
    BilinearAxis r(at, size);
    const vint<W> i = floor_to_int(at - 0.5f), count(size);
    r.first = select(i < vint<W>(0), i + count, i);
    r.second = select(i + vint<W>(1) >= count, vint<W>(0), i + vint<W>(1));
    return r;
  }
};

template <int W>
PRIMRAY_INLINE vvec3<W> read_bilinear(const float* texels, int width, const BilinearAxis<W>& x, const BilinearAxis<W>& y) {
  const vint<W> y0 = y.first * vint<W>(width), y1 = y.second * vint<W>(width);
  const auto channel = [&](int c) {
    const auto at = [&](vint<W> row, vint<W> column) { return gather<W>(texels + c, (row + column) * vint<W>(3)); };
    const vfloat<W> top = at(y0, x.first) * (1.0f - x.weight) + at(y0, x.second) * x.weight;
    const vfloat<W> bottom = at(y1, x.first) * (1.0f - x.weight) + at(y1, x.second) * x.weight;
    return top * (1.0f - y.weight) + bottom * y.weight;
  };
  return {channel(0), channel(1), channel(2)};
}

}  // namespace primray
