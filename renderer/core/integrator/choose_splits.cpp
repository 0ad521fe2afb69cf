// A pilot: 16 x 16 pixels spread over the frame, whatever part of it is rendered, 2 x 16 samples each, without splitting and
// with ever more of it as long as that wins.
//
// The error is what the render's own report counts, squared differences over (R^2 + 0.01), here between the two replicates,
// which are independent; the cost is rays. The pilot's samples are not used in the image, so nothing is biased by choosing on
// them.
#include "integrator/choose_splits.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <thread>

namespace primray {
namespace {

// Splitting wins only if it is clearly better, since the pilot itself is noisy.
constexpr double kNeededGain = 1.1;
// More would leave a packet of camera rays too little room in the pool.
constexpr int kMostSplits = 8;
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

double relative_error(const Pilot& pilot, const Pilot& other) {
  double sum = 0;
  for (int p = 0; p < kTile * kTile; ++p) {
    for (int c = 0; c < 3; ++c) {
      const double a = pilot.mean(0, p, c), b = pilot.mean(1, p, c);
      const double r = 0.25 * (a + b + other.mean(0, p, c) + other.mean(1, p, c));
      sum += (a - b) * (a - b) / (r * r + 0.01);
    }
  }
  return sum;
}

}  // namespace

int choose_splits(const Scene& scene, const IntegratorSettings& settings, TaskFunction task) {
  if (settings.max_depth < 2 && !scene.rays_find_light) return 1;  // nothing comes after the first surface
  std::unique_ptr<Pilot> fewer, more;
  std::thread first([&] { set_float_mode(), fewer = std::make_unique<Pilot>(scene, settings, 1, task); });
  std::thread second([&] { set_float_mode(), more = std::make_unique<Pilot>(scene, settings, 2, task); });
  first.join(), second.join();
  int splits = 1;
  while (relative_error(*more, *fewer) * more->rays * kNeededGain < relative_error(*fewer, *more) * fewer->rays) {
    splits *= 2;
    if (splits == kMostSplits) break;
    fewer = std::move(more);
    std::thread next([&] { set_float_mode(), more = std::make_unique<Pilot>(scene, settings, 2 * splits, task); });
    next.join();
  }
  return splits;
}

}  // namespace primray
