// Outlines of lights that the camera sees, by pixel: a bright light covers part of such a pixel, perhaps a small one, and most
// of the pixel's error comes from that share. There the path loop samples the light with extra rays, through the part of the
// pixel where it can be (integrator/outline_rays.hpp). The list only affects the error, not the expected image.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace primray {

struct LightOutlines {
  // A light in a pixel of this column: all of it that is inside the pixel is within these film sample values.
  struct Part {
    int32_t x, light;
    float u, v, width, height;
  };
  std::vector<Part> parts;    // row by row, by x and light
  std::vector<int32_t> rows;  // first part of each row of the frame, and the end; empty: no outlines

  bool any() const { return !parts.empty(); }
  std::span<const Part> at(int x, int y) const {
    if (y < 0 || size_t(y) + 1 >= rows.size()) return {};
    const auto first = parts.begin() + rows[size_t(y)], end = parts.begin() + rows[size_t(y) + 1];
    const auto [a, b] = std::equal_range(first, end, Part{x, 0, 0, 0, 0, 0}, [](auto& p, auto& q) { return p.x < q.x; });
    return {a, b};
  }
};

}  // namespace primray
