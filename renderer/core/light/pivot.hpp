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

// Mean phase function of the scene's media by the angle at which a ray passes a light: from -pi/2, where the light is straight
// ahead, to pi/2, where it is straight behind. Constant in cells; empty where all media scatter about evenly.
struct PhaseByAngle {
  static constexpr int kCells = 128;
  static constexpr float kWidth = 3.14159265f / kCells;
  // Share of an even choice: another medium than the mean one may be where the light is.
  static constexpr float kEvenShare = 0.1f;
  std::vector<float> value;   // relative to isotropic scattering
  std::vector<float> before;  // integral up to each cell, and over all
  // For quick weights: the phase function of Henyey and Greenstein with the mean of the mean cosines, as scale / q^(3/2), and
  // its integral over all angles.
  float mean_cosine = 0, scale = 0, most = 0;

  bool any() const { return !value.empty(); }
};

struct PivotTable {
  // Beyond this number of lights, weighing each for every ray costs more than it saves.
  static constexpr int kMost = 1024;
  std::vector<Pivot> pivots;
  std::vector<int32_t> of_light;  // by row; -1: it is not sampled along rays
  PhaseByAngle phase;

  bool any() const { return !pivots.empty(); }
};

}  // namespace primray
