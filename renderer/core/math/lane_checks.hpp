// Conditions of assertions (base/assert.hpp) on lanes: indices, directions, densities and throughputs. Only debug builds call
// them.
#pragma once

#include <cstddef>

#include "base/assert.hpp"
#include "math/vec3.hpp"

namespace primray {

// Whether each index of lanes `m` is that of one of `count` rows.
template <int W>
bool are_rows(vbool<W> m, vint<W> index, size_t count) {
  return !any(m & ((index < vint<W>(0)) | !(index < vint<W>(int32_t(count)))));
}
// The same for all lanes: gathers read every lane, even those that are not used.
template <int W>
bool are_rows(vint<W> index, size_t count) {
  return are_rows(vbool<W>(true), index, count);
}

// Whether the directions of lanes `m` are of unit length, within the rounding of a chain of transforms.
template <int W>
bool are_unit(vbool<W> m, const vvec3<W>& d) {
  return !any(m & !(abs(dot(d, d) - 1.0f) < vfloat<W>(1e-3f)));
}

// Whether the values of lanes `m` are finite.
template <int W>
bool are_finite(vbool<W> m, vfloat<W> a) {
  return !any(m & !(abs(a) < vfloat<W>(__builtin_inff())));
}
template <int W>
bool are_finite(vbool<W> m, const vvec3<W>& a) {
  return are_finite(m, a.x) && are_finite(m, a.y) && are_finite(m, a.z);
}

// Whether the values of lanes `m` are finite and not negative, as densities and throughputs are.
template <int W>
bool are_weights(vbool<W> m, vfloat<W> a) {
  return are_finite(m, a) && !any(m & (a < vfloat<W>(0.0f)));
}
template <int W>
bool are_weights(vbool<W> m, const vvec3<W>& a) {
  return are_weights(m, a.x) && are_weights(m, a.y) && are_weights(m, a.z);
}

// Whether the values of lanes `m` are within [0, 1].
template <int W>
bool are_fractions(vbool<W> m, vfloat<W> a) {
  return are_weights(m, a) && !any(m & (a > vfloat<W>(1.0f)));
}

}  // namespace primray
