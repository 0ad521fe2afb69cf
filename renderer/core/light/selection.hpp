// Which light to sample from a point: each weighed by the irradiance it could bring there, or by power where there are many.
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

// The chosen light and its probability; 0 where no light can reach p.
template <int W>
struct LightChoice {
  vint<W> light;
  vfloat<W> probability;
};

template <int W>
PRIMRAY_INLINE vfloat<W> total_importance(const LightTable& table, const vvec3<W>& p) {
  vfloat<W> total(0.0f);
  for (int i = 0; i < table.count; ++i) total += light_weight(table, i, p);
  return total;
}

template <int W>
PRIMRAY_INLINE LightChoice<W> choose_light(const LightTable& table, const vvec3<W>& p, vfloat<W> u) {
  if (table.count == 1) return {vint<W>(0), vfloat<W>(1.0f)};
  if (table.count > LightTable::kWeighed) {
    const vint<W> i = find_interval<W>(table.power_cdf.data(), vint<W>(0), table.count, u);
    return {i, gather<W>(table.power_cdf.data() + 1, i) - gather<W>(table.power_cdf.data(), i)};
  }
  const vfloat<W> total = total_importance(table, p), wanted = u * total;
  vfloat<W> run(0.0f), chosen(0.0f);
  vint<W> light(0);
  for (int i = 0; i < table.count; ++i) {
    const vfloat<W> w = light_weight(table, i, p);
    // The last light whose interval begins at or before `wanted` and is not empty.
    const vbool<W> here = (run <= wanted) & (w > vfloat<W>(0.0f));
    light = select(here, vint<W>(i), light);
    chosen = select(here, w, chosen);
    run += w;
  }
  return {light, select(total > vfloat<W>(0.0f), chosen / max(total, 1e-38f), vfloat<W>(0.0f))};
}

// The probability with which choose_light picks light number `i` at p; `total` from total_importance (few lights).
template <int W>
PRIMRAY_INLINE vfloat<W> light_probability(const LightTable& table, int i, const vvec3<W>& p, vfloat<W> total) {
  if (table.count == 1) return vfloat<W>(1.0f);
  if (table.count > LightTable::kWeighed) return vfloat<W>(table.power_cdf[i + 1] - table.power_cdf[i]);
  return light_weight(table, i, p) / max(total, 1e-38f);
}

// The same for a light of its own in every lane of `m`.
template <int W>
PRIMRAY_INLINE vfloat<W> probability_of(const LightTable& table, vint<W> light, vbool<W> m, const vvec3<W>& p) {
  if (table.count == 1) return vfloat<W>(1.0f);
  const vint<W> valid = select(m, light, vint<W>(0));
  if (table.count > LightTable::kWeighed)
    return gather<W>(table.power_cdf.data() + 1, valid) - gather<W>(table.power_cdf.data(), valid);
  vfloat<W> total(0.0f), chosen(0.0f);
  for (int i = 0; i < table.count; ++i) {
    const vfloat<W> w = light_weight(table, i, p);
    chosen = select(valid == vint<W>(i), w, chosen);
    total += w;
  }
  return chosen / max(total, 1e-38f);
}

}  // namespace primray
