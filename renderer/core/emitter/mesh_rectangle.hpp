// Mesh light that is a rectangle of two triangles (build/emitters/emitter_rectangles.hpp), in lanes: sampled as in
// light/types/rect.hpp, from both of its sides, without a choice among triangles.
#pragma once

#include "light/light.hpp"

namespace primray {

template <int W>
struct MeshRectangle {
  vvec3<W> center, half_x, half_y, x, y, z;  // x, y, z: unit
  vfloat<W> hx, hy;

  PRIMRAY_INLINE explicit MeshRectangle(const LightRow<W>& row)
      : center(row.vector(kMeshCenter)), half_x(row.vector(kMeshHalfX)), half_y(row.vector(kMeshHalfY)) {
    hx = length(half_x), hy = length(half_y);
    x = half_x * (1.0f / hx), y = half_y * (1.0f / hy), z = cross(x, y);
  }
  // p in the frame of light/types/rect.hpp: in front.
  PRIMRAY_INLINE vvec3<W> local(const vvec3<W>& p) const {
    const vvec3<W> to = p - center;
    return {dot(to, x), dot(to, y), -abs(dot(to, z))};
  }
  // Density per solid angle of the point that a ray along unit d hit `distance` away from p.
  PRIMRAY_INLINE vfloat<W> pdf(const vvec3<W>& p, const vvec3<W>& d, vfloat<W> distance) const {
    const vvec3<W> at = local(p);
    const vvec3<W> to{dot(d, x) * distance, dot(d, y) * distance, -at.z};
    const vfloat<W> r = rect_pdf(at, hx, hy, to);
    return select(at.z < vfloat<W>(0.0f), r, vfloat<W>(0.0f));
  }
};

// Sampled point of a rectangle: which of its two triangles, its barycentrics there, and its density per solid angle.
template <int W>
struct RectanglePoint {
  vint<W> triangle;
  vfloat<W> b1, b2, pdf;

  // `corners`: see ShapeHalves::corners.
  PRIMRAY_INLINE RectanglePoint(const MeshRectangle<W>& r, vint<W> corners, const vvec3<W>& p, vfloat<W> u, vfloat<W> v) {
    const vvec3<W> at = r.local(p);
    const LocalSample<W> s = rect_sample(at, r.hx, r.hy, u, v);
    pdf = s.pdf;
    const vfloat<W> one(1.0f), zero(0.0f);
    const vfloat<W> a = clamp(0.5f + 0.5f * (at.x + s.w.x * s.t) / r.hx, 0.0f, 1.0f);
    const vfloat<W> b = clamp(0.5f + 0.5f * (at.y + s.w.y * s.t) / r.hy, 0.0f, 1.0f);
    const vbool<W> second = a + b > one;
    triangle = select(second, vint<W>(1), vint<W>(0));
    // Weights of the triangle's own corner and of the two after it. The second triangle is the first, rotated by half a turn.
    const vfloat<W> next = select(second, one - a, a), last = select(second, one - b, b), own = max(one - next - last, zero);
    const vint<W> third = truncate(to_float(corners) * (1.0f / 3)),
                  corner = select(second, third, corners - third * vint<W>(3));
    const vbool<W> first = corner == vint<W>(0), middle = corner == vint<W>(1);
    b1 = select(first, next, select(middle, own, last));
    b2 = select(first, last, select(middle, next, own));
  }
};

}  // namespace primray
