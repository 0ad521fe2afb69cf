// Inverses of lens models. Only arithmetic and square roots: sines of C libraries differ from one machine to the next.
#include "scene/distortion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace primray {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kWidestTangent = 1e4;  // no point of the film is farther from the axis
constexpr int kScan = 4096;             // steps of the search for where models turn back
constexpr int kIterations = 64;
constexpr int kAround = 16;  // directions in half a turn
// A table is extended over its edges for pixel filters: by texels, and by a share of its size where its texels are finer than
// pixels.
constexpr double kBeyond = 4, kBeyondShare = 1.0 / 32;

struct SinCos1 {
  double sin, cos;
};

// Taylor's series about the nearest multiple of a right angle; angles from 0 to pi. To 2 in 1e16.
SinCos1 sincos_of(double angle) {
  const double turns = std::floor(angle * (2 / kPi) + 0.5), t = angle - turns * (kPi / 2), t2 = t * t;
  double s = 0, c = 0;
  for (int n = 17; n >= 1; n -= 2) s = 1 - t2 / ((n + 1) * (n + 2)) * s;
  for (int n = 16; n >= 0; n -= 2) c = 1 - t2 / ((n + 1) * (n + 2)) * c;
  s *= t;
  const int quadrant = int(turns) & 3;
  if (quadrant == 1) return {c, -s};
  if (quadrant == 2) return {-s, -c};
  if (quadrant == 3) return {-c, s};
  return {s, c};
}

// Sine and cosine of any angle.
SinCos1 sincos_around(double angle) {
  const double turns = std::floor(std::fabs(angle) / (2 * kPi)), t = std::fabs(angle) - turns * (2 * kPi);
  const bool is_beyond = t > kPi;
  const SinCos1 a = sincos_of(is_beyond ? 2 * kPi - t : t);
  return {(angle < 0) != is_beyond ? -a.sin : a.sin, a.cos};
}

// Direction of a point of a cube's face, u to the right and v up from -1 to 1, seen from within as OpenEXR has them
// (ImfEnvmap).
dvec3 cube_direction(int face, double u, double v) {
  switch (face) {
    case 0:
      return {1, v, u};
    case 1:
      return {-1, v, -u};
    case 2:
      return {u, 1, v};
    case 3:
      return {u, -1, -v};
    case 4:
      return {-u, v, 1};
    default:
      return {u, v, -1};
  }
}

constexpr int kFaces = 6;

// Returns the first x in (0, end] where `slope` is no longer above 0; `end` if there is none.
template <class Slope>
double first_turn(double end, const Slope& slope) {
  double low = 0;
  for (int i = 1; i <= kScan; ++i) {
    double high = end * (double(i) / kScan);
    if (slope(high) > 0) {
      low = high;
      continue;
    }
    for (int k = 0; k < kIterations; ++k) {
      const double middle = 0.5 * (low + high);
      (slope(middle) > 0 ? low : high) = middle;
    }
    return low;
  }
  return end;
}

// Returns x in [0, end] with f(x) = wanted, for f ascending there: Newton's method, with bisection where steps leave the
// bracket.
template <class F, class Slope>
double solved(double wanted, double end, double start, const F& f, const Slope& slope) {
  double low = 0, high = end, x = std::clamp(start, low, high);
  for (int i = 0; i < kIterations; ++i) {
    const double off = f(x) - wanted;
    if (off == 0) break;
    (off < 0 ? low : high) = x;
    const double by_newton = x - off / slope(x);
    const double next = by_newton > low && by_newton < high ? by_newton : 0.5 * (low + high);
    if (std::fabs(next - x) <= 1e-16 * end || next == x) break;
    x = next;
  }
  return x;
}

double odd_polynomial(const double* k, double a) {
  const double a2 = a * a;
  return a * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * (k[3] + a2 * k[4]))));
}
double odd_slope(const double* k, double a) {
  const double a2 = a * a;
  return k[0] + a2 * (3 * k[1] + a2 * (5 * k[2] + a2 * (7 * k[3] + a2 * 9 * k[4])));
}
double polynomial(const double* k, double r) { return k[0] + r * (k[1] + r * (k[2] + r * (k[3] + r * k[4]))); }
double slope_of(const double* k, double r) { return k[1] + r * (2 * k[2] + r * (3 * k[3] + r * 4 * k[4])); }

