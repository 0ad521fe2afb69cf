// See light_bounds.hpp.
#include "build/lights/light_bounds.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "math/matrix.hpp"

namespace primray {
namespace {

// Squares of distances must stay floats.
constexpr float kLeast2 = 1e-24f;
// What is left of a flat light's importance where it is seen from its edge.
constexpr float kFlatFloor = 1e-3f;

dvec3 vector(const float* row, int field) { return {row[field], row[field + 1], row[field + 2]}; }

// Of a ball about a mesh in its group's space: its size went by the cube root of the matrix's determinant.
double mesh_radius(const float* row) {
  const dvec3 a = vector(row, kAxisX), b = vector(row, kAxisY), c = vector(row, kAxisZ);
  const double size = std::cbrt(std::fabs(dot(cross(a, b), c)));
  return size > 0 ? row[kSize0] / size : 1e12;
}

void put(float* to, const dvec3& v) { to[0] = float(v.x), to[1] = float(v.y), to[2] = float(v.z); }

void put_far(LightBounds& b, const dvec3& direction, double reach) {
  put(b.center, direction);
  put(b.low, direction - dvec3(reach)), put(b.high, direction + dvec3(reach));
  b.far = true, b.least2 = 1;
}

}  // namespace

LightBox light_box(const float* row) {
  const double s0 = row[kSize0], s1 = row[kSize1];
  const bool mesh = LightType(int(row[kType])) == LightType::kMesh;
  LightBox box;
  for (int a = 0; a < 3; ++a) {
    const double x = std::fabs(row[kAxisX + a]), y = std::fabs(row[kAxisY + a]), z = std::fabs(row[kAxisZ + a]);
    double reach = 0;
    switch (LightType(int(row[kType]))) {
      case LightType::kSphere:
        reach = s0 * std::sqrt(x * x + y * y + z * z);
        break;
      case LightType::kDisk:
        reach = s0 * std::sqrt(x * x + y * y);
        break;
      case LightType::kRect:
        reach = s0 * x + s1 * y;
        break;
      case LightType::kCylinder:
        reach = s1 * x + s0 * std::sqrt(y * y + z * z);
        break;
      case LightType::kLine:
        reach = s1 * x;
        break;
      case LightType::kMesh:
        reach = int(row[kLightFlags]) & kRectangle ? std::fabs(row[kMeshHalfX + a]) + std::fabs(row[kMeshHalfY + a])
                                                   : mesh_radius(row) * std::sqrt(x * x + y * y + z * z);
        break;
      default:
        break;
    }
    const double center = row[(mesh ? kMeshCenter : kOrigin) + a], more = reach * 1e-5 + std::fabs(center) * 4e-6;
    box.low[a] = float(center - reach - more), box.high[a] = float(center + reach + more);
  }
  return box;
}

LightBounds light_bounds(const LightTable& table, const float* row) {
  const double s0 = row[kSize0], s1 = row[kSize1], power = row[kImportance];
  const LightType type = LightType(int(row[kType]));
  LightBounds b;
  b.intensity = float(power);
  if (type == LightType::kDistant) {
    // Its light comes from +z, out of a cone with 1 - cos = size0.
    put_far(b, vector(row, kAxisZ), s0 < 1 ? std::sqrt(s0 * (2 - s0)) : 2.0);
    return b;
  }
  if (type == LightType::kDome) {
    put_far(b, dvec3(0.0), 4.0);
    return b;
  }
  const LightBox box = light_box(row);
  for (int a = 0; a < 3; ++a) b.low[a] = box.low[a], b.high[a] = box.high[a];
  put(b.center, vector(row, type == LightType::kMesh ? kMeshCenter : kOrigin));
  double intensity = power, least2 = 0;
  switch (type) {
    case LightType::kSphere:
      intensity *= std::numbers::pi * s0 * s0, least2 = s0 * s0;
      break;
    case LightType::kDisk:
    case LightType::kRect: {
      const double area = type == LightType::kRect ? 4 * s0 * s1 : std::numbers::pi * s0 * s0;
      intensity *= area, least2 = area / std::numbers::pi;
      // The side it emits to is where local z is negative, whatever shears x and y.
      const dvec3 up = normalize(dvec3{row[kInverseX + 2], row[kInverseY + 2], row[kInverseZ + 2]});
      put(b.axis, up * -1.0);
      b.cos_end = 0, b.floor = kFlatFloor;
    } break;
    case LightType::kCylinder:
      intensity *= 4 * s0 * s1, least2 = s0 * s0 + s1 * s1 / 3, b.exact = true;
      break;
    case LightType::kLine:
      intensity *= 2 * s1, least2 = s1 * s1 / 3, b.exact = true;
      break;
    case LightType::kMesh:
      intensity *= 0.5, least2 = s0 * s0;
      break;
    default:
      break;
  }
  if (const int shaping = int(row[kShaping]); shaping != 0) {
    const float* shaped = table.shaping.row(shaping);
    b.exact = true;
    const double reach = std::min(shaped[kReach] + 2e-3, std::numbers::pi);
    // Its mean over all directions, taken together where it reaches.
    intensity *= shaped[kMean] / std::max(0.5 * (1 - std::cos(reach)), 1e-6);
    if (reach < 3.1 && !b.directed()) {
      put(b.axis, vector(shaped, kShapedAxis));
      b.cos_end = float(std::cos(reach)), b.floor = 1, b.radius = shaped[kReachRadius];
    }
  }
  b.intensity = float(intensity), b.least2 = std::max(float(least2), kLeast2);
  return b;
}

}  // namespace primray
