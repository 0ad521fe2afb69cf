// Targets of caustic photons: bounding spheres of objects with smooth surfaces.
#pragma once

#include <vector>

#include "scene/scene.hpp"

namespace primray {

// Largest alpha (roughness 0.41) of lobes that cast caustics which scattered rays do not find. Rough metals and glass under a
// sun of five degrees, 32 samples, four seeds: relMSE x CPU time is 0.87 of that with 0.05.
inline constexpr float kCasterAlpha = 0.17f;

struct CausticTarget {
  vec3 center;
  float radius;
};

std::vector<CausticTarget> caustic_targets(const Scene& scene);

}  // namespace primray
