// Lights that are sampled along camera rays through media.
#include "build/lights/lights.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "medium/phase_function.hpp"

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

// The numbers of all phase functions.
std::vector<float> phases_of(const Scene& scene) {
  std::vector<float> found;
  const Interiors& interiors = scene.interiors;
  if (interiors.fog.extinction > 0 && interiors.fog.scatters()) found.push_back(interiors.fog.phase);
  for (const Volume& v : interiors.volumes) found.push_back(v.phase);
  if (scene.volumes)
    for (const VolumeTable::Medium& medium : scene.volumes->media) found.push_back(medium.phase);
  return found;
}

// Least mean cosine that counts.
constexpr double kLeastCosine = 0.5;

// Phase functions relative to isotropic scattering: Henyey and Greenstein's, and any.
double relative_peak(double g, double cosine) { return henyey_greenstein_at(1 + g * g - 2 * g * cosine, g, 1.0f); }
double relative_density(float phase, double cosine) {
  if (!(phase > 1)) return relative_peak(double(phase), cosine);
  return double(phase_density(vfloat<1>(float(cosine)), vfloat<1>(phase))[0]) / double(kInvFourPi);
}

PhaseByAngle phase_by_angle(const std::vector<float>& phases) {
  PhaseByAngle r;
  std::vector<double> mean_cosines;
  for (const float phase : phases) mean_cosines.push_back(double(mean_cosine(vfloat<1>(phase))[0]));
  const auto counts = [](double g) { return std::abs(g) > kLeastCosine; };
  if (std::none_of(mean_cosines.begin(), mean_cosines.end(), counts)) return r;
  constexpr int kSteps = 16;
  constexpr double kWidth = PhaseByAngle::kWidth, kEven = PhaseByAngle::kEvenShare;
  const double count = double(mean_cosines.size());
  const double g = std::accumulate(mean_cosines.begin(), mean_cosines.end(), 0.0) / count;
  r.mean_cosine = float(g), r.scale = float((1 - kEven) * (1 - g * g));
  double sum = 0, most = 0;
  for (int cell = 0; cell < PhaseByAngle::kCells; ++cell) {
    double value = 0;
    for (int step = 0; step < kSteps; ++step) {
      const double cosine = std::cos(kWidth * (cell + (step + 0.5) / kSteps));
      for (const float phase : phases) value += relative_density(phase, cosine) / (kSteps * count);
      most += (1 - kEven) * relative_peak(g, cosine) * kWidth / kSteps;
    }
    r.value.push_back(float(kEven + (1 - kEven) * value)), r.before.push_back(float(sum));
    sum += double(r.value.back()) * kWidth;
  }
  r.before.push_back(float(sum)), r.most = float(most);
  return r;
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
  if (lights.pivots.any()) lights.pivots.phase = phase_by_angle(phases_of(scene));
}

}  // namespace primray
