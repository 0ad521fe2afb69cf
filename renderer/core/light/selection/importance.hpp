// What one light could bring to a point: the weights by which lights are chosen, one by one or in the leaves of a tree.
#pragma once

#include "light/light.hpp"

namespace primray {

// Upper estimate of the irradiance at p from one light; 0 only where it can bring none. Depends on the position alone, so that
// the next vertex can find the choice's probability again from the ray's origin.
template <int W>
PRIMRAY_INLINE vfloat<W> light_importance(const float* row, const vvec3<W>& p) {
  const auto vector = [&](int field) {
    return vvec3<W>(vfloat<W>(row[field]), vfloat<W>(row[field + 1]), vfloat<W>(row[field + 2]));
  };
  const LightType type = LightType(int(row[kType]));
  const vvec3<W> to = p - vector(type == LightType::kMesh ? kMeshCenter : kOrigin);
  const vfloat<W> d2 = max(dot(to, to), 1e-30f), power(row[kImportance]);
  switch (type) {
    case LightType::kDistant:
    case LightType::kDome:
      return power;
    case LightType::kPoint:
      return power / d2;
    case LightType::kSphere:
      return power * (kPi * row[kSize0] * row[kSize0]) / max(d2, row[kSize0] * row[kSize0]);
    case LightType::kDisk:
    case LightType::kRect: {
      const vfloat<W> z = -(vector(kInverseX).z * to.x + vector(kInverseY).z * to.y + vector(kInverseZ).z * to.z);
      const float area = type == LightType::kRect ? 4 * row[kSize0] * row[kSize1] : kPi * row[kSize0] * row[kSize0];
      const vfloat<W> far = area * z / (d2 * sqrt(d2));
      return select(z > vfloat<W>(0.0f), power * min(max(far, 1e-6f), kPi), vfloat<W>(0.0f));
    }
    case LightType::kCylinder: {
      const vfloat<W> x = abs(vector(kInverseX).x * to.x + vector(kInverseY).x * to.y + vector(kInverseZ).x * to.z);
      const vfloat<W> beyond = max(x - row[kSize1], 0.0f);
      const vfloat<W> near2 = max(d2 - x * x, row[kSize0] * row[kSize0]) + beyond * beyond;
      return power * min(4 * row[kSize0] * row[kSize1] / near2, kPi);
    }
    case LightType::kLine: {
      const vfloat<W> x = abs(vector(kAxisX).x * to.x + vector(kAxisX).y * to.y + vector(kAxisX).z * to.z);
      const vfloat<W> beyond = max(x - row[kSize1], 0.0f), rho2 = max(d2 - x * x, 1e-6f * d2);
      return power * min(2 * row[kSize1] / (rho2 + beyond * beyond), 2.0f / sqrt(rho2));
    }
    case LightType::kMesh:
      if (int(row[kLightFlags]) & kRectangle) {
        const vvec3<W> quarter = cross(vector(kMeshHalfX), vector(kMeshHalfY));  // of its area
        const vfloat<W> area = max(4 * length(quarter), 1e-38f), far = 4 * abs(dot(quarter, to)) / (d2 * sqrt(d2));
        return power / area * min(max(far, 1e-6f), kPi);
      }
      // A quarter of a closed surface's area is seen from afar, half of an open one's on average.
      return 0.5f * power / max(d2, row[kSize0] * row[kSize0]);
  }
  return power;
}

// The same with the light's shaping: what light number `i` of the table is weighed by at p.
template <int W>
PRIMRAY_INLINE vfloat<W> light_weight(const LightTable& table, int i, const vvec3<W>& p) {
  const float* row = table.row(i);
  const vfloat<W> unshaped = light_importance(row, p);
  const int shaping = int(row[kShaping]);
  if (shaping == 0) return unshaped;
  const int center = LightType(int(row[kType])) == LightType::kMesh ? kMeshCenter : kOrigin;
  const vvec3<W> to = p - vvec3<W>(vfloat<W>(row[center]), vfloat<W>(row[center + 1]), vfloat<W>(row[center + 2]));
  return unshaped * shaping_importance(table.shaping, shaping, to);
}

}  // namespace primray
