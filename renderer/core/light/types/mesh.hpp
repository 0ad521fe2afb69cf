// Mesh light as a light type: its row. How it is sampled is in light/mesh/.
#pragma once

#include "base/flush_denormals.hpp"
#include "light/types/light_type.hpp"

namespace primray {

struct MeshLight : LightTypeDefaults {
  static constexpr LightType kType = LightType::kMesh;
  static constexpr const char* kName = "GEOMETRY";
  static constexpr int kCenter = kMeshCenter;

  template <int W>
  static PRIMRAY_INLINE vfloat<W> importance(const float* row, const vvec3<W>& to, vfloat<W> d2, vfloat<W> power) {
    if (int_at(row, kLightFlags) & kRectangle) {
      const LightRow<W> r(row);
      const vvec3<W> quarter = cross(r.vector(kMeshHalfX), r.vector(kMeshHalfY));  // a quarter of its area
      const vfloat<W> area = max(4 * length(quarter), kLeastNormal), far = 4 * abs(dot(quarter, to)) / (d2 * sqrt(d2));
      return power / area * min(max(far, 1e-6f), kPi);
    }
    // A quarter of a closed surface's area is visible from afar, half of an open one's on average.
    return 0.5f * power / max(d2, row[kSize0] * row[kSize0]);
  }
  // Radius of the bounding sphere in its group's space: its size was scaled by the cube root of the matrix's determinant, and
  // non-uniform scale extends further.
  static double own_radius(const float* row, double without_size) {
    const dvec3 a = light_vector(row, kAxisX), b = light_vector(row, kAxisY), c = light_vector(row, kAxisZ);
    const double size = std::cbrt(std::fabs(dot(cross(a, b), c)));
    return size > 0 ? row[kSize0] / size : without_size;
  }
  static double half_extent(const float* row, int axis) {
    if (int_at(row, kLightFlags) & kRectangle)
      return double(std::fabs(row[kMeshHalfX + axis])) + std::fabs(row[kMeshHalfY + axis]);
    const AxisParts a(row, axis);
    return own_radius(row, 1e12) * std::sqrt(a.x * a.x + a.y * a.y + a.z * a.z);
  }
  static double bounding_radius(const float* row) {
    const AxisLengths a(row);
    const double size = own_radius(row, -1);
    return size < 0 ? 1e30 : size * std::hypot(a.x, a.y, a.z);
  }
  static TreeBounds tree_bounds(const float* row, LightBounds&) { return {0.5, double(row[kSize0]) * double(row[kSize0])}; }
};

}  // namespace primray
