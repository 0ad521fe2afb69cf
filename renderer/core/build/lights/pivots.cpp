// Lights that are sampled along camera rays through media.
#include "build/lights/lights.hpp"

#include <algorithm>
#include <cmath>

namespace primray {
namespace {

// Beyond this number of lights, weighing each for every ray costs more than it saves.
constexpr int kMostPivots = 1024;

}  // namespace

void find_pivots(Scene& scene) {
  LightTable& lights = scene.lights;
  lights.pivots.clear();
  const bool scatters = scene.volumes && scene.volumes->in_media.any() && scene.volumes->in_media.size() <= kFewVolumes;
  if (!scatters || lights.count > kMostPivots || lights.links.any()) return;
  for (int i = 0; i < lights.count; ++i) {
    const LightBounds bounds = light_bounds(lights, lights.row(i));
    if (bounds.far || !(bounds.intensity > 0)) continue;
    Pivot pivot;
    pivot.center = {bounds.center[0], bounds.center[1], bounds.center[2]};
    pivot.radius2 = bounds.least2, pivot.power = bounds.intensity, pivot.light = i;
    pivot.axis = {bounds.axis[0], bounds.axis[1], bounds.axis[2]}, pivot.apex = pivot.center, pivot.cos_end = 0;
    if (bounds.directed() && bounds.cos_end > 0.05f && bounds.cos_end < 1) {
      // The cone that a light of that size fills begins behind it.
      const float sine = std::sqrt(std::max(1 - bounds.cos_end * bounds.cos_end, 1e-12f));
      pivot.cos_end = bounds.cos_end, pivot.apex = pivot.center - pivot.axis * (bounds.radius / sine);
    }
    lights.pivots.push_back(pivot);
  }
}

}  // namespace primray
