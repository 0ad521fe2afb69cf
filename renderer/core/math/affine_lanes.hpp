// Affine maps in W lanes, from tables of 12 floats per map: columns x, y, z, origin.
#pragma once

#include "math/vec3.hpp"

namespace primray {

template <int W>
struct AffineLanes {
  vvec3<W> x, y, z, o;
  AffineLanes() = default;
  PRIMRAY_INLINE AffineLanes(const float* base, vint<W> at) {
    const FourLanes<float, W> a = gather_four<W>(base, at), b = gather_four<W>(base + 4, at), c = gather_four<W>(base + 8, at);
    x = {a.x, a.y, a.z}, y = {a.w, b.x, b.y}, z = {b.z, b.w, c.x}, o = {c.y, c.z, c.w};
  }
  PRIMRAY_INLINE vvec3<W> vector(const vvec3<W>& v) const { return x * v.x + y * v.y + z * v.z; }
  // Composes with `outer` in `lanes`, and returns the magnitude of what was rounded.
  PRIMRAY_INLINE vvec3<W> move(vbool<W> lanes, const AffineLanes& outer) {
    const vvec3<W> spread = abs(outer.x * o.x) + abs(outer.y * o.y) + abs(outer.z * o.z) + abs(outer.o);
    o = select(lanes, outer.vector(o) + outer.o, o);
    x = select(lanes, outer.vector(x), x), y = select(lanes, outer.vector(y), y), z = select(lanes, outer.vector(z), z);
    return select(lanes, spread, vvec3<W>(vfloat<W>(0.0f)));
  }
  // Transforms normals by the cofactors: the inverse transpose times the determinant, whose sign counts (mirrored instances).
  // The length is arbitrary: the matrix is scaled to size 1, as products of three small columns would underflow.
  PRIMRAY_INLINE vvec3<W> normal(const vvec3<W>& n) const {
    const vfloat<W> unit = 1.0f / max_component(vvec3<W>(max_component(abs(x)), max_component(abs(y)), max_component(abs(z))));
    const vvec3<W> i = x * unit, j = y * unit, k = z * unit, a = cross(j, k), b = cross(k, i), c = cross(i, j);
    return (a * n.x + b * n.y + c * n.z) * copysign(vfloat<W>(1.0f), dot(a, i));
  }
};

}  // namespace primray
