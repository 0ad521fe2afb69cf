// What a type of light says of itself. Each is a struct of static functions and constants:
//
//   kType, kName       its number in rows, and what Python calls it
//   sample, hit        in its frame: a direction from a point, and where a ray meets it (none: rays don't); or sample_world
//   is_delta           no ray can meet it by chance; of types that sample in their frame
//   importance         an upper estimate of the irradiance that it brings to a point, as light_importance() has it
//   reach, ball        along a coordinate axis from its centre; of a ball about that
//   spread             by what it is chosen in a tree; or far_direction, far_reach, of what is infinitely far away
//   is_round, sizes    when its axes keep it without shear; its sizes from a description
//   place              another frame than the description's; of types for which less than that matters
//   outline            where the camera sees its edge
//
// LightTypeDefaults holds what most have in common.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "light/choice/tree.hpp"
#include "light/types/light_row.hpp"
#include "math/matrix.hpp"
#include "math/row.hpp"

namespace primray {

// A light's sizes as a description gives them.
struct LightSize {
  double width = 1, height = 1, radius = 0.5, length = 1, angle_deg = 0;
};

// Squares of sizes must stay floats; a light smaller than this is as good as one of this size and the same power.
constexpr double kSmallestLight = 1e-15;
// What is left of a flat light's importance where it is seen from its edge.
constexpr float kFlatFloor = 1e-3f;

// What a tree multiplies a light's power with, and the least squared distance from its centre that it reckons with.
struct LightSpread {
  double factor = 1, least2 = 0;
};

inline dvec3 light_vector(const float* row, int field) { return {row[field], row[field + 1], row[field + 2]}; }

// |x|, |y|, |z|: how far its axes go along a coordinate axis.
struct AxisParts {
  double x, y, z;
  AxisParts(const float* row, int axis)
      : x(std::fabs(row[kAxisX + axis])), y(std::fabs(row[kAxisY + axis])), z(std::fabs(row[kAxisZ + axis])) {}
};
// The lengths of its axes; 1 unless it is sheared.
struct AxisLengths {
  double x, y, z;
  explicit AxisLengths(const float* row) : x(of(row + kAxisX)), y(of(row + kAxisY)), z(of(row + kAxisZ)) {}
  static double of(const float* a) { return std::hypot(a[0], a[1], a[2]); }
};

inline bool is_perpendicular(const dvec3& a, const dvec3& b) { return std::fabs(dot(a, b)) <= 1e-6 * length(a) * length(b); }
inline bool is_orthogonal(const daffine& m) {
  return is_perpendicular(m.x, m.y) && is_perpendicular(m.y, m.z) && is_perpendicular(m.z, m.x);
}
inline bool is_as_long(const dvec3& a, const dvec3& b) {
  const double x = length(a), y = length(b);
  return std::fabs(x - y) <= 1e-6 * std::max(x, y);
}

struct LightTypeDefaults {
  static constexpr int kCenter = kOrigin;  // the row's field
  static constexpr bool kFlat = false;     // it lies in its plane z = 0, and needs no depth
  static double reach(const float*, int) { return 0; }
  static double ball(const float*) { return 0; }
  static LightSpread spread(const float*, LightBounds&) { return {}; }
  static bool is_round(const daffine&) { return true; }
  // What is left of its emission where its sizes are kept from being too small.
  static double emission_scale(const double (&size)[2], const double (&kept)[2], double) {
    return size[0] / kept[0] * (size[1] / kept[1]);
  }
};

// What flat lights have in common. They emit where local z is negative, whatever shears x and y.
struct FlatLight : LightTypeDefaults {
  static constexpr bool kFlat = true;
  static LightSpread spread_of(const float* row, double area, LightBounds& b) {
    put(b.axis, 0, normalize(dvec3{row[kInverseX + 2], row[kInverseY + 2], row[kInverseZ + 2]}) * -1.0);
    b.cos_end = 0, b.floor = kFlatFloor;
    return {area, area / std::numbers::pi};
  }
  // `to`: from the light to the point, whose squared length is d2.
  template <int W>
  static PRIMRAY_INLINE vfloat<W> importance_of(const float* row, float area, const vvec3<W>& to, vfloat<W> d2,
                                                vfloat<W> power) {
    const LightRow<W> r(row);
    const vfloat<W> z = -(r.vector(kInverseX).z * to.x + r.vector(kInverseY).z * to.y + r.vector(kInverseZ).z * to.z);
    const vfloat<W> far = area * z / (d2 * sqrt(d2));
    return select(z > vfloat<W>(0.0f), power * min(max(far, 1e-6f), kPi), vfloat<W>(0.0f));
  }
};

}  // namespace primray
