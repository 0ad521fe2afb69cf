// Pilots of one path and of two, four and eight, and one with more samples of lights.
#include "pilot/choose_splits.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <thread>

#include "pilot/pilot.hpp"

namespace primray {
namespace {

// What may be chosen; more only where it gains more than what the fit is certain of.
constexpr int kChoices = 4, kSplits[kChoices] = {1, 2, 4, 8};
constexpr double kNeededGain[kChoices] = {1, 1, 1.02, 1.04};
// Where photons guide, most of the error is rare bright paths, which a pilot does not see and splitting brings more of. Metals
// and glass, four scenes of 32 samples, six seeds: two paths 1.2 to 1.8 times the efficiency of one, pilots 0.87 to 0.97.
constexpr double kNeededGainGuided[kChoices] = {1, 0.6, 1, 1.2};
constexpr int kLightChoices = 3, kLightSamples[kLightChoices] = {1, 2, 4};
constexpr double kNeededGainLights[kLightChoices] = {1, 1.02, 1.04};
// A sample of many lights, and of lights of many triangles, costs more than a ray.
constexpr double kTreeCost = 1.2, kTrianglesCost = 2;
// Of an error no larger part is expected to be divided by samples of lights.
constexpr double kMostByLights = 0.8;
// The choice whose paths the pilot with the most samples of lights takes as well, point by point.
constexpr size_t kLit = 2;

using Errors = std::array<double, kChoices>;

// A part of the error stays, the rest is divided by the splits: the likeliest such errors for those that pilots had. By least
// sums of absolute logarithms, or one rare bright path in one pilot would decide; to leave out the worst pixels instead would
// leave out edges of shadows, of which the error of some scenes consists.
Errors fit(const Errors& found) {
  constexpr int kSteps = 64;
  constexpr double kLeastStaying = 1e-3;
  Errors best = found;
  double least = std::numeric_limits<double>::infinity();
  for (int step = 0; step <= kSteps; ++step) {
    const double stays = std::pow(kLeastStaying, 1 - double(step) / kSteps);
    Errors model, apart;
    for (size_t i = 0; i < kChoices; ++i) {
      model[i] = stays + (1 - stays) / kSplits[i];
      apart[i] = std::log(found[i] / model[i]);
    }
    Errors sorted = apart;
    std::sort(sorted.begin(), sorted.end());
    const double middle = (sorted[kChoices / 2 - 1] + sorted[kChoices / 2]) / 2;
    double sum = 0;
    for (double a : apart) sum += std::abs(a - middle);
    if (!(sum < least)) continue;
    least = sum;
    for (size_t i = 0; i < kChoices; ++i) best[i] = model[i] * std::exp(middle);
  }
  return best;
}

}  // namespace

Splits choose_splits(const Scene& scene, const IntegratorSettings& settings, TaskFunction task) {
  if (settings.max_depth < 2 && !scene.rays_find_light) return {};  // nothing comes after the first surface
  std::array<std::unique_ptr<Pilot>, kChoices> pilots;
  std::unique_ptr<Pilot> lit;
  const auto pilot = [&](int splits, int light_samples) {
    IntegratorSettings chosen = settings;
    chosen.splits = splits, chosen.light_samples = light_samples;
    return std::make_unique<Pilot>(scene, chosen, task);
  };
  // Both threads trace about as many rays.
  std::thread few([&] {
    set_float_mode();
    for (size_t i = 0; i + 1 < kChoices; ++i) pilots[i] = pilot(kSplits[i], 1);
    if (scene.lights.count > 0) lit = pilot(kSplits[kLit], kMostLightSamples);
  });
  std::thread many([&] { set_float_mode(), pilots.back() = pilot(kSplits[kChoices - 1], 1); });
  few.join(), many.join();
  std::array<const Pilot*, kChoices> all;
  for (size_t i = 0; i < kChoices; ++i) all[i] = pilots[i].get();
  const double (&needed)[kChoices] = settings.caustics ? kNeededGainGuided : kNeededGain;
  Errors errors;
  for (size_t i = 0; i < kChoices; ++i) errors[i] = relative_error(*pilots[i], all, 0);
  if (!(*std::min_element(errors.begin(), errors.end()) > 0)) return {};  // nothing is lit
  // What samples of lights divide is known apart, as both pilots have the same paths, rare bright ones too.
  double by_lights = 0, light_rays = 0;
  if (lit) {
    constexpr double kDivided = 1 - 1.0 / kMostLightSamples;
    by_lights = std::max(0.0, errors[kLit] - relative_error(*lit, all, 0)) / kDivided;
    const double cost = scene.emitters.by_triangle() ? kTrianglesCost : scene.lights.by_tree() ? kTreeCost : 1;
    light_rays = cost * (lit->rays - pilots[kLit]->rays) / (kMostLightSamples - 1);
  }
  errors = fit(errors);
  Splits best;
  double least = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < kChoices; ++i) {
    // As much of the error with fewer paths. With more it was found to be less: between as much and the same part.
    double divided = by_lights;
    if (i > kLit) divided *= (1 + errors[i] / errors[kLit]) / 2;
    divided = std::min(divided, kMostByLights * errors[i]);
    for (int j = 0; j < kLightChoices; ++j) {
      const int lights = kLightSamples[j];
      const double error = errors[i] - divided * (1 - 1.0 / lights);
      const double cost = error * (pilots[i]->rays + (lights - 1) * light_rays) * needed[i] * kNeededGainLights[j];
      if (cost < least) best = {kSplits[i], lights}, least = cost;
    }
  }
  return best;
}

}  // namespace primray
