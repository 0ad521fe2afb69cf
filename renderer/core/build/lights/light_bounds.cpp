// Computation of light_bounds.hpp.
#include "build/lights/light_bounds.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "math/matrix.hpp"

namespace primray {
namespace {

// Squares of distances must remain floats.
constexpr float kLeast2 = 1e-24f;
void put_far(LightBounds& b, const dvec3& direction, double reach) {
  put(b.center, 0, direction);
  put(b.low, 0, direction - dvec3(reach)), put(b.high, 0, direction + dvec3(reach));
  b.far = true, b.least2 = 1;
}

}  // namespace

LightBox light_box(const float* row) {
  LightBox box;
  with_light_type(row, [&]<class T>(T) {
    for (int a = 0; a < 3; ++a) {
      const double reach = T::reach(row, a), center = row[T::kCenter + a], more = reach * 1e-5 + std::fabs(center) * 4e-6;
      box.low[a] = float(center - reach - more), box.high[a] = float(center + reach + more);
    }
  });
  return box;
}

// Bounds of a light that moves: its whole path, emitting in all directions.
static LightBounds passing_bounds(const LightPath& path, LightBounds b) {
  if (!(path.radius > 0)) {
    put_far(b, dvec3{0, 0, 1}, 2.0);
    return b;
  }
  for (int a = 0; a < 3; ++a) {
    const float center = float(component(path.center, size_t(a)));
    b.low[a] = center - path.radius, b.high[a] = center + path.radius;
  }
  put(b.center, 0, dvec3(path.center));
  b.intensity = b.intensity * path.spread, b.least2 = std::max(float(path.radius * path.radius), kLeast2);
  return b;
}

LightBounds light_bounds(const LightTable& table, const float* row) {
  const double power = row[kImportance];
  LightBounds b;
  b.intensity = float(power);
  if (const int32_t path = table.motion.row(int((row - table.rows.data()) / kLightFields)); path >= 0)
    return passing_bounds(table.motion.paths[size_t(path)], b);
  LightSpread spread;
  with_light_type(row, [&]<class T>(T) {
    if constexpr (requires { T::far_direction(row); })
      put_far(b, T::far_direction(row), T::far_reach(row));
    else
      spread = T::spread(row, b);
  });
  if (b.far) return b;
  const LightBox box = light_box(row);
  for (int a = 0; a < 3; ++a) b.low[a] = box.low[a], b.high[a] = box.high[a];
  put(b.center, 0, light_vector(row, light_center(row)));
  double intensity = power * spread.factor;
  if (const int shaping = int(row[kShaping]); shaping != 0 && !(int(row[kLightFlags]) & kPassing)) {
    const float* shaped = table.shaping.row(shaping);
    b.exact = true;
    const double reach = std::min(shaped[kReach] + 2e-3, std::numbers::pi);
    // Its mean over all directions, concentrated on the part that it reaches.
    intensity *= shaped[kMean] / std::max(0.5 * (1 - std::cos(reach)), 1e-6);
    if (reach < 3.1 && !b.directed()) {
      put(b.axis, 0, light_vector(shaped, kShapedAxis));
      b.cos_end = float(std::cos(reach)), b.floor = 1, b.radius = shaped[kReachRadius];
    }
  }
  b.intensity = float(intensity), b.least2 = std::max(float(spread.least2), kLeast2);
  return b;
}

}  // namespace primray
