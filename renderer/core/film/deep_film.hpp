// Deep pictures: what a pixel's samples hit, by depth along the camera's axis, so that other pictures can be put between.
//
// Depth is divided into cells of a relative size, the tolerance. A pixel has exact sums (exact_sum.hpp) of the light and the
// coverage of each cell in which its samples ended, of surfaces and of volumes apart. Cells, sums and extents do not depend on
// the order of samples; nor does the bound on memory: a pixel with more cells than allowed has them joined two by two, so that
// its cells are always the finest of which there are few enough.
#pragma once

#include <cmath>
#include <vector>

#include "film/exact_sum.hpp"

namespace primray {

// Keys of cells: twice the cell's number, and 1 more for what is in a volume. 0: none.
constexpr int kFarCell = (1 << 15) - 1;
constexpr int32_t kFarKey = 2 * kFarCell;  // light behind everything, which covers nothing
constexpr float kFarDepth = 1e30f;

// Division of depth into cells, which begin at (1 + tolerance)^n scene units.
struct DepthCells {
  static constexpr double kFinest = 0.001;  // finer cells would have too few numbers for depths of 1e-7 to 1e7
  double per_log;
  explicit DepthCells(double tolerance) : per_log(1 / std::log1p(tolerance)) {}

  int32_t key(float depth, bool in_volume) const {
    const double cell = depth > 0 ? std::floor(std::log(double(depth)) * per_log) + kMiddle : 1.0;
    return 2 * int32_t(std::min(std::max(cell, 1.0), double(kFarCell - 1))) + int32_t(in_volume);
  }
  // Depth at which a cell begins.
  double begin(int cell) const { return std::exp((cell - kMiddle) / per_log); }

 private:
  static constexpr int kMiddle = 1 << 14;
};

// Sums of one cell.
struct DeepSum {
  int32_t key = 0;
  float nearest = 0, farthest = 0;  // depths of what was hit
  int8_t bins[3] = {kLowestBin, kLowestBin, kLowestBin};
  int64_t covered = 0;    // as Film::covered
  int64_t parts[6] = {};  // color, (high, low)

  ExactSum color(int c) const { return {parts[2 * c], parts[2 * c + 1], bins[c]}; }
  void add_color(int c, const ExactSum& term) {
    ExactSum s = color(c);
    s.add(term);
    parts[2 * c] = s.high, parts[2 * c + 1] = s.low, bins[c] = int8_t(s.bin);
  }
  void add(const DeepSum& other) {
    for (int c = 0; c < 3; ++c) add_color(c, other.color(c));
    nearest = std::min(nearest, other.nearest), farthest = std::max(farthest, other.farthest);
    covered += other.covered;
  }
};

// Sums of one pixel, ordered by key. Cells are joined 2^level at a time.
struct DeepPixel {
  std::vector<DeepSum> sums;
  int level = 0;
};

class DeepFilm {
 public:
  static constexpr int kLeast = 4;  // the least bound on the sums of a pixel
  const DepthCells cells;
  const double tolerance;
  const int most;  // sums in a pixel
  std::vector<DeepPixel> pixels;

  DeepFilm(size_t pixel_count, double relative_size, int most_sums)
      : cells(relative_size), tolerance(relative_size), most(most_sums), pixels(pixel_count) {}
  // Adds to a pixel, whose tile's lock the thread holds. `term.key` is of level 0.
  void add(size_t pixel, const DeepSum& term);
  size_t memory_bytes() const;
};

// Sample of a deep picture, in front of all that follow: depths in scene units, equal for surfaces; premultiplied colour.
struct DeepSample {
  float z, z_back, color[3], alpha;
};

// Appends a pixel's samples, front to back, to `out`. Their extents do not overlap, and their composite is `covered` samples of
// `count` and the pixel's light: `scale` times the sums. `full`: coverage of one sample.
void append_samples(const DeepFilm& film, size_t pixel, int64_t covered, uint32_t count, int64_t full, double exposure,
                    std::vector<DeepSample>& out);

}  // namespace primray
