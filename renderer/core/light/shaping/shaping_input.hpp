// Input of UsdLux ShapingAPI for one light.
#pragma once

#include "math/vec3.hpp"

namespace primray {

struct ShapingInput {
  double focus = 0;
  vec3 focus_tint;
  double cone_angle_deg = 180, cone_softness = 0;
  int ies = -1;  // result of add_ies_profile()
  double ies_angle_scale = 0, ies_divisor = 1;
};

}  // namespace primray
