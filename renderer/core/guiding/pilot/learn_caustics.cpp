// Decision whether caustic photons pay, by one pilot that they guide. A pilot without them would miss the paths they exist for,
// which are as rare as they are bright. The guided pilot finds those often, and knows how much rarer each would have been: its
// contribution squared, times the ratio of both densities, is what it would have added to the error without photons.
//
// The brightest of such paths may be so rare that no picture shows them: then their light is missing, which is the error, and
// far less than their variance.
#include "guiding/pilot/learning.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <thread>
#include <vector>

#include "base/time_spans.hpp"
#include "guiding/caustic_guide.hpp"
#include "guiding/guide.hpp"
#include "guiding/pilot/caustic_photons.hpp"
#include "guiding/pilot/pilot.hpp"

namespace primray {
namespace {

// Pixels left out of both errors: those with light that photons miss as well, which would hide their gain.
constexpr int kLeftOut = 5;
// Samples of a usual picture, of a megapixel; paths that are seen less often than kRare in it are missing.
constexpr double kUsualSamples = 64e6, kRare = 20;
// Cost of photons in CPU time: 1.3 to 1.7 times as much with 2 and 8 paths from the first surface, on five scenes.
constexpr double kGuidedCost = 1.5;

// A path that the pilot found, relative to its pixel: what it brings to the mean, and how much likelier photons made it.
struct FoundPath {
  int pixel;
  double brought, ratio;

  // Increase of the error without photons, and what the path then has in its pixel where it is found.
  double adds() const { return brought * brought * (ratio - 1); }
  double alone() const { return brought * ratio; }
};

std::vector<FoundPath> found_paths(const Pilot& pilot, const GuideLog& log, double least) {
  constexpr double samples = kReplicates * kBlock;
  std::vector<FoundPath> paths;
  for (int slot = 0; slot < Worker::kSlots; ++slot) {
    if (log.counts[size_t(slot)] == 0) continue;
    const int pixel = pilot.place[size_t(slot / (kReplicates * kBlock))];
    double mean = 0;  // the pixel's colours, summed like `found`
    for (int c = 0; c < 3; ++c) mean += (pilot.mean(0, pixel, c) + pilot.mean(1, pixel, c)) / 2;
    const double scale = 1 / (samples * std::sqrt(mean * mean + 9 * least));
    for (int i = 0; i < log.counts[size_t(slot)]; ++i) {
      const GuideRecord& r = log.records[size_t(slot) * GuideLog::kMost + size_t(i)];
      const FoundPath path{pixel, double(r.found) * double(r.beta) * scale, double(r.pdf) / std::max(double(r.own_pdf), 1e-20)};
      if (path.brought > 0 && std::isfinite(path.adds())) paths.push_back(path);
    }
  }
  return paths;
}

// Error of usual pictures without photons. Leaves out the same pixels as the error with photons.
double usual_error_without(const Pilot& pilot, std::vector<FoundPath> paths, double least) {
  std::stable_sort(paths.begin(), paths.end(), [](const FoundPath& a, const FoundPath& b) { return a.alone() > b.alone(); });
  std::array<double, kTile * kTile> adds{}, missing{};
  double shown = 0;
  for (const FoundPath& path : paths) {
    shown += kUsualSamples / (kReplicates * kBlock * kTile * kTile) / path.ratio;
    if (shown < kRare)
      missing[size_t(path.pixel)] += path.brought;
    else
      adds[size_t(path.pixel)] += path.adds();
  }
  struct Errors {
    double with, without;
  };
  std::array<Errors, kTile * kTile> errors;
  const Pilot* const alone[] = {&pilot};
  for (size_t p = 0; p < errors.size(); ++p) {
    const double with = pixel_error(pilot, alone, int(p), least) / 12;
    errors[p] = {with, std::max(with + adds[p], 0.0) + missing[p] * missing[p]};
  }
  std::sort(errors.begin(), errors.end(), [](const Errors& a, const Errors& b) { return a.with < b.with; });
  double sum = 0;
  for (size_t p = 0; p + kLeftOut < errors.size(); ++p) sum += errors[p].without;
  return sum / double(errors.size() - kLeftOut);
}

bool pays(const Scene& scene, int max_depth, const CausticGuide& guide, TaskFunction task, const std::atomic<bool>* cancel) {
  const TimeSpan span("compare with and without photons");
  IntegratorSettings settings{max_depth, 1, 0, 1};
  settings.cancel = cancel;
  settings.caustics = &guide;
  GuideLog log(Worker::kSlots);
  settings.guide_log = &log;
  const Pilot pilot(scene, settings, task);
  const Pilot* alone[] = {&pilot};
  const double error = relative_error(pilot, alone, kLeftOut), least = least_square(alone);
  const std::vector<FoundPath> paths = found_paths(pilot, log, least);
  double more = 0;
  for (const FoundPath& path : paths) more += path.adds() / (kTile * kTile);
  return error * kGuidedCost < std::min(error + more, usual_error_without(pilot, paths, least));
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
