// Error of a frame from two kinds of weights, and their geometric mean.
//
// Weight of a pixel alone: R is assumed to be uniform within 1.3 s of I, s = |d|, cut off at 0; the weight is its mean over
// that range. For a pixel that one rare sample made bright, that means that R is as likely to be anywhere below I.
// Weight of similar pixels: non-local means (Buades, Coll and Morel 2005) with the noise-aware distance of Rousselle, Knaus and
// Zwicker 2012, over a window of 7 x 7, between the 3 x 3 neighbourhoods without their centres, so that a pixel's own error
// does not influence which pixels are similar; R is the weighted mean, s its standard error, from the d of all pixels in it.
// The first estimate is too small where similar pixels know better, the second too large where there are none or where they
// also miss a rare contribution. Their geometric mean was the best on seven scenes; their ratio shows how uncertain it is.
//
// Variance: given the weights, the true sum minus the estimated is a sum of w e_a e_b over pixels, with e the replicates'
// errors, of variance w^2 4 E[d^2]^2 (colours of a pixel with their covariances). E[d^2]^2 is estimated by d^2 times its mean
// over 3 x 3 pixels, which is too small for a pixel unlike its neighbours, averaged with d^4 / 3, exact for normal errors;
// squared errors without weights, which such pixels dominate, take the larger of that and d^4 / 3.
#include "film/frame_error.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>

#include "base/time_spans.hpp"

namespace primray {
namespace {

constexpr int kWindow = 3, kPatch = 1, kPool = 1;  // radii
constexpr int kHalo = kWindow + kPatch + kPool;
constexpr int kStrip = kTile;  // rows at a time; a row of tiles, so that each tile belongs to one strip
constexpr int kColors = Film::kColors;
constexpr float kFloor = 1e-6f;  // a variance too small to matter beside kDarkest
// Half the range of R in standard errors: chosen with the geometric mean, on seven scenes from 4 to 256 samples.
constexpr double kSpread = 1.3;

int reflected(int i, int n) {
  if (i < 0) i = -i;
  if (i > n - 1) i = 2 * (n - 1) - i;
  return std::clamp(i, 0, n - 1);
}

// Rows [y0 - kHalo, y1 + kHalo) with kHalo columns on either side, reflected at the image's borders; one plane per colour.
struct Planes {
  int stride, rows;
  std::vector<float> values;
  Planes(int width, int height)
      : stride(width + 2 * kHalo), rows(height + 2 * kHalo), values(size_t(stride) * rows * kColors) {}
  float* row(int color, int y) { return &values[(size_t(color) * rows + size_t(y + kHalo)) * stride + kHalo]; }
  const float* row(int color, int y) const { return const_cast<Planes*>(this)->row(color, y); }
};

// Estimate of the image with the light of `mix` added.
PixelEstimate estimate_mix(const Film& film, size_t pixel, double exposure, const MixWeights& mix) {
  PixelEstimate e = estimate_pixel(film, pixel, exposure);
  for (size_t k = 0; k < mix.size(); ++k) {
    if (mix[k] == MixWeights::value_type{}) continue;
    const PixelEstimate part = estimate_lpe(film, int(k), pixel, exposure);
    for (int c = 0; c < kColors; ++c)
      e.mean[c] += mix[k][size_t(c)] * part.mean[c], e.difference[c] += mix[k][size_t(c)] * part.difference[c];
  }
  return e;
}

// One strip of the image, and its share of the sums.
class Strip {
 public:
  Strip(const Film& film, double exposure, int number, const MixWeights& mix)
      : film_(film),
        y0_(number * kStrip),
        height_(std::min(kStrip, film.height - y0_)),
        width_(film.width),
        mean_(width_, height_),
        difference_(width_, height_),
        variance_(width_, height_),
        alike_(width_, height_),
        alike_variance_(width_, height_),
        total_(size_t(width_) * height_),
        measured_(size_t(width_) * height_) {
    read(exposure, mix);
    pool();
    average();
  }

  FrameError sums(bool by_pixel) {
    FrameError e;
    e.tiles.resize(size_t(film_.tiles_x));
    if (by_pixel) e.pixels.resize(size_t(height_) * size_t(width_));
    for (int y = 0; y < height_; ++y)
      for (int x = 0; x < width_; ++x)
        if (measured_[size_t(y) * width_ + x]) add_pixel(e, x, y);
    return e;
  }

