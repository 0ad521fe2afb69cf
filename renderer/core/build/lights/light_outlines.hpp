// Search for the outlines of lights in the frame.
#pragma once

#include "scene/light_outline_table.hpp"

namespace primray {

struct Scene;

// Requires the finished scene, as it tests visibility of the lights.
LightOutlines find_light_outlines(const Scene& scene);

}  // namespace primray
