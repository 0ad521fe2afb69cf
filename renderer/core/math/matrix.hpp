// Affine maps: double precision for scene construction, float lanes for rendering. Columns are images of the axes.
#pragma once

#include <cmath>

#include "math/vec3.hpp"

namespace primray {

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
