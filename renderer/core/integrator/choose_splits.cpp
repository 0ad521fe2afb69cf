// A pilot: 16 x 16 pixels spread over the frame, whatever part of it is rendered, 2 x 16 samples each, once without splitting
// and once with two, four and eight.
//
// The error is what the render's own report counts, squared differences over (R^2 + 0.01), here between the two replicates,
// which are independent; the cost is rays. The pixels with the largest differences are left out: a rare bright path would
// decide alone. The pilot's samples are not used in the image, so nothing is biased by choosing on them.
#include "integrator/choose_splits.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numeric>
#include <thread>

namespace primray {
namespace {

// What may be chosen. Splitting wins only if it is clearly better, since the pilot itself is noisy.
constexpr int kChoices = 4, kSplits[kChoices] = {1, 2, 4, 8};
constexpr double kNeededGain[kChoices] = {1, 1.1, 1.15, 1.2};
constexpr int kLeftOut = 5;
// The same for every seed of a scene, so that renders that differ in seed alone take the same paths.
constexpr uint32_t kPilotSeed = 0x9d2c5680u;

struct Pilot {
  Film film{kTile, kTile};
  double rays = 0;

  Pilot(const Scene& scene, IntegratorSettings settings, int splits, TaskFunction task) {
    settings.splits = splits;
    settings.seed = kPilotSeed;
    TileBlock block{0, 0, scene.camera.width, scene.camera.height, 0, 0};
    block.stride_x = std::max(1, scene.camera.width / kTile), block.stride_y = std::max(1, scene.camera.height / kTile);
    block.x0 = block.stride_x / 2, block.y0 = block.stride_y / 2;
    for (int& n : block.count) n = kBlock;
    const auto worker = std::make_unique<Worker>();
    task(scene, settings, block, *worker, film, nullptr);
    rays = double(film.tile_rays[0]);
  }

  double mean(int replicate, int pixel, int channel) const {
    return film.mean(size_t(replicate) * kTile * kTile + pixel, channel);
  }
};

using Pilots = std::array<std::unique_ptr<Pilot>, kChoices>;

double relative_error(const Pilot& pilot, const Pilots& all) {
  std::array<double, kTile * kTile> errors{};
  for (int p = 0; p < kTile * kTile; ++p) {
    for (int c = 0; c < 3; ++c) {
      double r = 0;
      for (const auto& other : all) r += (other->mean(0, p, c) + other->mean(1, p, c)) / (2 * kChoices);
      const double d = pilot.mean(0, p, c) - pilot.mean(1, p, c);
      errors[size_t(p)] += d * d / (r * r + 0.01);
    }
  }
  std::sort(errors.begin(), errors.end());
  return std::accumulate(errors.begin(), errors.end() - kLeftOut, 0.0);
}

}  // namespace

int choose_splits(const Scene& scene, const IntegratorSettings& settings, TaskFunction task) {
  if (settings.max_depth < 2 && !scene.rays_find_light) return 1;  // nothing comes after the first surface
  Pilots pilots;
  const auto run = [&](int choice) {
    pilots[size_t(choice)] = std::make_unique<Pilot>(scene, settings, kSplits[choice], task);
  };
  // Both threads trace about as many rays.
  std::thread few([&] { set_float_mode(), run(0), run(1), run(2); });
  std::thread many([&] { set_float_mode(), run(3); });
  few.join(), many.join();
  int best = 0;
  double least = 0;
  for (int i = 0; i < kChoices; ++i) {
    const double cost = relative_error(*pilots[size_t(i)], pilots) * pilots[size_t(i)]->rays * kNeededGain[i];
    if (i == 0 || cost < least) best = i, least = cost;
  }
  return kSplits[best];
}

}  // namespace primray
