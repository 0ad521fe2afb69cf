// The distribution by which a dome's image is sampled.
#include "light/dome.hpp"

#include <algorithm>
#include <cmath>

namespace primray {
namespace {

// Mean luminance over each texel of the bilinearly read image: the tent's integral, weights 1/8 6/8 1/8 along each axis.
std::vector<double> texel_means(const Dome& d) {
  const int w = d.width, h = d.height;
  const auto lum = [&](int x, int y) {
    const float* t = &d.texels[3 * (size_t(y) * w + x)];
    return double(luminance(vec3(t[0] * d.tint.x, t[1] * d.tint.y, t[2] * d.tint.z)));
  };
  std::vector<double> rows(size_t(w) * h), mean(size_t(w) * h);
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x)
      rows[size_t(y) * w + x] = 0.125 * (lum((x + w - 1) % w, y) + lum((x + 1) % w, y)) + 0.75 * lum(x, y);
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x)
      mean[size_t(y) * w + x] =
          0.125 * (rows[size_t(std::max(y - 1, 0)) * w + x] + rows[size_t(std::min(y + 1, h - 1)) * w + x]) +
          0.75 * rows[size_t(y) * w + x];
  return mean;
}

constexpr double pi = 3.14159265358979323846;

// `rest`: the part of the mean that is left to the BSDF's rays.
void build_distribution(Dome& d, double rest) {
  const int w = d.width, h = d.height;
  std::vector<double> weight = texel_means(d), solid_angle(h);
  d.row_edges.clear();
  for (int y = 0; y < h; ++y)
    for (const int edge : {y, y + 1}) {
      // 1 - cos = 2 sin^2 of half the angle.
      const double half_sin = std::sin(0.5 * pi / h * (y < d.upper_rows() ? edge : h - edge));
      d.row_edges.push_back(float(2 * half_sin * half_sin));
    }
  double total = 0;
  for (int y = 0; y < h; ++y) {
    // cos a - cos b = 2 sin((a + b) / 2) sin((b - a) / 2)
    solid_angle[y] = 4 * pi / w * std::sin(pi * (y + 0.5) / h) * std::sin(0.5 * pi / h);
    for (int x = 0; x < w; ++x) total += weight[size_t(y) * w + x] * solid_angle[y];
  }
  const double left = rest * total / (4 * pi);
  total = 0;
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) {
      double& v = weight[size_t(y) * w + x];
      v = std::max(0.0, v - left);
      total += v * solid_angle[y];
    }
  d.sampled = total > 0;
  d.irradiance = total;
  if (!d.sampled) return;
  d.row_cdf.assign(h + 1, 0);
  d.column_cdf.assign(size_t(h) * (w + 1), 0);
  d.density.assign(size_t(h) * w, 0);
  double row_sum = 0;
  for (int y = 0; y < h; ++y) {
    const double* row = &weight[size_t(y) * w];
    double sum = 0, run = 0;
    for (int x = 0; x < w; ++x) sum += row[x];
    float* columns = &d.column_cdf[size_t(y) * (w + 1)];
    for (int x = 0; x < w; ++x) {
      columns[x] = float(sum > 0 ? run / sum : double(x) / w);
      run += row[x];
      d.density[size_t(y) * w + x] = float(row[x] / total);
    }
    columns[w] = 1;
    d.row_cdf[y] = float(row_sum / total);
    row_sum += sum * solid_angle[y];
  }
  d.row_cdf[h] = 1;
}

}  // namespace

void build_dome_distribution(Dome& d) {
  d.sampled = false;
  if (d.width > 0) build_distribution(d, 1.0);  // under a constant sky the BSDF's rays alone are as good as it gets
}

void build_whole_dome_distribution(Dome& d) {
  if (d.width == 0) d.width = d.height = 1, d.texels.assign(3, 1.0f);
  build_distribution(d, 0.0);
}

}  // namespace primray
