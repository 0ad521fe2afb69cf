// Boxes along the axes, empty at first.
#pragma once

#include <algorithm>

#include "math/vec3.hpp"

namespace primray {

struct Box {
  vec3 low{INFINITY, INFINITY, INFINITY}, high{-INFINITY, -INFINITY, -INFINITY};
  void add(const vec3& p) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  void add(const Box& b) { add(b.low), add(b.high); }
  bool any() const { return low.x <= high.x; }
};

}  // namespace primray
