// Importance of one light at a point: the weight by which lights are chosen, one by one or in the leaves of a tree.
#pragma once

#include "light/light.hpp"

namespace primray {

// Upper estimate of the irradiance at p from one light; 0 only if it cannot reach p. Depends on the position alone, so that the
// next vertex can recompute the probability of the choice from the ray's origin.
template <int W>
PRIMRAY_INLINE vfloat<W> light_importance(const float* row, const vvec3<W>& p) {
  vfloat<W> found(row[kImportance]);
  with_light_type(row, [&]<class T>(T) {
    const vvec3<W> to = p - LightRow<W>(row).vector(T::kCenter);
    found = T::importance(row, to, max(dot(to, to), 1e-30f), found);
  });
  return found;
}

// Importance of a light that moves, as if all of it could be at the nearest point of its path. The choice does not depend on
// time.
template <int W>
PRIMRAY_RARE vfloat<W> passing_importance(const LightPath& path, const float* row, const vvec3<W>& p) {
  const vfloat<W> power(row[kImportance]);
  if (!(path.radius > 0)) return power;
  const vvec3<W> to = p - vvec3<W>(vfloat<W>(path.center.x), vfloat<W>(path.center.y), vfloat<W>(path.center.z));
  return power * path.spread / max(dot(to, to), path.radius * path.radius);
}

// Weight of light number `i` at p: its importance, with its shaping.
template <int W>
PRIMRAY_INLINE vfloat<W> light_weight(const LightTable& table, int i, const vvec3<W>& p) {
  const float* row = table.row(i);
  if (const int32_t path = table.motion.any() ? table.motion.row(i) : -1; path >= 0)
    return passing_importance(table.motion.paths[size_t(path)], row, p);
  const vfloat<W> unshaped = light_importance(row, p);
  const int shaping = int(row[kShaping]);
  if (shaping == 0 || (int(row[kLightFlags]) & kPassing)) return unshaped;
  const vvec3<W> to = p - LightRow<W>(row).vector(light_center(row));
  return unshaped * shaping_importance(table.shaping, shaping, to);
}

}  // namespace primray
