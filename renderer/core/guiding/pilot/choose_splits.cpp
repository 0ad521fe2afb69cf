// Choice of path splitting by pilot renders: with one path from the first surface and with two, four and eight, and one with
// more light samples.
#include "guiding/pilot/learning.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <thread>

#include "base/time_spans.hpp"
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
// Share of what light samples divide that the most of them take away.
constexpr double kDivided = 1 - 1.0 / kMostLightSamples;
// The candidate whose paths the pilot with the most light samples takes as well, point by point.
constexpr size_t kLit = 2;

// Where there are volumes, pilots can cost more than a small picture, and rare bright paths in the few pixels at lights are an
// error that neither splits divide nor pilots see. There more paths are tried only if they may pay by the pilots with one and
// two: by what they gain at most, and as the product of error and cost is convex in the number of paths.
//
// N paths cost r + (n - 1) b rays, for r of one path and b behind its first vertex, and divide an error by n at most, so they
// gain less than r / b times: 1.14 in endless fog, where 1 to 8 paths were found to have one efficiency; 1.45 to 4 in clouds.
constexpr double kLeastGain = 1.25;
constexpr double kCostlier = 1.1;

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

bool has_volumes(const Scene& scene) {
  return scene.volumes || !scene.interiors.volumes.empty() || scene.interiors.fog.extinction > 0;
}

// Returns whether more paths than one may pay, by the pilots with one and with two.
bool may_gain(const Pilot& one, const Pilot& two) {
  const double behind = two.rays - one.rays;
  if (one.rays < kLeastGain * behind) return false;
  const Pilot* const both[] = {&one, &two};
  return relative_error(two, both, 0) * two.rays <= kCostlier * relative_error(one, both, 0) * one.rays;
}

// Returns the cost of a light sample in rays, by pilots with the most light samples and with one.
double cost_of_light_sample(const Scene& scene, const Pilot& lit, const Pilot& plain) {
  const double cost = scene.emitters.by_triangle() ? kTrianglesCost : scene.lights.by_tree() ? kTreeCost : 1;
  return cost * (lit.rays - plain.rays) / (kMostLightSamples - 1);
}

// The candidate with the least product of error and cost, times the gain that it needs.
class BestSplits {
 public:
  Splits best;

  explicit BestSplits(double cost_of_light_sample) : light_rays_(cost_of_light_sample) {}
  // Offers a number of paths with all numbers of light samples, which divide the part `divided` of the error.
  void offer(int splits, double error, double divided, double rays, double needed) {
    for (int j = 0; j < kLightChoices; ++j) {
      const int lights = kLightSamples[j];
      const double remaining = error - divided * (1 - 1.0 / lights);
      const double cost = remaining * (rays + (lights - 1) * light_rays_) * needed * kNeededGainLights[j];
      if (cost < least_) best = {splits, lights}, least_ = cost;
    }
  }

 private:
  double light_rays_, least_ = std::numeric_limits<double>::infinity();
};

// Returns the part of a pilot's error that light samples divide, by a pilot that differs only in having the most of them.
double divided_by_lights(double plain_error, double lit_error) { return std::max(0.0, plain_error - lit_error) / kDivided; }

// Chooses the number of light samples for one path, by pilots with one light sample and with the most.
Splits choose_light_samples(const Scene& scene, const Pilot& plain, const Pilot& lit) {
  const Pilot* const both[] = {&plain, &lit};
  const double error = relative_error(plain, both, 0), divided = divided_by_lights(error, relative_error(lit, both, 0));
  BestSplits choice(cost_of_light_sample(scene, lit, plain));
  choice.offer(1, error, std::min(divided, kMostByLights * error), plain.rays, 1);
  return choice.best;
}

}  // namespace

Splits choose_splits(const Scene& scene, const IntegratorSettings& settings, TaskFunction task) {
  if (settings.max_depth < 2 && !scene.rays_find_light) return {};  // nothing follows the first surface
  std::array<std::unique_ptr<Pilot>, kChoices> pilots;
  std::unique_ptr<Pilot> lit;
  const auto pilot = [&](int splits, int light_samples) {
    const TimeSpan span("pilot that chooses splits");
    IntegratorSettings chosen = settings;
    chosen.splits = splits, chosen.light_samples = light_samples;
    return std::make_unique<Pilot>(scene, chosen, task);
  };
  // Where hair is what is hard, most of a path's rays are behind its first vertex, and most of the error is which strand it is
  // on and where. Splits could gain 1.3 at most, and pilots do not see so little.
  if (!scene.surfaces.hair.empty()) {
    std::thread([&] { set_float_mode(), pilots[0] = pilot(kSplits[0], 1); }).join();
    if (is_error_of_fibres(*pilots[0])) return {};
  }
  if (has_volumes(scene)) {
    std::thread one([&] {
      set_float_mode();
      if (!pilots[0]) pilots[0] = pilot(kSplits[0], 1);
    });
    std::thread two([&] { set_float_mode(), pilots[1] = pilot(kSplits[1], 1); });
    one.join(), two.join();
    if (!may_gain(*pilots[0], *pilots[1])) {
      if (scene.lights.count == 0) return {};
      std::thread([&] { set_float_mode(), lit = pilot(1, kMostLightSamples); }).join();
      return choose_light_samples(scene, *pilots[0], *lit);
    }
  }
  // Both threads trace about as many rays.
  std::thread few([&] {
    set_float_mode();
    for (size_t i = 0; i + 1 < kChoices; ++i)
      if (!pilots[i]) pilots[i] = pilot(kSplits[i], 1);
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
    by_lights = divided_by_lights(errors[kLit], relative_error(*lit, all, 0));
    light_rays = cost_of_light_sample(scene, *lit, *pilots[kLit]);
  }
  errors = fit(errors);
  BestSplits choice(light_rays);
  for (size_t i = 0; i < kChoices; ++i) {
    // The share for other numbers of paths: with more of them it was found to be smaller, between the same amount and the same
    // share.
    double divided = by_lights;
    if (i > kLit) divided *= (1 + errors[i] / errors[kLit]) / 2;
    choice.offer(kSplits[i], errors[i], std::min(divided, kMostByLights * errors[i]), pilots[i]->rays, needed[i]);
  }
  return choice.best;
}

}  // namespace primray