 private:
  void read(double exposure, const MixWeights& mix) {
    for (int y = -kHalo; y < height_ + kHalo; ++y) {
      const int from = reflected(y0_ + y, film_.height);
      for (int x = -kHalo; x < width_ + kHalo; ++x) {
        const PixelEstimate e = estimate_mix(film_, film_.at(0, reflected(x, width_), from), exposure, mix);
        for (int c = 0; c < kColors; ++c)
          mean_.row(c, y)[x] = float(e.mean[c]), difference_.row(c, y)[x] = float(e.difference[c]);
        if (x >= 0 && x < width_ && y >= 0 && y < height_) measured_[size_t(y) * width_ + x] = e.measured;
      }
    }
  }

  // A pixel's d^2 has one degree of freedom: the mean over 3 x 3 is a better measure of similarity.
  void pool() {
    for (int c = 0; c < kColors; ++c)
      for (int y = -kHalo + kPool; y < height_ + kHalo - kPool; ++y)
        for (int x = -kHalo + kPool; x < width_ + kHalo - kPool; ++x) variance_.row(c, y)[x] = pooled(c, c, x, y);
  }

  float pooled(int c, int d, int x, int y) const {
    float sum = 0;
    for (int j = -kPool; j <= kPool; ++j) {
      const float *p = difference_.row(c, y + j) + x, *q = difference_.row(d, y + j) + x;
      for (int i = -kPool; i <= kPool; ++i) sum += p[i] * q[i];
    }
    return sum / float((2 * kPool + 1) * (2 * kPool + 1));
  }

  // Means over similar pixels, and their variances.
  void average() {
    for (int c = 0; c < kColors; ++c)
      for (int y = 0; y < height_; ++y)
        for (int x = 0; x < width_; ++x) {
          const float d = difference_.row(c, y)[x];
          alike_.row(c, y)[x] = mean_.row(c, y)[x], alike_variance_.row(c, y)[x] = d * d;
        }
    std::fill(total_.begin(), total_.end(), 1.0f);
    // Distances of single pixels in three rows: each pixel's neighbourhood, without its centre, is summed from them.
    std::vector<float> rows[2 * kPatch + 1];
    for (std::vector<float>& row : rows) row.resize(size_t(width_ + 2 * kPatch));
    for (int dy = -kWindow; dy <= kWindow; ++dy)
      for (int dx = -kWindow; dx <= kWindow; ++dx) {
        if (dx == 0 && dy == 0) continue;
        for (int y = -kPatch; y < height_ + kPatch; ++y) {
          distances(rows[(y + kPatch) % 3].data() + kPatch, y, dx, dy);
          if (y >= kPatch)
            accumulate(rows[(y + 1) % 3].data() + 1, rows[(y + 2) % 3].data() + 1, rows[y % 3].data() + 1, y - kPatch, dx, dy);
        }
      }
    for (int c = 0; c < kColors; ++c)
      for (int y = 0; y < height_; ++y)
        for (int x = 0; x < width_; ++x) {
          const float total = total_[size_t(y) * width_ + x];
          alike_.row(c, y)[x] /= total, alike_variance_.row(c, y)[x] /= total * total;
        }
  }

  void distances(float* out, int y, int dx, int dy) const {
    std::fill(out - kPatch, out + width_ + kPatch, 0.0f);
    for (int c = 0; c < kColors; ++c) {
      const float *p = mean_.row(c, y), *q = mean_.row(c, y + dy) + dx;
      const float *vp = variance_.row(c, y), *vq = variance_.row(c, y + dy) + dx;
      for (int x = -kPatch; x < width_ + kPatch; ++x) {
        const float step = p[x] - q[x];
        out[x] += (step * step - (vp[x] + std::min(vp[x], vq[x]))) / (vp[x] + vq[x] + kFloor);
      }
    }
  }

  void accumulate(const float* above, const float* same, const float* below, int y, int dx, int dy) {
    constexpr float kMean = 1.0f / (kColors * 8);
    float* total = &total_[size_t(y) * width_];
    weights_.resize(size_t(width_));
    for (int x = 0; x < width_; ++x) {
      const float sum =
          above[x - 1] + above[x] + above[x + 1] + same[x - 1] + same[x + 1] + below[x - 1] + below[x] + below[x + 1];
      const float d = std::max(sum * kMean, 0.0f);
      // exp(-d), approximately; 0 where a distance is not a number.
      const float w = 1.0f / (1 + d * (1 + d * (0.5f + d * (1.0f / 6 + d * (1.0f / 24)))));
      weights_[x] = sum < 1e6f ? w : 0.0f;
      total[x] += weights_[x];
    }
    for (int c = 0; c < kColors; ++c) {
      const float *q = mean_.row(c, y + dy) + dx, *e = difference_.row(c, y + dy) + dx;
      float *mean = alike_.row(c, y), *variance = alike_variance_.row(c, y);
      for (int x = 0; x < width_; ++x) {
        const float w = weights_[x];
        mean[x] += w * q[x], variance[x] += w * w * e[x] * e[x];
      }
    }
  }

