// Pilot render: 16 x 16 pixels spread over the whole frame, whatever part of it is rendered, with 2 x 16 samples each, to
// measure the benefit of a sampling choice. Its samples are not used in the image, so choices based on them cause no bias.
//
// The error is that of the render's own report, squared differences over R^2 and a term for dark pixels, here between the two
// replicates, which are independent; the cost is the number of rays.
#pragma once

#include <algorithm>
#include <array>
#include <memory>
#include <numeric>
#include <span>

#include "render/task_function.hpp"

namespace primray {

struct Pilot {
  // Seed of all pilots, whatever the render's seed, so that renders that differ only in their seed make the same choices.
  static constexpr uint32_t kSeed = 0x9d2c5680u;

  Film film{kTile, kTile};
  double rays = 0;
  std::array<bool, kTile * kTile> shows_fibres{};  // by index in the film
  std::array<int, kTile * kTile> place{};          // index in the film, in the order in which its pixels are sampled

  // Pilots of different `number` have different pixels and sample points. One that is cancelled is black.
  Pilot(const Scene& scene, IntegratorSettings settings, TaskFunction task, int number = 0) {
    if (settings.is_cancelled()) return;
    settings.seed = kSeed + uint32_t(number);
    TileBlock block{0, 0, scene.camera.width, scene.camera.height, 0, 0};
    block.stride_x = std::max(1, scene.camera.width / kTile), block.stride_y = std::max(1, scene.camera.height / kTile);
    block.x0 = (block.stride_x / 2 + number * 7) % block.stride_x,
    block.y0 = (block.stride_y / 2 + number * 5) % block.stride_y;
    for (int& n : block.count) n = kBlock;
    const auto worker = std::make_unique<Worker>();
    task(scene, settings, block, *worker, film, nullptr);
    rays = double(film.tile_rays[0]);
    for (size_t i = 0; i < place.size(); ++i) {
      place[i] = worker->pixel_y[i] * kTile + worker->pixel_x[i];
      shows_fibres[size_t(place[i])] = worker->shows_fibres[i];
    }
  }

  double mean(int replicate, int pixel, int channel) const {
    return film.mean(size_t(replicate) * kTile * kTile + pixel, channel);
  }
};

// Term of the relative error's denominator that keeps black pixels from ruling it: the report's 0.01, or the squared mean of
// pictures that are darker than that, whatever exposure will show them at.
inline double least_square(std::span<const Pilot* const> all) {
  double sum = 0;
  for (const Pilot* pilot : all)
    for (int r = 0; r < kReplicates; ++r)
      for (int p = 0; p < kTile * kTile; ++p)
        for (int c = 0; c < 3; ++c) sum += pilot->mean(r, p, c);
  const double mean = sum / (3.0 * kTile * kTile * kReplicates * double(all.size()));
  return std::clamp(mean * mean, 1e-30, 0.01);
}

// Relative squared difference of pixel `p`, summed over channels; R from all pilots. `least`: see least_square().
inline double pixel_error(const Pilot& pilot, std::span<const Pilot* const> all, int p, double least) {
  double error = 0;
  for (int c = 0; c < 3; ++c) {
    double r = 0;
    for (const Pilot* other : all) r += (other->mean(0, p, c) + other->mean(1, p, c)) / double(2 * all.size());
    const double d = pilot.mean(0, p, c) - pilot.mean(1, p, c);
    error += d * d / (r * r + least);
  }
  return error;
}

// Error of a pilot's image per pixel and channel; R from all pilots. `left_out`: number of pixels with the largest differences
// that are left out, where a single rare bright path would decide.
inline double relative_error(const Pilot& pilot, std::span<const Pilot* const> all, int left_out) {
  const double least = least_square(all);
  std::array<double, kTile * kTile> errors{};
  for (int p = 0; p < kTile * kTile; ++p) errors[size_t(p)] = pixel_error(pilot, all, p, least);
  std::sort(errors.begin(), errors.end());
  return std::accumulate(errors.begin(), errors.end() - left_out, 0.0) / (12.0 * double(int(errors.size()) - left_out));
}

// Share of the error that pixels which show no hair must have for paths to split, or for a guide to be learnt.
constexpr double kLeastBesideFibres = 0.1;

// Whether nearly all of a pilot's error is in pixels that show hair.
inline bool is_error_of_fibres(const Pilot& pilot) {
  const Pilot* const alone[] = {&pilot};
  const double least = least_square(alone);
  double all = 0, beside = 0;
  for (int p = 0; p < kTile * kTile; ++p) {
    const double error = pixel_error(pilot, alone, p, least);
    all += error;
    if (!pilot.shows_fibres[size_t(p)]) beside += error;
  }
  return beside < kLeastBesideFibres * all;
}

}  // namespace primray
