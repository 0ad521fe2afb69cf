// The trees by which lights are chosen where there are too many of them to weigh each at every vertex.
#pragma once

#include "light/light.hpp"

namespace primray {

void build_light_choice(LightTable& table);

}  // namespace primray
