// Film: the accumulated state of a render. Exact sums of samples per pixel and replicate with their counts, and the progress of
// each tile.
//
// Sums are exact (exact_sum.hpp), so tiles can be rendered in any order, in parts, on several machines, and be continued or
// merged to the same bits. A thread that writes a tile's pixels holds its lock.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "base/assert.hpp"
#include "film/deep_film.hpp"
#include "film/exact_sum.hpp"

namespace primray {

// Independent randomised halves of every pixel's samples, by which the variance of the mean is measured.
constexpr int kReplicates = 2;
constexpr int kTile = 16;  // pixels across

// Exact sums of values in a fixed order: see `Film::parts` and `Film::bins`.
struct PixelSums {
  std::vector<int64_t> parts;  // value, (high, low)
  std::vector<int8_t> bins;

  void resize(size_t values) { parts.resize(2 * values), bins.resize(values, int8_t(kLowestBin)); }
  bool any() const { return !bins.empty(); }
  ExactSum at(size_t i) const { return {parts[2 * i], parts[2 * i + 1], bins[i]}; }
  void add(size_t i, const ExactSum& term) {
    ExactSum s = at(i);
    s.add(term);
    parts[2 * i] = s.high, parts[2 * i + 1] = s.low, bins[i] = int8_t(s.bin);
  }
};

// Walks below surfaces that no pixel resolves (integrator/nested_media.hpp): by shape, as the plane "prim" of first hits
// numbers it, the longest of them in widths of a pixel.
using UnseenWalks = std::map<int32_t, float>;

// Light that is sampled but left out of the image, by reason: the clamp of indirect light, or caustics that are off.
enum Removal : int { kClamped, kCaustics, kRemovals };

struct Film {
  static constexpr int kColors = 3;
  // Memory of the arrays per pixel.
  static constexpr size_t kPixelBytes =
      kReplicates * (kColors * (2 * sizeof(int64_t) + 1) + sizeof(uint32_t) + sizeof(int64_t));
  // Coverage of a fully covered sample; fractions are rounded to these units, so that sums are exact.
  static constexpr int64_t kCovered = 1 << 24;
  int width, height, tiles_x, tiles_y;
  std::vector<int64_t> parts;    // replicate, y, x, color, (high, low)
  std::vector<int8_t> bins;      // replicate, y, x, color
  std::vector<uint32_t> counts;  // replicate, y, x
  std::vector<int64_t> covered;  // replicate, y, x: coverage of samples, in units of 1 / kCovered
  // Progress of each tile: the next sample's index; and its number of rays, as a measure of its cost.
  std::vector<uint32_t> next;  // replicate, tile
  std::vector<int64_t> tile_rays;
  // Light path expressions (lpe/): like `parts`, in the same bins, with the expression first, so that those of a partition
  // add up to `parts` to the last digit.
  int expressions = 0;
  std::vector<int64_t> routed;
  // Light left out of `parts`, by pixel and colour as there, where it is counted.
  std::array<PixelSums, kRemovals> removed;
  std::unique_ptr<DeepFilm> deep;  // null: no deep picture
  std::atomic<int64_t> camera_rays{0}, scattered_rays{0}, shadow_rays{0}, invalid_samples{0}, samples{0};
  // Not in checkpoints: of the samples that this process rendered.
  UnseenWalks unseen_walks;
  std::mutex unseen_walks_lock;

  std::array<std::mutex, 64> locks;

  // `removals`: one bit for each Removal that is counted.
  Film(int w, int h, int expression_count = 0, int removals = 0);
  int tiles() const { return tiles_x * tiles_y; }
  std::mutex& lock_of(int tile) { return locks[size_t(tile) % locks.size()]; }
  size_t pixels() const { return size_t(width) * height; }
  size_t at(int replicate, int x, int y) const {
    PRIMRAY_ASSERT(replicate >= 0 && replicate < kReplicates && x >= 0 && x < width && y >= 0 && y < height);
    return (size_t(replicate) * height + y) * width + x;
  }

  ExactSum sum(size_t pixel, int color) const {
    const size_t i = pixel * kColors + color;
    return {parts[2 * i], parts[2 * i + 1], bins[i]};
  }
  void add(size_t pixel, int color, const ExactSum& term) {
    const size_t i = pixel * kColors + color;
    ExactSum s = sum(pixel, color);
    s.add(term);
    parts[2 * i] = s.high, parts[2 * i + 1] = s.low, bins[i] = int8_t(s.bin);
  }
  size_t routed_at(int expression, size_t pixel, int color) const {
    return 2 * ((size_t(expression) * counts.size() + pixel) * kColors + size_t(color));
  }
  ExactSum routed_sum(int expression, size_t pixel, int color) const {
    const size_t i = routed_at(expression, pixel, color);
    return {routed[i], routed[i + 1], bins[pixel * kColors + size_t(color)]};
  }
  // Adds the part of a pixel's samples that matches each expression, in the bin of the samples; before these are added.
  void add_lpe_sums(size_t pixel, int color, const ExactSum* terms) {
    for (int e = 0; e < expressions; ++e) {
      const size_t i = routed_at(e, pixel, color);
      ExactSum s{routed[i], routed[i + 1], bins[pixel * kColors + size_t(color)]};
      s.add(terms[e]);
      routed[i] = s.high, routed[i + 1] = s.low;
    }
  }
  // A replicate's mean, 0 without samples.
  double mean(size_t pixel, int color) const { return counts[pixel] ? sum(pixel, color).value() / counts[pixel] : 0.0; }

  // Keeps the longest walk of each shape.
  void note_unseen(const UnseenWalks& walks) {
    const std::lock_guard lock(unseen_walks_lock);
    for (const auto& [shape, pixels] : walks) unseen_walks[shape] = std::max(unseen_walks[shape], pixels);
  }

  // Adds what another film of the same image accumulated from other samples.
  void merge(const Film& other);
};

// A pixel's colour, the replicates' mean weighted by their samples, and a difference of them, sqrt(w_0 w_1) (a - b), whose
// expected square is the mean's variance if a replicate's variance is proportional to 1 / weight. `exposure` multiplies
// colours.
struct PixelEstimate {
  double mean[Film::kColors], difference[Film::kColors];
  double coverage;
  bool measured;  // both replicates have samples
};
PixelEstimate estimate_pixel(const Film& film, size_t pixel, double exposure);
// Estimate of the light that matches an expression.
PixelEstimate estimate_lpe(const Film& film, int expression, size_t pixel, double exposure);
// Estimate of the light that is left out of a pixel.
PixelEstimate estimate_removed(const Film& film, Removal why, size_t pixel, double exposure);

}  // namespace primray
