// See film.hpp.
#include "film/film.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace primray {

Film::Film(int w, int h)
    : width(w),
      height(h),
      tiles_x((w + kTile - 1) / kTile),
      tiles_y((h + kTile - 1) / kTile),
      parts(size_t(kReplicates) * w * h * kColors * 2),
      bins(size_t(kReplicates) * w * h * kColors, int8_t(kLowestBin)),
      counts(size_t(kReplicates) * w * h),
      covered(size_t(kReplicates) * w * h),
      next(size_t(kReplicates) * tiles_x * tiles_y),
      tile_rays(size_t(tiles_x) * tiles_y) {}

void Film::merge(const Film& other) {
  if (other.width != width || other.height != height)
    throw Error("settings-error", "films of different resolutions cannot be merged");
  for (size_t p = 0; p < counts.size(); ++p) {
    for (int c = 0; c < kColors; ++c) add(p, c, other.sum(p, c));
    counts[p] += other.counts[p], covered[p] += other.covered[p];
  }
  for (size_t i = 0; i < next.size(); ++i) next[i] = std::max(next[i], other.next[i]);
  for (size_t i = 0; i < tile_rays.size(); ++i) tile_rays[i] += other.tile_rays[i];
  camera_rays += other.camera_rays, scattered_rays += other.scattered_rays, shadow_rays += other.shadow_rays;
  invalid_samples += other.invalid_samples, samples += other.samples;
}

PixelEstimate estimate_pixel(const Film& film, size_t pixel, double exposure) {
  const size_t other = pixel + film.pixels();
  const double n[] = {double(film.counts[pixel]), double(film.counts[other])}, total = n[0] + n[1];
  PixelEstimate e{};
  if (total == 0) return e;
  e.measured = n[0] > 0 && n[1] > 0;
  // Chosen by chance, what passes straight through may outweigh a sample here and there.
  e.coverage = std::clamp(double(film.covered[pixel] + film.covered[other]) / double(Film::kCovered) / total, 0.0, 1.0);
  const double w = n[0] / total;
  for (int c = 0; c < Film::kColors; ++c) {
    const double a = film.mean(pixel, c) * exposure, b = film.mean(other, c) * exposure;
    e.mean[c] = w * a + (1 - w) * b;
    e.difference[c] = std::sqrt(w * (1 - w)) * (a - b);
  }
  return e;
}

}  // namespace primray