struct Distorted {
  double x, y;            // on the film
  double xx, xy, yx, yy;  // derivatives of x and of y
};

// Model of projectPoints in OpenCV, calib3d, "Detailed Description", without the tilt of the sensor. +y down.
Distorted rational(const double* k, double x, double y) {
  const double s = x * x + y * y;
  const double above = 1 + s * (k[0] + s * (k[1] + s * k[4])), below = 1 + s * (k[5] + s * (k[6] + s * k[7]));
  const double above_slope = k[0] + s * (2 * k[1] + s * 3 * k[4]), below_slope = k[5] + s * (2 * k[6] + s * 3 * k[7]);
  const double g = above / below, g_slope = (above_slope * below - above * below_slope) / (below * below);
  const double p1 = k[2], p2 = k[3], s1 = k[8], s2 = k[9], s3 = k[10], s4 = k[11];
  const double prism_x = s1 + 2 * s2 * s, prism_y = s3 + 2 * s4 * s;  // derivatives by s
  return {x * g + 2 * p1 * x * y + p2 * (s + 2 * x * x) + s1 * s + s2 * s * s,
          y * g + p1 * (s + 2 * y * y) + 2 * p2 * x * y + s3 * s + s4 * s * s,
          g + x * g_slope * 2 * x + 2 * p1 * y + 6 * p2 * x + prism_x * 2 * x,
          x * g_slope * 2 * y + 2 * p1 * x + 2 * p2 * y + prism_x * 2 * y,
          y * g_slope * 2 * x + 2 * p1 * x + 2 * p2 * y + prism_y * 2 * x,
          g + y * g_slope * 2 * y + 6 * p1 * y + 2 * p2 * x + prism_y * 2 * y};
}

}  // namespace

double Distortion::radial(double r) const {
  const double s = r * r;
  return r * (1 + s * (k[0] + s * (k[1] + s * k[4]))) / (1 + s * (k[5] + s * (k[6] + s * k[7])));
}

double Distortion::radial_slope(double r) const {
  const double s = r * r;
  const double above = 1 + s * (k[0] + s * (k[1] + s * k[4])), below = 1 + s * (k[5] + s * (k[6] + s * k[7]));
  const double above_slope = k[0] + s * (2 * k[1] + s * 3 * k[4]), below_slope = k[5] + s * (2 * k[6] + s * 3 * k[7]);
  if (!(below > 0)) return -1;  // beyond a pole
  return (above + 2 * s * above_slope - above * 2 * s * below_slope / below) / below;
}

// Positive as long as the mapping is one to one within this radius: the radial part grows or, where it is not alone, the
// mapping keeps its orientation all around.
double Distortion::unfolds(double r) const {
  if (is_radial() || !(radial_slope(r) > 0)) return radial_slope(r);
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kAround; ++i) {
    const SinCos1 a = sincos_of(kPi * i / kAround);
    for (const double side : {-r, r}) {
      const Distorted d = rational(k, side * a.cos, side * a.sin);
      least = std::min(least, d.xx * d.yy - d.xy * d.yx);
    }
  }
  return least;
}

void Distortion::limit() {
  switch (model) {
    case DistortionModel::kRational: {
      const auto tangent = [&](double angle) {
        const SinCos1 a = sincos_of(angle);
        return a.cos * kWidestTangent > a.sin ? a.sin / a.cos : kWidestTangent;
      };
      most_inside = tangent(first_turn(std::min(most_angle, kPi / 2), [&](double a) { return unfolds(tangent(a)); }));
      most_radius = radial(most_inside);
      return;
    }
    case DistortionModel::kAngleToRadius:
      most_inside = first_turn(std::min(most_angle, kPi), [&](double a) { return odd_slope(k, a); });
      most_radius = odd_polynomial(k, most_inside);
      return;
    case DistortionModel::kRadiusToAngle: {
      const double seen = std::min(most_angle, kPi);
      // Extend the bracket until the angle is reached, or never.
      double end = 1;
      while (end < kWidestTangent && polynomial(k, end) < seen && slope_of(k, end) > 0) end *= 2;
      most_inside = first_turn(end, [&](double r) { return polynomial(k, r) <= seen ? slope_of(k, r) : -1.0; });
      most_radius = most_inside;
      return;
    }
    case DistortionModel::kTable:
    case DistortionModel::kRays:
    case DistortionModel::kLatLong:
    case DistortionModel::kCube:
      most_inside = most_radius = std::numeric_limits<double>::infinity();
  }
}

