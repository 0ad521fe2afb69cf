// Where lights end that the camera sees, pixel by pixel: a bright light covers a part of such a pixel, perhaps a small one, and
// most of the pixel's error is about how much. There the path loop looks for the light by rays of their own, through the part
// of the pixel where it can be (path/outline_rays.hpp). What is listed shows in the error alone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace primray {

struct LightOutlines {
  // A light in a pixel of this column: all of it that is there lies within these numbers of the pixel's film sample.
  struct Part {
    int32_t x, light;
    float u, v, width, height;
  };
  std::vector<Part> parts;    // row by row, by x and light
  std::vector<int32_t> rows;  // the first of each row of the frame, and the end; empty: nowhere

  bool any() const { return !parts.empty(); }
  std::span<const Part> at(int x, int y) const;
};

}  // namespace primray