  // Mean of 1 / (R^2 + kDarkest) for R uniform within kSpread `s` of `r`, cut off at 0.
  static double weight(double r, double s) {
    r = std::abs(r);
    const double half = kSpread * s, low = std::max(r - half, 0.0), high = half <= r ? r + half : r * (1 + r / half);
    if (high - low < 1e-3 * (r + 0.1)) return 1 / (r * r + kDarkest);
    constexpr double kRoot = 10;  // 1 / sqrt(kDarkest)
    return kRoot * (std::atan(kRoot * high) - std::atan(kRoot * low)) / (high - low);
  }

  void add_pixel(FrameError& e, int x, int y) {
    double w[kColors], d[kColors];
    for (int c = 0; c < kColors; ++c) {
      d[c] = difference_.row(c, y)[x];
      const double r = mean_.row(c, y)[x], alike = alike_.row(c, y)[x], s = std::sqrt(double(alike_variance_.row(c, y)[x]));
      const double alone = weight(r, std::abs(d[c])), like = weight(alike, s), square = d[c] * d[c];
      w[c] = std::sqrt(alone * like);
      e.relative_alone += square * alone, e.relative_alike += square * like, e.relative += square * w[c];
      e.relative_plain += square / std::sqrt((r * r + kDarkest) * (alike * alike + kDarkest));
      e.tiles[size_t(x) / kTile] += square * w[c];
      if (!e.pixels.empty()) e.pixels[size_t(y) * size_t(width_) + size_t(x)] += float(square * w[c]);
      e.squared += square;
    }
    for (int c = 0; c < kColors; ++c)
      for (int k = 0; k < kColors; ++k) {
        const double product = d[c] * d[k], fourth = product * product / 3;
        const double both = (fourth + product * pooled(c, k, x, y)) / 2;
        e.relative_variance += 4 * w[c] * w[k] * both, e.squared_variance += 4 * std::max(fourth, both);
      }
    e.values += kColors;
  }

  const Film& film_;
  int y0_, height_, width_;
  Planes mean_, difference_, variance_, alike_, alike_variance_;
  std::vector<float> total_, weights_;
  std::vector<uint8_t> measured_;
};

}  // namespace

FrameError frame_error(const Film& film, double exposure, int64_t most_pixels, int threads, const MixWeights& mix,
                       bool by_pixel) {
  PRIMRAY_ASSERT(mix.empty() || mix.size() == size_t(film.expressions));
  const int all_strips = (film.height + kStrip - 1) / kStrip;
  const int64_t wanted = std::max<int64_t>(most_pixels / (int64_t(film.width) * kStrip), 1);
  const int strips = int(std::min<int64_t>(wanted, all_strips));
  std::vector<FrameError> parts(size_t(strips), FrameError{});
  std::atomic<int> next{0};
  const auto work = [&] {
    const TimeSpan span("measure the error");
    for (int i; (i = next++) < strips;) {
      const int strip = int((2 * int64_t(i) + 1) * all_strips / (2 * strips));
      parts[size_t(i)] = Strip(film, exposure, strip, mix).sums(by_pixel);
    }
  };
  std::vector<std::thread> pool;
  for (int i = 1; i < std::min(threads, strips); ++i) pool.emplace_back(work);
  work();
  for (std::thread& t : pool) t.join();

  FrameError all;
  for (const FrameError& e : parts) {
    all.values += e.values;
    all.relative_alone += e.relative_alone, all.relative_alike += e.relative_alike, all.relative += e.relative;
    all.relative_plain += e.relative_plain, all.relative_variance += e.relative_variance;
    all.squared += e.squared, all.squared_variance += e.squared_variance;
    all.tiles.insert(all.tiles.end(), e.tiles.begin(), e.tiles.end());
    all.pixels.insert(all.pixels.end(), e.pixels.begin(), e.pixels.end());
  }
  return all;
}

}  // namespace primray
