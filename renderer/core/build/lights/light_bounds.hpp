// What is known of where a light's row lies and looks: boxes for rays that may meet it, and what a tree chooses it by.
#pragma once

#include "light/light.hpp"

namespace primray {

// What holds a light that rays can meet, a little larger than rounding needs.
LightBox light_box(const float* row);
// The same with all that a tree needs to know of any light; its intensity in the units of light_importance.
LightBounds light_bounds(const LightTable& table, const float* row);

}  // namespace primray
