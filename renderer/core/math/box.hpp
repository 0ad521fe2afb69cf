// Axis-aligned bounding boxes, initially empty.
#pragma once

#include <algorithm>

#include "math/vec3.hpp"

namespace primray {

template <class T>
struct BoxOf {
  Vec3<T> low{INFINITY, INFINITY, INFINITY}, high{-INFINITY, -INFINITY, -INFINITY};
  void add(const Vec3<T>& p) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  void add(const BoxOf& b) { add(b.low), add(b.high); }
  bool any() const { return low.x <= high.x; }
};

using Box = BoxOf<float>;
using DoubleBox = BoxOf<double>;

}  // namespace primray