std::optional<double> Distortion::angle_of(double radius) const {
  if (!(radius <= most_radius)) return std::nullopt;
  if (model == DistortionModel::kRadiusToAngle) {
    const double angle = polynomial(k, radius);
    return angle >= 0 && angle <= kPi ? std::optional(angle) : std::nullopt;
  }
  return solved(
      radius, most_inside, radius / k[0], [&](double a) { return odd_polynomial(k, a); },
      [&](double a) { return odd_slope(k, a); });
}

// Newton's method in two dimensions, starting from the inverse of the radial part alone.
std::optional<dvec3> Distortion::undistorted(double x, double y) const {
  const double radius = std::sqrt(x * x + y * y);
  if (radius == 0 && k[8] == 0 && k[10] == 0) return dvec3{0, 0, -1};
  if (is_radial() && !(radius <= most_radius)) return std::nullopt;
  const double r = solved(
      std::min(radius, most_radius), most_inside, radius, [&](double a) { return radial(a); },
      [&](double a) { return radial_slope(a); });
  const double scale = radius > 0 ? r / radius : 1;
  double u = x * scale, v = -y * scale;
  if (is_radial()) return dvec3{u, -v, -1};
  const double target = -y, good = 1e-14 * (1 + radius);
  double best = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kIterations; ++i) {
    const Distorted d = rational(k, u, v);
    const double off_x = d.x - x, off_y = d.y - target, off = std::fabs(off_x) + std::fabs(off_y);
    const double det = d.xx * d.yy - d.xy * d.yx;
    if (!(det > 0)) return std::nullopt;
    if (off <= good || (off <= 1e-11 * (1 + radius) && off >= best)) {
      return u * u + v * v <= most_inside * most_inside ? std::optional(dvec3{u, -v, -1}) : std::nullopt;
    }
    best = off;
    u -= (off_x * d.yy - off_y * d.xy) / det, v -= (off_y * d.xx - off_x * d.yx) / det;
  }
  return std::nullopt;
}

std::optional<dvec3> DirectionTable::at(double x, double y) const {
  const double column = (x - left) / (right - left) * columns - 0.5, row = (top - y) / (top - bottom) * rows - 0.5;
  const double beside = std::max(kBeyond, columns * kBeyondShare), above = std::max(kBeyond, rows * kBeyondShare);
  if (!(column >= -beside && row >= -above && column <= columns - 1 + beside && row <= rows - 1 + above)) return std::nullopt;
  const int i = std::clamp(int(std::floor(column)), 0, std::max(columns - 2, 0));
  const int j = std::clamp(int(std::floor(row)), 0, std::max(rows - 2, 0));
  const double s = column - i, t = row - j;
  dvec3 sum(0.0);
  for (int corner = 0; corner < 4; ++corner) {
    const int right_of = corner & 1, below = corner >> 1;
    const size_t texel = size_t(std::min(j + below, rows - 1)) * columns + std::min(i + right_of, columns - 1);
    const float* d = &directions[3 * texel];
    sum += dvec3{d[0], d[1], d[2]} * ((right_of ? s : 1 - s) * (below ? t : 1 - t));
  }
  const double size = length(sum);
  return size > 0 ? std::optional(sum * (1 / size)) : std::nullopt;
}

size_t DirectionTable::texel(double x, double y) const {
  const double column = (x - left) / (right - left) * columns, row = (top - y) / (top - bottom) * rows;
  const int i = std::clamp(int(std::floor(column)), 0, columns - 1), j = std::clamp(int(std::floor(row)), 0, rows - 1);
  return size_t(j) * size_t(columns) + size_t(i);
}

