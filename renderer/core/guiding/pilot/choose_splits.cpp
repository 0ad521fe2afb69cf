// Choice of path splitting by pilot renders: with one path from the first surface and with two, four and eight, and one with
// more light samples.
#include "guiding/pilot/learning.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <thread>

#include "guiding/pilot/pilot.hpp"

namespace primray {
namespace {

// Candidates; higher ones are chosen only if they gain more than the uncertainty of the fit.
constexpr int kChoices = 4, kSplits[kChoices] = {1, 2, 4, 8};
constexpr double kNeededGain[kChoices] = {1, 1, 1.02, 1.04};
// Needed gains with caustic photons, where most of the error is rare bright paths, which a pilot does not see and of which
// splitting finds more. Metals and glass, four scenes of 32 samples, six seeds: two paths have 1.2 to 1.8 times the efficiency
// of one, while pilots say 0.87 to 0.97.
constexpr double kNeededGainGuided[kChoices] = {1, 0.6, 1, 1.2};
constexpr int kLightChoices = 3, kLightSamples[kLightChoices] = {1, 2, 4};
constexpr double kNeededGainLights[kLightChoices] = {1, 1.02, 1.04};
// Cost of a light sample in rays, with many lights and with lights of many triangles.
constexpr double kTreeCost = 1.2, kTrianglesCost = 2;
// Largest share of an error that light samples are expected to divide.
constexpr double kMostByLights = 0.8;
// The candidate whose paths the pilot with the most light samples takes as well, point by point.
constexpr size_t kLit = 2;

using Errors = std::array<double, kChoices>;

// Fits a constant part of the error and a part that splits divide to the pilots' errors: by least absolute deviations of
// logarithms, since otherwise one rare bright path in one pilot would decide. Leaving out the worst pixels instead would leave
// out shadow edges, which are all of the error in some scenes.
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
  if (settings.max_depth < 2 && !scene.rays_find_light) return {};  // nothing follows the first surface
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
  // The share that light samples divide is known separately, as both pilots have the same paths, including rare bright ones.
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
    // The share for other numbers of paths: with more of them it was found to be smaller, between the same amount and the same
    // share.
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
