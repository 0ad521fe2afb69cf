// Bounds of a light's position and direction: boxes for rays that may hit it, and its bounds in a light tree.
#pragma once

#include "light/light.hpp"

namespace primray {

// Box around a light that rays can hit, slightly larger than rounding requires.
LightBox light_box(const float* row);
// The same box with all that a tree needs of any light; its intensity is in the units of light_importance().
LightBounds light_bounds(const LightTable& table, const float* row);

}  // namespace primray
