// Lights as they are seen from segments of rays (light/sampler/segment_choice.hpp).
#pragma once

#include <cstdint>
#include <vector>

#include "math/vec3.hpp"

namespace primray {

struct Pivot {
  vec3 center;
  float radius2;  // squared radius within which the light no longer grows
  float power;
  vec3 axis, apex;  // of the cone that it reaches
  float cos_end;    // of the cone's half angle; 0: it reaches all directions
  int32_t light;    // row
};

struct PivotTable {
  // Beyond this number of lights, weighing each for every ray costs more than it saves.
  static constexpr int kMost = 1024;
  std::vector<Pivot> pivots;
  std::vector<int32_t> of_light;  // by row; -1: it is not sampled along rays

  bool any() const { return !pivots.empty(); }
};

}  // namespace primray
