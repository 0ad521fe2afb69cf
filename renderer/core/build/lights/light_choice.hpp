// Light trees for scenes with too many lights to weigh each at every vertex.
#pragma once

#include "light/light.hpp"

namespace primray {

void build_light_choice(LightTable& table);

}  // namespace primray
