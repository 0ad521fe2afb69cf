// Affine maps: double precision for scene construction, float lanes for rendering. Columns are images of the axes.
#pragma once

#include <cmath>
#include <initializer_list>

#include "math/vec3.hpp"

namespace primray {

// Affine maps in W lanes, from tables of 12 floats per map: columns x, y, z, origin.
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

// p -> x p.x + y p.y + z p.z + o.
template <class T>
struct Affine {
  Vec3<T> x, y, z, o;

  Vec3<T> point(const Vec3<T>& p) const { return x * p.x + y * p.y + z * p.z + o; }
  Vec3<T> vector(const Vec3<T>& v) const { return x * v.x + y * v.y + z * v.z; }
  T determinant() const { return dot(cross(x, y), z); }
};

using daffine = Affine<double>;

inline daffine operator*(const daffine& a, const daffine& b) {
  return {a.vector(b.x), a.vector(b.y), a.vector(b.z), a.point(b.o)};
}

// Inverse by cofactors; the caller has checked that the determinant is not 0.
inline daffine inverse(const daffine& m) {
  const double r = 1.0 / m.determinant();
  const dvec3 a = cross(m.y, m.z) * r, b = cross(m.z, m.x) * r, c = cross(m.x, m.y) * r;
  daffine i{{a.x, b.x, c.x}, {a.y, b.y, c.y}, {a.z, b.z, c.z}, dvec3(0.0)};
  i.o = -i.vector(m.o);
  return i;
}

inline bool is_finite(const daffine& m) {
  double s = 0;
  for (const dvec3* c : {&m.x, &m.y, &m.z, &m.o}) s += c->x * 0 + c->y * 0 + c->z * 0;
  return s == 0;
}

// Whether a map is invertible for our purposes: its determinant exceeds rounding errors.
inline bool is_regular(const daffine& m) {
  const double size = length(m.x) * length(m.y) * length(m.z);
  return is_finite(m) && size > 0 && std::fabs(m.determinant()) > 1e-14 * size;
}

// Columns x, y, z, origin one after the other, as in the core's tables: 12 numbers.
template <class T>
daffine affine_from_columns(const T* m) {
  return {{m[0], m[1], m[2]}, {m[3], m[4], m[5]}, {m[6], m[7], m[8]}, {m[9], m[10], m[11]}};
}

template <class T>
void put_columns(const daffine& m, T* to) {
  const dvec3* columns[4] = {&m.x, &m.y, &m.z, &m.o};
  for (int k = 0; k < 4; ++k) to[3 * k] = T(columns[k]->x), to[3 * k + 1] = T(columns[k]->y), to[3 * k + 2] = T(columns[k]->z);
}

// Rows of a row-major 3x4 matrix, as in numpy.
inline daffine affine_from_rows(const double* m) {
  return {{m[0], m[4], m[8]}, {m[1], m[5], m[9]}, {m[2], m[6], m[10]}, {m[3], m[7], m[11]}};
}

}  // namespace primray
