// The anchor of a round light, by which LightRow::outside keeps its digits.
#pragma once

#include "light/types/light_row.hpp"
#include "math/matrix.hpp"
#include "math/row.hpp"

namespace primray {

// The point of a round light's surface (of a cylinder without ends) that is nearest to the core's origin. `axial`: what the
// light's axis counts in distances.
inline void put_anchor(float* row, const daffine& m, float axial) {
  if (m.determinant() == 0) return;  // such a light is left out
  dvec3 out = inverse(m).point(dvec3(0.0));
  const double along = axial == 0 ? out.x : 0.0;
  out.x -= along;
  out = length(out) > 0 ? normalize(out) : dvec3{0, 0, 1};
  const dvec3 nearest = out * double(row[kSize0]);
  put(row, kAnchor, m.point({nearest.x + along, nearest.y, nearest.z}));
  put(row, kAnchorNormal, out);
}

}  // namespace primray
