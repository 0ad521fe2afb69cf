// Lights that are sampled along camera rays through media.
#include "build/lights/lights.hpp"

#include <algorithm>
#include <cmath>

namespace primray {
namespace {

// Whether volumes or fog scatter light. The boxes of many grids are not tested one by one.
bool scatters(const Scene& scene) {
  if (scene.volumes && scene.volumes->in_media.size() > kFewVolumes) return false;
  const auto any = [](const vec3& v) { return std::max({v.x, v.y, v.z}) > 0; };
  const Interiors& interiors = scene.interiors;
  return (scene.volumes && scene.volumes->in_media.any()) || (interiors.fog.extinction > 0 && interiors.fog.scatters()) ||
         std::any_of(interiors.volumes.begin(), interiors.volumes.end(), [&](const Volume& v) { return any(v.scattering); });
}

}  // namespace

void find_pivots(Scene& scene) {
  LightTable& lights = scene.lights;
  lights.pivots = {};
  if (!scatters(scene) || lights.count > PivotTable::kMost || lights.links.any()) return;
  lights.pivots.of_light.assign(size_t(lights.count), -1);
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
    lights.pivots.of_light[size_t(i)] = int32_t(lights.pivots.pivots.size());
    lights.pivots.pivots.push_back(pivot);
  }
}

}  // namespace primray
