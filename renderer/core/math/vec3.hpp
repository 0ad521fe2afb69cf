// Vectors of three components of float, double or lanes, with the operations of vector algebra.
#pragma once

#include <cmath>

#include "math/lanes.hpp"

namespace primray {

template <class T>
struct Vec3 {
  T x, y, z;

  Vec3() = default;
  PRIMRAY_INLINE Vec3(T s) : x(s), y(s), z(s) {}
  PRIMRAY_INLINE Vec3(T x_, T y_, T z_) : x(x_), y(y_), z(z_) {}
  template <class S>
  PRIMRAY_INLINE explicit Vec3(const Vec3<S>& o) : x(T(o.x)), y(T(o.y)), z(T(o.z)) {}

  PRIMRAY_INLINE friend Vec3 operator+(const Vec3& a, const Vec3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  PRIMRAY_INLINE friend Vec3 operator-(const Vec3& a, const Vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  PRIMRAY_INLINE friend Vec3 operator*(const Vec3& a, const Vec3& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
  PRIMRAY_INLINE friend Vec3 operator*(const Vec3& a, T s) { return {a.x * s, a.y * s, a.z * s}; }
  PRIMRAY_INLINE friend Vec3 operator*(T s, const Vec3& a) { return a * s; }
  PRIMRAY_INLINE friend Vec3 operator-(const Vec3& a) { return {-a.x, -a.y, -a.z}; }
  PRIMRAY_INLINE Vec3& operator+=(const Vec3& b) { return *this = *this + b; }
  PRIMRAY_INLINE Vec3& operator*=(const Vec3& b) { return *this = *this * b; }
  PRIMRAY_INLINE Vec3& operator*=(T s) { return *this = *this * s; }
};

template <int W>
using vvec3 = Vec3<vfloat<W>>;
using vec3 = Vec3<float>;
using dvec3 = Vec3<double>;

template <class T>
PRIMRAY_INLINE T dot(const Vec3<T>& a, const Vec3<T>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class T>
PRIMRAY_INLINE Vec3<T> cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class T>
PRIMRAY_INLINE T max_component(const Vec3<T>& a) {
  if constexpr (std::is_arithmetic_v<T>) {
    const T m = a.x > a.y ? a.x : a.y;
    return m > a.z ? m : a.z;
  } else {
    return primray::max(primray::max(a.x, a.y), a.z);
  }
}
template <class T>
PRIMRAY_INLINE T component(const Vec3<T>& a, size_t axis) {
  return axis == 0 ? a.x : axis == 1 ? a.y : a.z;
}
template <class T>
PRIMRAY_INLINE T length(const Vec3<T>& a) {
  using std::sqrt;
  return sqrt(dot(a, a));
}
template <class T>
PRIMRAY_INLINE Vec3<T> normalize(const Vec3<T>& a) {
  using std::sqrt;
  return a * (T(1.0f) / sqrt(dot(a, a)));
}
template <int W>
PRIMRAY_INLINE vvec3<W> select(vbool<W> m, const vvec3<W>& a, const vvec3<W>& b) {
  return {select(m, a.x, b.x), select(m, a.y, b.y), select(m, a.z, b.z)};
}
template <int W>
PRIMRAY_INLINE vvec3<W> abs(const vvec3<W>& a) {
  return {abs(a.x), abs(a.y), abs(a.z)};
}
template <int W>
PRIMRAY_INLINE vvec3<W> permute(const vvec3<W>& a, vint<W> from) {
  return {permute(a.x, from), permute(a.y, from), permute(a.z, from)};
}
// Rec.709 luminance: ITU-R BT.709-6, item 3.2.
template <class T>
PRIMRAY_INLINE T luminance(const Vec3<T>& c) {
  return T(0.2126f) * c.x + T(0.7152f) * c.y + T(0.0722f) * c.z;
}

// Two unit vectors that make a right-handed frame with the unit vector n: Duff et al. 2017, "Building an Orthonormal Basis,
// Revisited".
template <class T>
struct Frame {
  Vec3<T> s, t, n;

  Frame() = default;
  PRIMRAY_INLINE explicit Frame(const Vec3<T>& normal) : n(normal) {
    using std::copysign;
    const T sign = copysign(T(1.0f), n.z);
    const T a = T(-1.0f) / (sign + n.z);
    const T b = n.x * n.y * a;
    s = {T(1.0f) + sign * n.x * n.x * a, sign * b, -sign * n.x};
    t = {b, sign + n.y * n.y * a, -n.y};
  }
  PRIMRAY_INLINE Frame(const Vec3<T>& s_, const Vec3<T>& t_, const Vec3<T>& n_) : s(s_), t(t_), n(n_) {}
  PRIMRAY_INLINE Vec3<T> to_local(const Vec3<T>& v) const { return {dot(v, s), dot(v, t), dot(v, n)}; }
  PRIMRAY_INLINE Vec3<T> to_world(const Vec3<T>& v) const { return s * v.x + t * v.y + n * v.z; }
};

// Unit vector along `a`, even if its square is outside the range of floats.
template <int W>
PRIMRAY_INLINE vvec3<W> direction_of(const vvec3<W>& a) {
  return normalize(a * (1.0f / max_component(abs(a))));
}

}  // namespace primray
