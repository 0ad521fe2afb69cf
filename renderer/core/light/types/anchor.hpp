// Anchor of a round light: a surface point that keeps LightRow::outside() precise.
#pragma once

#include "light/types/light_row.hpp"
#include "math/matrix.hpp"
#include "math/row.hpp"

namespace primray {

// Stores the point of a round light's surface (of a cylinder without ends) that is nearest to the core's origin. `axial`:
// weight of the light's axis in distances.
inline void put_anchor(float* row, const daffine& m, float axial) {
  if (m.determinant() == 0) return;  // such a light is skipped
  dvec3 out = inverse(m).point(dvec3(0.0));
  const double along = axial == 0 ? out.x : 0.0;
  out.x -= along;
  out = length(out) > 0 ? normalize(out) : dvec3{0, 0, 1};
  const dvec3 nearest = out * double(row[kSize0]);
  put(row, kAnchor, m.point({nearest.x + along, nearest.y, nearest.z}));
  put(row, kAnchorNormal, out);
}

}  // namespace primray
