// One pilot without splitting, one with two, one with four and one with eight.
#include "integrator/choose_splits.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <thread>

#include "integrator/pilot.hpp"

namespace primray {
namespace {

// What may be chosen; more only where it gains more than what the fit is certain of.
constexpr int kChoices = 4, kSplits[kChoices] = {1, 2, 4, 8};
constexpr double kNeededGain[kChoices] = {1, 1, 1.02, 1.04};
// Where photons guide, most of the error is rare bright paths, which a pilot does not see and splitting brings more of. Metals
// and glass, four scenes of 32 samples, six seeds: two paths 1.2 to 1.8 times the efficiency of one, pilots 0.87 to 0.97.
constexpr double kNeededGainGuided[kChoices] = {1, 0.6, 1, 1.2};

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

int choose_splits(const Scene& scene, const IntegratorSettings& settings, TaskFunction task) {
  if (settings.max_depth < 2 && !scene.rays_find_light) return 1;  // nothing comes after the first surface
  std::array<std::unique_ptr<Pilot>, kChoices> pilots;
  const auto run = [&](int choice) {
    IntegratorSettings chosen = settings;
    chosen.splits = kSplits[choice];
    pilots[size_t(choice)] = std::make_unique<Pilot>(scene, chosen, task);
  };
  // Both threads trace about as many rays.
  std::thread few([&] { set_float_mode(), run(0), run(1), run(2); });
  std::thread many([&] { set_float_mode(), run(3); });
  few.join(), many.join();
  std::array<const Pilot*, kChoices> all;
  for (int i = 0; i < kChoices; ++i) all[size_t(i)] = pilots[size_t(i)].get();
  const double (&needed)[kChoices] = settings.caustics ? kNeededGainGuided : kNeededGain;
  Errors errors;
  for (size_t i = 0; i < kChoices; ++i) errors[i] = relative_error(*pilots[i], all, 0);
  if (!(*std::min_element(errors.begin(), errors.end()) > 0)) return 1;  // nothing is lit
  errors = fit(errors);
  int best = 0;
  double least = 0;
  for (int i = 0; i < kChoices; ++i) {
    const double cost = errors[size_t(i)] * pilots[size_t(i)]->rays * needed[i];
    if (i == 0 || cost < least) best = i, least = cost;
  }
  return kSplits[best];
}

}  // namespace primray
