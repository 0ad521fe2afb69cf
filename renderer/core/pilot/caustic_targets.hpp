// What photons aim at: bounding balls of what has a smooth surface.
#pragma once

#include <vector>

#include "scene/scene.hpp"

namespace primray {

// Lobes up to this width (roughness 0.41) make caustics that scattered rays do not find by themselves. Rough metals and glass
// under a sun of five degrees, 32 samples, four seeds: relMSE x CPU 0.87 of that with 0.05.
inline constexpr float kCasterAlpha = 0.17f;

struct CausticTarget {
  vec3 center;
  float radius;
};

std::vector<CausticTarget> caustic_targets(const Scene& scene);

}  // namespace primray