Distortion::Angles Distortion::angles(double x, double y) const {
  if (!has_eyes()) return {x, y, 0};
  if (k[1] == 2) return {x, y, k[2] < 0 ? -1.0 : 1.0};
  if (k[1] != 0) return {x < 0 ? x + k[2] : x - k[2], y, x < 0 ? -1.0 : 1.0};
  return {x, y >= 0 ? y - k[2] : y + k[2], y >= 0 ? -1.0 : 1.0};
}

// Eyes are on a circle, across the direction's longitude, and come together towards the poles.
dvec3 Distortion::eye(double x, double y) const {
  if (model == DistortionModel::kRays) {
    const float* const place = &table.places[3 * table.texel(x, y)];
    return {place[0], place[1], place[2]};
  }
  const Angles a = angles(x, y);
  const double aside = 0.5 * k[0] * a.side * std::max(sincos_around(a.latitude).cos, 0.0);
  const SinCos1 longitude = sincos_around(a.longitude);
  return {longitude.cos * aside, 0, longitude.sin * aside};
}

std::optional<dvec3> Distortion::lat_long_point(const dvec3& d, const dvec3& near) const {
  const double h = std::sqrt(d.x * d.x + d.z * d.z);
  double longitude = std::atan2(d.x, -d.z), latitude = std::atan2(d.y, h);
  if (!has_eyes()) return dvec3{longitude, latitude, 0};
  const double side = angles(near.x, near.y).side, around = longitude;
  for (int i = 0; i < kIterations; ++i) {
    const double aside = 0.5 * k[0] * side * std::max(std::cos(latitude), 0.0);
    if (!(std::fabs(aside) <= h)) return std::nullopt;
    longitude = around - std::asin(h > 0 ? aside / h : 0), latitude = std::atan2(d.y, std::sqrt(h * h - aside * aside));
  }
  if (std::fabs(longitude) > kPi) longitude -= std::copysign(2 * kPi, longitude);
  if (k[1] == 2) return dvec3{longitude, latitude, 0};
  return k[1] != 0 ? dvec3{longitude + side * k[2], latitude, 0} : dvec3{longitude, latitude - side * k[2], 0};
}

std::optional<dvec3> Distortion::direction(double x, double y) const {
  if (model == DistortionModel::kLatLong) {
    const Angles a = angles(x, y);
    const SinCos1 up = sincos_around(a.latitude), around = sincos_around(a.longitude);
    return dvec3{around.sin * up.cos, up.sin, -around.cos * up.cos};
  }
  if (model == DistortionModel::kCube) {
    const int columns = int(k[0]), column = int(std::floor(x)), row = int(std::floor(-y)), face = row * columns + column;
    if (column < 0 || column >= columns || row < 0 || face >= kFaces) return std::nullopt;
    return normalize(cube_direction(face, 2 * (x - column) - 1, 2 * (y + row) + 1));
  }
  if (model == DistortionModel::kRational) return undistorted(x, y);
  if (model == DistortionModel::kRays) {
    const float* const d = &table.directions[3 * table.texel(x, y)];
    return dvec3{d[0], d[1], d[2]};
  }
  if (model == DistortionModel::kTable) {
    const std::optional<dvec3> d = table.at(x, y);
    return d && -d->z >= sincos_of(std::min(most_angle, kPi)).cos - 1e-12 ? d : std::nullopt;
  }
  const double radius = std::sqrt(x * x + y * y);
  const std::optional<double> angle = angle_of(radius);
  if (!angle) return std::nullopt;
  const SinCos1 a = sincos_of(*angle);
  const double across = radius > 0 ? a.sin / radius : 0;
  return dvec3{x * across, y * across, -a.cos};
}

std::optional<double> Distortion::radius_of(double angle) const {
  if (model == DistortionModel::kAngleToRadius)
    return angle <= most_inside ? std::optional(odd_polynomial(k, angle)) : std::nullopt;
  if (!(angle >= k[0] && angle <= polynomial(k, most_inside))) return std::nullopt;
  return solved(
      angle, most_inside, angle / k[1], [&](double r) { return polynomial(k, r); }, [&](double r) { return slope_of(k, r); });
}

