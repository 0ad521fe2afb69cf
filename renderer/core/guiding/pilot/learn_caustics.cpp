// Decision whether caustic photons pay, by one pilot that they guide. A pilot without them would miss the paths they exist for,
// which are as rare as they are bright. The guided pilot finds those often, and knows how much rarer each would have been: its
// contribution squared, times the ratio of both densities, is what it would have added to the error without photons.
#include "guiding/pilot/learning.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>

#include "base/time_spans.hpp"
#include "guiding/caustic_guide.hpp"
#include "guiding/guide.hpp"
#include "guiding/pilot/caustic_photons.hpp"
#include "guiding/pilot/pilot.hpp"

namespace primray {
namespace {

// Pixels left out of both errors: those with light that photons miss as well, which would hide their gain.
constexpr int kLeftOut = 5;
// Cost of photons in CPU time: 1.3 to 1.7 times as much with 2 and 8 paths from the first surface, on five scenes.
constexpr double kGuidedCost = 1.4;

// Increase of the error (pilot.hpp's) for paths that photons did not guide.
double error_without(const Pilot& pilot, const GuideLog& log) {
  double sum = 0;
  for (int slot = 0; slot < Worker::kSlots; ++slot) {
    if (log.counts[size_t(slot)] == 0) continue;
    const int pixel = pilot.place[size_t(slot / (kReplicates * kBlock))];
    double all = 0;  // the pixel's colours, summed like `found`
    for (int c = 0; c < 3; ++c) all += (pilot.mean(0, pixel, c) + pilot.mean(1, pixel, c)) / 2;
    double more = 0;
    for (int i = 0; i < log.counts[size_t(slot)]; ++i) {
      const GuideRecord& r = log.records[size_t(slot) * GuideLog::kMost + size_t(i)];
      const double brought = double(r.found) * double(r.beta), ratio = double(r.pdf) / std::max(double(r.own_pdf), 1e-20);
      const double gain = brought * brought * (ratio - 1) / (all * all + 9 * 0.01);
      if (std::isfinite(gain)) more += gain;
    }
    sum += more;
  }
  const double samples = kReplicates * kBlock;
  return sum / (samples * samples * kTile * kTile);
}

bool pays(const Scene& scene, int max_depth, const CausticGuide& guide, TaskFunction task, const std::atomic<bool>* cancel) {
  const TimeSpan span("compare with and without photons");
  IntegratorSettings settings{max_depth, 1, 0, 1};
  settings.cancel = cancel;
  settings.caustics = &guide;
  GuideLog log(Worker::kSlots);
  settings.guide_log = &log;
  const Pilot pilot(scene, settings, task);
  const Pilot* whole[] = {&pilot};
  const double error = relative_error(pilot, whole, kLeftOut);
  return error * kGuidedCost < error + error_without(pilot, log);
}

}  // namespace

std::unique_ptr<CausticGuide> find_caustics(const Scene& scene, int max_depth, int threads, const std::atomic<bool>* cancel) {
  if (max_depth < 2) return nullptr;
  std::vector<CausticPhoton> photons = trace_photons(scene, max_depth, threads, cancel);
  if (photons.empty()) return nullptr;
  auto guide = std::make_unique<CausticGuide>();
  build_caustic_tree(photons, *guide, threads);
  return guide->any() ? std::move(guide) : nullptr;
}

std::unique_ptr<CausticGuide> learn_caustics(const Scene& scene, int max_depth, int threads, TaskFunction task,
                                             const std::atomic<bool>* cancel) {
  std::unique_ptr<CausticGuide> guide = find_caustics(scene, max_depth, threads, cancel);
  if (!guide) return nullptr;
  bool worth = false;
  std::thread([&] { set_float_mode(), worth = pays(scene, max_depth, *guide, task, cancel); }).join();
  return worth ? std::move(guide) : nullptr;
}

}  // namespace primray
