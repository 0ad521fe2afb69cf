// Turns a light's input into a row of the LightTable, in the core's space.
#pragma once

#include "scene/builder.hpp"

namespace primray {

void add_light_rows(const LightInput& light, const dvec3& origin, double scale, LightTable& table);
// After the last light: what depends on all of them.
void finish_light_rows(LightTable& table);

}  // namespace primray
