// Path of a light that moves, and the bounding sphere of that path.
#pragma once

#include "build/inputs/light_input.hpp"
#include "light/light.hpp"

namespace primray {

// Records that the rows and domes that `light` added to the table move: rows from `first_row` on, and domes from `first_dome`
// on.
void add_light_path(const LightInput& light, const dvec3& origin, double scale, int first_row, size_t first_dome,
                    LightTable& table);

}  // namespace primray
