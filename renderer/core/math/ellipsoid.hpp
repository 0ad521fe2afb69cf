// Surface areas of ellipsoids, exact except for rounding, for scene construction.
#pragma once

#include <algorithm>
#include <cmath>

#include "math/matrix.hpp"

namespace primray {

// Carlson's R_F and R_D for x, y, z >= 0 of which at most one is 0: DLMF 19.36, by duplication until they agree to rounding.
inline double carlson_rf(double x, double y, double z) {
  double mean = (x + y + z) / 3;
  for (int i = 0; i < 60 && std::max({std::fabs(x - mean), std::fabs(y - mean), std::fabs(z - mean)}) >= 1e-3 * mean; ++i) {
    const double step = std::sqrt(x * y) + std::sqrt(y * z) + std::sqrt(z * x);
    x = (x + step) / 4, y = (y + step) / 4, z = (z + step) / 4, mean = (x + y + z) / 3;
  }
  const double dx = 1 - x / mean, dy = 1 - y / mean, dz = -(dx + dy);
  const double e2 = dx * dy - dz * dz, e3 = dx * dy * dz;
  return (1 - e2 / 10 + e3 / 14 + e2 * e2 / 24 - 3 * e2 * e3 / 44) / std::sqrt(mean);
}

inline double carlson_rd(double x, double y, double z) {
  double total = 0, power = 1, mean = (x + y + 3 * z) / 5;
  for (int i = 0; i < 60 && std::max({std::fabs(x - mean), std::fabs(y - mean), std::fabs(z - mean)}) >= 1e-3 * mean; ++i) {
    const double step = std::sqrt(x * y) + std::sqrt(y * z) + std::sqrt(z * x);
    total += power / (std::sqrt(z) * (z + step)), power /= 4;
    x = (x + step) / 4, y = (y + step) / 4, z = (z + step) / 4, mean = (x + y + 3 * z) / 5;
  }
  const double dx = 1 - x / mean, dy = 1 - y / mean, dz = -(dx + dy) / 3;
  const double e2 = dx * dy - 6 * dz * dz, e3 = (3 * dx * dy - 8 * dz * dz) * dz, e4 = 3 * (dx * dy - dz * dz) * dz * dz,
               e5 = dx * dy * dz * dz * dz;
  const double series = 1 - 3 * e2 / 14 + e3 / 6 + 9 * e2 * e2 / 88 - 3 * e4 / 22 - 9 * e2 * e3 / 52 + 3 * e5 / 26;
  return 3 * total + power * series / (mean * std::sqrt(mean));
}

// Squares of the singular values of a matrix, by Jacobi's rotations of m^T m (Golub and Van Loan, "Matrix Computations", 8.5).
inline void squared_sizes(const daffine& m, double (&r)[3]) {
  const dvec3 c[3] = {m.x, m.y, m.z};
  double a[3][3];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) a[i][j] = dot(c[i], c[j]);
  for (int sweep = 0; sweep < 30; ++sweep)
    for (int p = 0; p < 2; ++p)
      for (int q = p + 1; q < 3; ++q) {
        if (std::fabs(a[p][q]) <= 1e-17 * std::sqrt(std::fabs(a[p][p] * a[q][q]))) continue;
        const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
        const double t = std::copysign(1.0, theta) / (std::fabs(theta) + std::hypot(theta, 1.0));
        const double cosine = 1 / std::hypot(t, 1.0), sine = t * cosine;
        for (int k = 0; k < 3; ++k) {
          const double kp = a[k][p], kq = a[k][q];
          a[k][p] = cosine * kp - sine * kq, a[k][q] = sine * kp + cosine * kq;
        }
        for (int k = 0; k < 3; ++k) {
          const double pk = a[p][k], qk = a[q][k];
          a[p][k] = cosine * pk - sine * qk, a[q][k] = sine * pk + cosine * qk;
        }
      }
  for (int i = 0; i < 3; ++i) r[i] = std::max(a[i][i], 0.0);
}

// Area of the matrix's image of the unit sphere: DLMF 19.33.1, 4 pi R_G(a^2 b^2, a^2 c^2, b^2 c^2), with 19.21.10.
inline double ellipsoid_area(const daffine& m) {
  double s[3];
  squared_sizes(m, s);
  double g[3] = {s[0] * s[1], s[0] * s[2], s[1] * s[2]};
  std::sort(g, g + 3);
  const double largest = g[2];
  if (!(largest > 0)) return 0;
  const double x = g[0] / largest, z = g[1] / largest, y = 1;  // 19.21.10 loses least when its z is the middle one
  constexpr double kFourPi = 12.566370614359172954;
  if (z == 0) return kFourPi * 0.5 * std::sqrt(largest);
  const double total = z * carlson_rf(x, y, z) - (x - z) * (y - z) * carlson_rd(x, y, z) / 3 + std::sqrt(x * y / z);
  return kFourPi * 0.5 * total * std::sqrt(largest);
}

}  // namespace primray
