// Writing fields of rows in tables of floats, such as those of lights and shaping.
#pragma once

#include "math/vec3.hpp"

namespace primray {

inline void put(float* row, int field, const dvec3& v) {
  row[field] = float(v.x), row[field + 1] = float(v.y), row[field + 2] = float(v.z);
}

}  // namespace primray
