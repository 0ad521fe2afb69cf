// Makes Embree scenes of a Scene's groups: prototypes first, then the top scene with what is static and all placements.
#pragma once

#include "scene/scene.hpp"

namespace primray {

// Fills groups[].accel. Positions, indices, spheres and matrices are shared with Embree, so the Scene must not move or grow
// after.
void build_accel(Scene& scene);

}  // namespace primray
