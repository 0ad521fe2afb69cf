// Estimates and merging of film.hpp.
#include "film/film.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace primray {

Film::Film(int w, int h, int expression_count, int removals)
    : width(w),
      height(h),
      tiles_x((w + kTile - 1) / kTile),
      tiles_y((h + kTile - 1) / kTile),
      parts(size_t(kReplicates) * w * h * kColors * 2),
      bins(size_t(kReplicates) * w * h * kColors, int8_t(kLowestBin)),
      counts(size_t(kReplicates) * w * h),
      covered(size_t(kReplicates) * w * h),
      next(size_t(kReplicates) * tiles_x * tiles_y),
      tile_rays(size_t(tiles_x) * tiles_y),
      expressions(expression_count),
      routed(size_t(expression_count) * kReplicates * w * h * kColors * 2) {
  for (int why = 0; why < kRemovals; ++why)
    if (removals >> why & 1) removed[size_t(why)].resize(bins.size());
}

void Film::merge(const Film& other) {
  if (other.width != width || other.height != height)
    throw Error("settings-error", "films of different resolutions cannot be merged");
  if (other.expressions != expressions)
    throw Error("settings-error", "films of different light path expressions cannot be merged");
  for (size_t why = 0; why < kRemovals; ++why)
    if (other.removed[why].bins.size() != removed[why].bins.size())
      throw Error("settings-error", "films that leave out different light cannot be merged");
  if (deep || other.deep) throw Error("settings-error", "films of deep pictures cannot be merged");
  std::vector<ExactSum> terms(size_t(expressions), ExactSum{});
  for (size_t p = 0; p < counts.size(); ++p) {
    for (int c = 0; c < kColors; ++c) {
      for (int e = 0; e < expressions; ++e) terms[size_t(e)] = other.routed_sum(e, p, c);
      add_lpe_sums(p, c, terms.data());
      add(p, c, other.sum(p, c));
    }
    for (size_t why = 0; why < kRemovals; ++why)
      for (size_t i = p * kColors; removed[why].any() && i < (p + 1) * kColors; ++i)
        removed[why].add(i, other.removed[why].at(i));
    counts[p] += other.counts[p], covered[p] += other.covered[p];
  }
  for (size_t i = 0; i < next.size(); ++i) next[i] = std::max(next[i], other.next[i]);
  for (size_t i = 0; i < tile_rays.size(); ++i) tile_rays[i] += other.tile_rays[i];
  camera_rays += other.camera_rays, scattered_rays += other.scattered_rays, shadow_rays += other.shadow_rays;
  invalid_samples += other.invalid_samples, samples += other.samples;
  note_unseen(other.unseen_walks);
}

namespace {

// `sum(pixel, color)`: selects the sums.
template <class Sum>
PixelEstimate estimate(const Film& film, size_t pixel, double exposure, const Sum& sum) {
  const auto mean = [&](size_t p, int color) { return film.counts[p] ? sum(p, color).value() / film.counts[p] : 0.0; };
  const size_t other = pixel + film.pixels();
  const double n[] = {double(film.counts[pixel]), double(film.counts[other])}, total = n[0] + n[1];
  PixelEstimate e{};
  if (total == 0) return e;
  e.measured = n[0] > 0 && n[1] > 0;
  // Chosen at random, light that passes straight through may exceed a sample now and then.
  e.coverage = std::clamp(double(film.covered[pixel] + film.covered[other]) / double(Film::kCovered) / total, 0.0, 1.0);
  const double w = n[0] / total;
  for (int c = 0; c < Film::kColors; ++c) {
    const double a = mean(pixel, c) * exposure, b = mean(other, c) * exposure;
    e.mean[c] = w * a + (1 - w) * b;
    e.difference[c] = std::sqrt(w * (1 - w)) * (a - b);
  }
  return e;
}

}  // namespace

PixelEstimate estimate_pixel(const Film& film, size_t pixel, double exposure) {
  return estimate(film, pixel, exposure, [&](size_t p, int color) { return film.sum(p, color); });
}

PixelEstimate estimate_lpe(const Film& film, int expression, size_t pixel, double exposure) {
  return estimate(film, pixel, exposure, [&](size_t p, int color) { return film.routed_sum(expression, p, color); });
}

PixelEstimate estimate_removed(const Film& film, Removal why, size_t pixel, double exposure) {
  const PixelSums& sums = film.removed[why];
  return estimate(film, pixel, exposure, [&](size_t p, int color) { return sums.at(p * Film::kColors + size_t(color)); });
}

}  // namespace primray
