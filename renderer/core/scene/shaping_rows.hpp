// Turns a light's shaping and photometric profiles into rows of the ShapingTable.
#pragma once

#include <span>

#include "light/light.hpp"

namespace primray {

// A photometric profile: angles in degrees, ascending, two or more of each; `candela` by horizontal angle. See light/ies.hpp.
struct IesInput {
  std::span<const float> vertical_deg, horizontal_deg, candela;
  bool horizontal_pole = false;
};

struct ShapingInput {
  double focus = 0;
  vec3 focus_tint;
  double cone_angle_deg = 180, cone_softness = 0;
  int ies = -1;  // what add_ies_profile gave
  double ies_angle_scale = 0, ies_divisor = 1;
};

int add_ies(const IesInput& profile, IesTable& table);
// For the light of `row`, whose other fields are there; the row then has its number.
void add_shaping(const ShapingInput& shaping, const daffine& world_from_light, float* row, LightTable& table);

}  // namespace primray
