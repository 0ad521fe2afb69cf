// Sampling distribution of a dome's image.
#include "light/dome/dome.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace primray {
namespace {

// Maximum number of rows of the grid over an image that is not lat-long; cells are larger than texels beyond, and are sampled
// at more points.
constexpr int kMostRows = 1024;

// Mean luminance over each texel of the bilinearly interpolated image: the integral of the tent, weights 1/8 6/8 1/8 along each
// axis.
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

// Number of rows that resolves the finest texels of the image.
int finest_rows(const Dome& d) {
  switch (d.format) {
    case DomeFormat::kMirroredBall:
      return int(std::ceil(0.25 * std::numbers::pi * std::max(d.width, d.height)));
    case DomeFormat::kAngular:
      return (std::max(d.width, d.height) + 1) / 2;
    case DomeFormat::kVerticalCross:  // a face's texels are largest in its middle
      return int(std::ceil(0.5 * std::numbers::pi * std::max(d.width / 3.0, d.height / 4.0)));
    case DomeFormat::kLatLong:
      break;
  }
  return d.height;
}

// Mean luminance over each cell, sampled twice per texel along each axis.
std::vector<double> cell_means(const Dome& d) {
  const int steps = std::max(2, (2 * finest_rows(d) + d.rows - 1) / d.rows);
  std::vector<double> mean(size_t(d.columns) * d.rows);
  for (int y = 0; y < d.rows; ++y)
    for (int j = 0; j < steps; ++j) {
      const double theta = std::numbers::pi * (y + (j + 0.5) / steps) / d.rows, sine = std::sin(theta),
                   cosine = std::cos(theta);
      for (int x = 0; x < d.columns; ++x)
        for (int i = 0; i < steps; ++i) {
          const double phi = 2 * std::numbers::pi * (0.5 - (x + (i + 0.5) / steps) / d.columns);
          const vec3 w{float(sine * std::sin(phi)), float(cosine), float(sine * std::cos(phi))};
          const vvec3<1> L = folded_radiance<1>(d, {vfloat<1>(w.x), vfloat<1>(w.y), vfloat<1>(w.z)});
          mean[size_t(y) * d.columns + x] += double(luminance(vec3{L.x[0], L.y[0], L.z[0]})) / (steps * steps);
        }
    }
  return mean;
}

// Extends a round image: texels whose centres are outside its disc get the value at its edge, so that lookups at the edge do
// not read the surroundings (black in most files).
void extend_disc(Dome& d) {
  const std::vector<float> was = d.texels;
  for (int y = 0; y < d.height; ++y)
    for (int x = 0; x < d.width; ++x) {
      const double dx = 2 * (x + 0.5) / d.width - 1, dy = 2 * (y + 0.5) / d.height - 1, r = std::hypot(dx, dy);
      if (r <= 1) continue;
      // Far enough inwards for the texel's centre to be inside: half of its diagonal.
      const double to = std::max(1 - 1.4143 / std::min(d.width, d.height), 0.0) / r;
      const int fx = std::clamp(int((dx * to + 1) * 0.5 * d.width), 0, d.width - 1);
      const int fy = std::clamp(int((dy * to + 1) * 0.5 * d.height), 0, d.height - 1);
      std::copy_n(&was[3 * (size_t(fy) * d.width + fx)], 3, &d.texels[3 * (size_t(y) * d.width + x)]);
    }
}

// `needed`: BSDF-sampled rays do not look for the dome at all.
void build_distribution(Dome& d, bool needed) {
  constexpr double pi = std::numbers::pi;
  const int w = d.columns, h = d.rows;
  std::vector<double> weight = d.format == DomeFormat::kLatLong ? texel_means(d) : cell_means(d), solid_angle(h);
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
  d.mean = total / (4 * pi);
  // Cells that are only sampled at points keep a minimum density.
  const double least = d.format == DomeFormat::kLatLong ? 0 : 1e-3 * d.mean;
  const double left = needed ? -least : dome_compensation(weight, solid_angle, w, d.mean);
  if (!(left < std::numeric_limits<double>::infinity())) {
    d.sampled = false, d.irradiance = 0;
    return;
  }
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
  d.row_cuts.clear(), d.column_cuts.clear();
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
    add_cuts(columns, w, d.column_cuts);
    d.row_cdf[y] = float(row_sum / total);
    row_sum += sum * solid_angle[y];
  }
  d.row_cdf[h] = 1;
  add_cuts(d.row_cdf.data(), h, d.row_cuts);
}

}  // namespace

void finish_dome_image(Dome& d) {
  d.columns = d.width, d.rows = d.height;
  if (d.width == 0 || d.format == DomeFormat::kLatLong) return;
  if (d.format != DomeFormat::kVerticalCross) extend_disc(d);
  d.rows = std::clamp(finest_rows(d), 4, kMostRows), d.columns = 2 * d.rows;
}

void build_dome_distribution(Dome& d) {
  d.sampled = false;
  d.mean = luminance(dvec3(d.tint));
  if (d.width > 0) build_distribution(d, false);  // under a constant sky the BSDF's rays alone are best
}

void build_whole_dome_distribution(Dome& d) {
  if (d.width == 0) d.width = d.height = d.columns = d.rows = 1, d.texels.assign(3, 1.0f);
  build_distribution(d, true);
}

}  // namespace primray
