// Two variances for a Lambert surface in the open, summed over the ways that it may face: of one ray by the cosine, and of such
// a ray and a sample of the dome together (multiple importance sampling by the power heuristic; the dome's density is what
// exceeds its mean, as dome.cpp builds it), which costs a ray more. Under a soft sky the first is the smaller one.
#include "light/dome_smooth.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "math/vec3.hpp"

namespace primray {
namespace {

// Of the grid that the dome is looked at on. Coarser cells blur small lights in the second variance alone, which then errs on
// the side of sampling the dome.
constexpr int kRows = 32, kColumns = 64;
// Two rays cost twice as much as one, of which the second also finds the way on: what the second may be worse by.
constexpr double kWorth = 1.5;

struct Cell {
  dvec3 direction;
  double solid_angle = 0, sum = 0, squares = 0;  // of luminance and its square, by solid angle
};

std::vector<Cell> coarse(std::span<const double> luminance, std::span<const double> solid_angle, int columns) {
  using std::numbers::pi;
  const int rows = int(solid_angle.size());
  std::vector<Cell> cells(size_t(kRows) * kColumns);
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns; ++x) {
      Cell& c = cells[size_t(int64_t(y) * kRows / rows) * kColumns + size_t(int64_t(x) * kColumns / columns)];
      const double v = luminance[size_t(y) * columns + x], a = solid_angle[y];
      c.solid_angle += a, c.sum += v * a, c.squares += v * v * a;
    }
  for (int y = 0; y < kRows; ++y)
    for (int x = 0; x < kColumns; ++x) {
      const double theta = pi * (y + 0.5) / kRows, phi = 2 * pi * (x + 0.5) / kColumns;
      cells[size_t(y) * kColumns + x].direction = {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi),
                                                   std::cos(theta)};
    }
  std::erase_if(cells, [](const Cell& c) { return c.solid_angle == 0; });
  return cells;
}

}  // namespace

bool is_smooth_dome(std::span<const double> luminance, std::span<const double> solid_angle, int columns) {
  using std::numbers::pi;
  const std::vector<Cell> cells = coarse(luminance, solid_angle, columns);
  double total = 0, whole = 0, excess = 0;
  for (const Cell& c : cells) total += c.sum, whole += c.solid_angle;
  const double mean = total / whole;
  for (const Cell& c : cells) excess += std::max(c.sum - mean * c.solid_angle, 0.0);
  if (!(excess > 0)) return true;
  double by_cosine = 0, by_both = 0;
  for (int i = -1; i <= 1; ++i)
    for (int j = -1; j <= 1; ++j)
      for (int k = -1; k <= 1; ++k) {
        if (i == 0 && j == 0 && k == 0) continue;
        const dvec3 n = normalize(dvec3{double(i), double(j), double(k)});
        double one = 0, two = 0, value = 0, found = 0, sampled = 0;
        for (const Cell& c : cells) {
          const double p = std::max(dot(c.direction, n), 0.0) / pi;  // the cosine's density, and what it weighs radiance by
          if (p == 0) continue;
          const double L = c.sum / c.solid_angle, q = std::max(L - mean, 0.0) / excess;
          const double w = p * p / (p * p + q * q);
          value += c.sum * p, one += c.squares * p;
          found += w * c.sum * p, two += w * w * c.squares * p;
          if (q > 0) sampled += (1 - w) * c.sum * p, two += (1 - w) * (1 - w) * c.squares * p * p / q;
        }
        by_cosine += one - value * value, by_both += two - found * found - sampled * sampled;
      }
  return by_cosine <= kWorth * by_both;
}

}  // namespace primray
