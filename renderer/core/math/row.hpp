// Fields of rows in tables, such as those of lights and shaping: floats, and integers as their bits.
#pragma once

#include <bit>
#include <cstdint>

#include "math/vec3.hpp"

namespace primray {

inline void put(float* row, int field, const dvec3& v) {
  row[field] = float(v.x), row[field + 1] = float(v.y), row[field + 2] = float(v.z);
}

inline void put_int(float* row, int field, int32_t value) { row[field] = std::bit_cast<float>(value); }
inline int32_t int_at(const float* row, int field) { return std::bit_cast<int32_t>(row[field]); }

}  // namespace primray