// Newton's method in two dimensions with finite differences: `d` of unit length, across which the result has to be 0.
std::optional<dvec3> Distortion::searched(const dvec3& d, dvec3 from) const {
  const dvec3 aside = std::fabs(d.x) < 0.5 ? dvec3{1, 0, 0} : dvec3{0, 1, 0};
  const dvec3 u = normalize(cross(d, aside)), v = cross(d, u);
  const double dx = (table.right - table.left) / table.columns * 1e-3, dy = (table.top - table.bottom) / table.rows * 1e-3;
  for (int i = 0; i < kIterations; ++i) {
    const auto at = direction(from.x, from.y), beside = direction(from.x + dx, from.y), above = direction(from.x, from.y + dy);
    if (!at || !beside || !above) return std::nullopt;
    const double off_u = dot(*at, u), off_v = dot(*at, v);
    if (std::fabs(off_u) + std::fabs(off_v) < 1e-9) return dot(*at, d) > 0 ? std::optional(from) : std::nullopt;
    const double ux = (dot(*beside, u) - off_u) / dx, uy = (dot(*above, u) - off_u) / dy;
    const double vx = (dot(*beside, v) - off_v) / dx, vy = (dot(*above, v) - off_v) / dy;
    const double det = ux * vy - uy * vx;
    if (det == 0) return std::nullopt;
    from.x -= (off_u * vy - off_v * uy) / det, from.y -= (off_v * ux - off_u * vx) / det;
  }
  return std::nullopt;
}

std::optional<dvec3> Distortion::film_point(const dvec3& d, const dvec3& near) const {
  if (model == DistortionModel::kTable) return searched(normalize(d), near);
  if (model == DistortionModel::kRays) return std::nullopt;
  if (model == DistortionModel::kLatLong) return lat_long_point(d, near);
  if (model == DistortionModel::kCube) {
    const double x = std::fabs(d.x), y = std::fabs(d.y), z = std::fabs(d.z), most = std::max({x, y, z});
    if (!(most > 0)) return std::nullopt;
    const int axis = x == most ? 0 : y == most ? 1 : 2, face = 2 * axis + ((axis == 0 ? d.x : axis == 1 ? d.y : d.z) < 0);
    // The rows of a face's (u, v) are those of its directions.
    const dvec3 right = cube_direction(face, 1, 0) - cube_direction(face, 0, 0);
    const dvec3 up = cube_direction(face, 0, 1) - cube_direction(face, 0, 0);
    const int columns = int(k[0]);
    return dvec3{face % columns + 0.5 + 0.5 * dot(d, right) / most, -(face / columns) - 0.5 + 0.5 * dot(d, up) / most, 0};
  }
  if (model == DistortionModel::kRational) {
    const double x = d.x / -d.z, y = d.y / d.z;
    if (!(d.z < 0 && x * x + y * y <= most_inside * most_inside)) return std::nullopt;
    const Distorted on_film = rational(k, x, y);
    return dvec3{on_film.x, -on_film.y, 0};
  }
  const double across = std::sqrt(d.x * d.x + d.y * d.y);
  const std::optional<double> radius = radius_of(std::atan2(across, -d.z));
  if (!radius) return std::nullopt;
  return across > 0 ? dvec3{d.x * (*radius / across), d.y * (*radius / across), 0} : dvec3(0.0);
}

double Distortion::finest(double left, double right, double bottom, double top) const {
  if (model == DistortionModel::kRays) return 1;
  constexpr int kPlaces = 16;
  const double dx = (right - left) * 1e-4, dy = (top - bottom) * 1e-4;
  double least = 1;
  for (int i = 0; i <= kPlaces; ++i) {
    for (int j = 0; j <= kPlaces; ++j) {
      const double x = left + (right - left) * i / kPlaces, y = bottom + (top - bottom) * j / kPlaces;
      const auto at = direction(x, y), across = direction(x + dx, y), up = direction(x, y + dy);
      if (!at || !across || !up) continue;
      least = std::min(least, std::sqrt(length(cross(*across - *at, *up - *at)) / (dx * dy)));
    }
  }
  return std::max(least, 1e-3);
}

}  // namespace primray
