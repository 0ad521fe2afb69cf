// Interface of a light type: a struct of static functions and constants.
//
//   kType, kName       its number in rows, and its name in Python
//   sample, hit in its frame: samples a direction from a point, intersects a ray (absent: rays do not hit it); or sample_world
//   is_delta           rays cannot hit it by chance; for types that sample in their frame
//   importance         upper estimate of the irradiance at a point; see light_importance()

//   tree_bounds        its bounds in a light tree; or far_direction, far_half_extent for lights at infinity
//   is_round, sizes    when its axes keep it without shear; its sizes from a description
//   place              a frame that differs from the description's; for types that depend on only part of it
//   outline            its silhouette as seen by the camera
//
// LightTypeDefaults holds what most types have in common.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "light/tree/light_tree.hpp"
#include "light/types/light_row.hpp"
#include "math/matrix.hpp"
#include "math/row.hpp"

namespace primray {

// Sizes of a light as a description gives them.
struct LightSize {
  double width = 1, height = 1, radius = 0.5, length = 1, angle_deg = 0;
};

// Smallest size, so that squares of sizes remain floats; a smaller light is replaced by one of this size and the same power.
constexpr double kSmallestLight = 1e-15;
// Lower limit of a flat light's importance when seen edge-on.
constexpr float kFlatFloor = 1e-3f;

// Factor of a light's power in the tree, and the lower limit of the squared distance from its centre.
struct TreeBounds {
  double factor = 1, least2 = 0;
};

inline dvec3 light_vector(const float* row, int field) { return {row[field], row[field + 1], row[field + 2]}; }

// |x|, |y|, |z|: extents of its axes along a coordinate axis.
struct AxisParts {
  double x, y, z;
  AxisParts(const float* row, int axis)
      : x(std::fabs(row[kAxisX + axis])), y(std::fabs(row[kAxisY + axis])), z(std::fabs(row[kAxisZ + axis])) {}
};
// Lengths of its axes; 1 unless it is sheared.
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
  static constexpr bool kFlat = false;     // lies in its plane z = 0, and needs no depth
  static double half_extent(const float*, int) { return 0; }
  static double bounding_radius(const float*) { return 0; }
  static TreeBounds tree_bounds(const float*, LightBounds&) { return {}; }
  static bool is_round(const daffine&) { return true; }
  // Factor of the emission that compensates for sizes that were raised to kSmallestLight.
  static double emission_scale(const double (&size)[2], const double (&kept)[2], double) {
    return size[0] / kept[0] * (size[1] / kept[1]);
  }
};

// Defaults of flat lights. They emit where local z is negative, whatever shears x and y.
struct FlatLight : LightTypeDefaults {
  static constexpr bool kFlat = true;
  static TreeBounds spread_of(const float* row, double area, LightBounds& b) {
    put(b.axis, 0, normalize(dvec3{row[kInverseX + 2], row[kInverseY + 2], row[kInverseZ + 2]}) * -1.0);
    b.cos_end = 0, b.floor = kFlatFloor;
    return {area, area / std::numbers::pi};
  }
  // `to`: from the light to the point, with squared length d2.
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
