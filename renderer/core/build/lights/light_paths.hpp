// The path of a light that moves, and the ball about all that it passes.
#pragma once

#include "build/inputs/light_input.hpp"
#include "light/light.hpp"

namespace primray {

// Notes that what `light` added to the table moves: rows from `first_row` on, and domes from `first_dome` on.
void add_light_path(const LightInput& light, const dvec3& origin, double scale, int first_row, size_t first_dome,
                    LightTable& table);

}  // namespace primray
