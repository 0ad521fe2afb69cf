// Sampling distribution of a rectangle light's image.
#include "light/types/light_image.hpp"

#include <algorithm>
#include <cmath>

namespace primray {
namespace {

// Upper limit of the share of image samples: some samples always take the plain rectangle, whose density bounds the estimate
// everywhere.
constexpr double kMostExcess = 1 - 0x1p-8;
// Densities below this share of the mean cost more in rounding than they gain.
constexpr double kWhole = 0x1p24;

// Mean luminance over each texel of the interpolated image: the integral of the tent, weights 1/8 6/8 1/8 along each axis.
std::vector<double> texel_means(const LightImage& image) {
  const int w = image.width, h = image.height;
  const auto at = [&](int x, int y) {
    const float* t = &image.texels[3 * (size_t(y) * w + x)];
    return luminance(dvec3{t[0], t[1], t[2]});
  };
  std::vector<double> rows(size_t(w) * h), mean(size_t(w) * h);
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x)
      rows[size_t(y) * w + x] = 0.125 * (at(std::max(x - 1, 0), y) + at(std::min(x + 1, w - 1), y)) + 0.75 * at(x, y);
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x)
      mean[size_t(y) * w + x] =
          0.125 * (rows[size_t(std::max(y - 1, 0)) * w + x] + rows[size_t(std::min(y + 1, h - 1)) * w + x]) +
          0.75 * rows[size_t(y) * w + x];
  return mean;
}

// Writes cumulative probabilities from 0 to 1 in multiples of 2^-24, like the sampler's numbers.
void put_cdf(const double* weight, int n, double total, float* cdf) {
  double run = 0;
  for (int i = 0; i < n; ++i) {
    cdf[i] = float(total > 0 ? std::round(std::min(run / total, 1.0) * kWhole) / kWhole : double(i) / n);
    run += weight[i];
  }
  cdf[n] = 1;
}

}  // namespace

void build_light_image(LightImage& image) {
  const int w = image.width, h = image.height;
  std::vector<double> weight = texel_means(image), of_row(h, 0.0);
  double total = 0, excess = 0;
  for (const double v : weight) total += v;
  const double mean = total / double(weight.size());
  image.mean = mean;
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) {
      double& v = weight[size_t(y) * w + x];
      v = std::max(v - mean, 0.0);
      of_row[y] += v;
    }
    excess += of_row[y];
  }
  // A smaller excess is not worth sampling.
  if (!(excess > 0.02 * total)) return;
  image.excess = float(std::min(excess / total, kMostExcess));
  image.row_cdf.resize(h + 1), image.column_cdf.resize(size_t(h) * (w + 1));
  put_cdf(of_row.data(), h, excess, image.row_cdf.data());
  for (int y = 0; y < h; ++y) put_cdf(&weight[size_t(y) * w], w, of_row[y], &image.column_cdf[size_t(y) * (w + 1)]);
}

}  // namespace primray
