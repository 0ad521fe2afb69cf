// Finds where in the frame lights end.
#pragma once

#include "scene/light_outline_table.hpp"

namespace primray {

struct Scene;

// Needs the finished scene, as it asks what hides a light.
LightOutlines find_light_outlines(const Scene& scene);

}  // namespace primray
