// Normals of a mesh in world space.
#pragma once

#include <algorithm>

#include "math/matrix.hpp"

namespace primray {

// Scales all by one factor rather than normalizing each: normals are interpolated as the object has them, here as in instances.
class PlacedNormals {
 public:
  explicit PlacedNormals(const daffine& m) : x_(cross(m.y, m.z)), y_(cross(m.z, m.x)), z_(cross(m.x, m.y)) {
    const double largest = std::max({length(x_), length(y_), length(z_)});
    factor_ = (m.determinant() < 0 ? -1 : 1) / (largest > 0 ? largest : 1.0);
  }
  dvec3 operator()(const dvec3& n) const { return (x_ * n.x + y_ * n.y + z_ * n.z) * factor_; }

 private:
  dvec3 x_, y_, z_;
  double factor_;
};

}  // namespace primray
