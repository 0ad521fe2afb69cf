// W floats, ints or truth values that go through the same arithmetic side by side: vfloat, vint, vuint, vbool, select.
//
// Plain arithmetic over the compilers' vector extensions; W = 1 is the scalar formula. Every operation
// rounds as IEEE says, lane by lane, so the number of lanes never changes a bit of a result (contraction is off). Intrinsics
// stand only where the compilers miss the one instruction: gathers, square roots and the bits of a mask.
#pragma once

#include <immintrin.h>

#include <cstdint>
#include <cstring>
#include <type_traits>

namespace primray {

#define PRIMRAY_INLINE inline __attribute__((always_inline))
// What few scenes need: apart, so that it takes no registers and no room in the loop of the others.
#define PRIMRAY_RARE inline __attribute__((noinline))

template <class T, int W>
struct RawVector {
  typedef T type __attribute__((vector_size(sizeof(T) * W)));
};

// A truth value a lane: all bits set or none.
template <int W>
struct vbool {
  typename RawVector<int32_t, W>::type v;

  vbool() = default;
  PRIMRAY_INLINE vbool(typename RawVector<int32_t, W>::type raw) : v(raw) {}
  PRIMRAY_INLINE explicit vbool(bool b) : v(typename RawVector<int32_t, W>::type{} - int32_t(b)) {}
  PRIMRAY_INLINE bool operator[](int i) const { return v[i] != 0; }

  PRIMRAY_INLINE friend vbool operator&(vbool a, vbool b) { return vbool(a.v & b.v); }
  PRIMRAY_INLINE friend vbool operator|(vbool a, vbool b) { return vbool(a.v | b.v); }
  PRIMRAY_INLINE friend vbool operator!(vbool a) { return vbool(~a.v); }
  PRIMRAY_INLINE vbool& operator&=(vbool b) { return *this = *this & b; }
  PRIMRAY_INLINE vbool& operator|=(vbool b) { return *this = *this | b; }
};

// Bits of the lanes that are true, lane 0 lowest.
template <int W>
PRIMRAY_INLINE uint32_t bits(vbool<W> m) {
  uint32_t r = 0;
  for (int i = 0; i < W; ++i) r |= uint32_t(m.v[i] & 1) << i;
  return r;
}
#if defined(__AVX512F__)
PRIMRAY_INLINE uint32_t bits(vbool<16> m) { return _mm512_movepi32_mask((__m512i)m.v); }
#endif
#if defined(__AVX__)
PRIMRAY_INLINE uint32_t bits(vbool<8> m) { return _mm256_movemask_ps((__m256)m.v); }
#endif
PRIMRAY_INLINE uint32_t bits(vbool<4> m) { return _mm_movemask_ps((__m128)m.v); }

template <int W>
PRIMRAY_INLINE bool any(vbool<W> m) {
  return bits(m) != 0;
}
template <int W>
PRIMRAY_INLINE bool all(vbool<W> m) {
  return bits(m) == uint32_t((uint64_t(1) << W) - 1);
}

template <class T, int W>
struct Vector {
  using Raw = typename RawVector<T, W>::type;
  using Bool = vbool<W>;
  static constexpr int kLanes = W;
  Raw v;

  Vector() = default;
  PRIMRAY_INLINE Vector(Raw raw) : v(raw) {}
  PRIMRAY_INLINE Vector(T s) : v(s - Raw{}) {}  // s - 0 keeps every bit of s, also of -0
  PRIMRAY_INLINE T operator[](int i) const { return v[i]; }
  PRIMRAY_INLINE void set(int i, T s) { v[i] = s; }

  PRIMRAY_INLINE friend Vector operator+(Vector a, Vector b) { return a.v + b.v; }
  PRIMRAY_INLINE friend Vector operator-(Vector a, Vector b) { return a.v - b.v; }
  PRIMRAY_INLINE friend Vector operator*(Vector a, Vector b) { return a.v * b.v; }
  PRIMRAY_INLINE friend Vector operator/(Vector a, Vector b) { return a.v / b.v; }
  PRIMRAY_INLINE friend Vector operator-(Vector a) { return -a.v; }
  PRIMRAY_INLINE Vector& operator+=(Vector b) { return *this = *this + b; }
  PRIMRAY_INLINE Vector& operator-=(Vector b) { return *this = *this - b; }
  PRIMRAY_INLINE Vector& operator*=(Vector b) { return *this = *this * b; }
  PRIMRAY_INLINE friend Bool operator<(Vector a, Vector b) { return Bool(a.v < b.v); }
  PRIMRAY_INLINE friend Bool operator>(Vector a, Vector b) { return Bool(a.v > b.v); }
  PRIMRAY_INLINE friend Bool operator<=(Vector a, Vector b) { return Bool(a.v <= b.v); }
  PRIMRAY_INLINE friend Bool operator>=(Vector a, Vector b) { return Bool(a.v >= b.v); }
  PRIMRAY_INLINE friend Bool operator==(Vector a, Vector b) { return Bool(a.v == b.v); }
  PRIMRAY_INLINE friend Bool operator!=(Vector a, Vector b) { return Bool(a.v != b.v); }
  PRIMRAY_INLINE friend Vector operator&(Vector a, Vector b)
    requires std::is_integral_v<T>
  {
    return a.v & b.v;
  }
  PRIMRAY_INLINE friend Vector operator|(Vector a, Vector b)
    requires std::is_integral_v<T>
  {
    return a.v | b.v;
  }
  PRIMRAY_INLINE friend Vector operator^(Vector a, Vector b)
    requires std::is_integral_v<T>
  {
    return a.v ^ b.v;
  }
  PRIMRAY_INLINE friend Vector operator>>(Vector a, int s)
    requires std::is_integral_v<T>
  {
    return a.v >> s;
  }
  PRIMRAY_INLINE friend Vector operator<<(Vector a, int s)
    requires std::is_integral_v<T>
  {
    return a.v << s;
  }
};

template <int W>
using vfloat = Vector<float, W>;
template <int W>
using vint = Vector<int32_t, W>;
template <int W>
using vuint = Vector<uint32_t, W>;

template <class T, int W>
PRIMRAY_INLINE Vector<T, W> select(vbool<W> m, Vector<T, W> a, Vector<T, W> b) {
  return m.v ? a.v : b.v;
}
template <int W>
PRIMRAY_INLINE vfloat<W> select(vbool<W> m, vfloat<W> a, float b) {
  return select(m, a, vfloat<W>(b));
}
template <int W>
PRIMRAY_INLINE vfloat<W> select(vbool<W> m, float a, vfloat<W> b) {
  return select(m, vfloat<W>(a), b);
}

template <class T, int W>
PRIMRAY_INLINE Vector<T, W> min(Vector<T, W> a, std::type_identity_t<Vector<T, W>> b) {
  return a.v < b.v ? a.v : b.v;
}
template <class T, int W>
PRIMRAY_INLINE Vector<T, W> max(Vector<T, W> a, std::type_identity_t<Vector<T, W>> b) {
  return a.v > b.v ? a.v : b.v;
}
template <int W>
PRIMRAY_INLINE vfloat<W> clamp(vfloat<W> x, float lo, float hi) {
  return min(max(x, lo), hi);
}

// The same bits read as another type.
template <class To, class From>
PRIMRAY_INLINE To bit_cast(From a) {
  return To((typename To::Raw)a.v);
}
template <int W>
PRIMRAY_INLINE vfloat<W> abs(vfloat<W> a) {
  return bit_cast<vfloat<W>>(bit_cast<vint<W>>(a) & vint<W>(0x7fffffff));
}
// |a| with the sign of b.
template <int W>
PRIMRAY_INLINE vfloat<W> copysign(vfloat<W> a, vfloat<W> b) {
  return bit_cast<vfloat<W>>((bit_cast<vint<W>>(a) & vint<W>(0x7fffffff)) | (bit_cast<vint<W>>(b) & vint<W>(INT32_MIN)));
}
template <int W>
PRIMRAY_INLINE vfloat<W> sqrt(vfloat<W> a) {
  vfloat<W> r;
  for (int i = 0; i < W; ++i) r.v[i] = __builtin_sqrtf(a.v[i]);
  return r;
}
#if defined(__AVX512F__)
PRIMRAY_INLINE vfloat<16> sqrt(vfloat<16> a) { return (vfloat<16>::Raw)_mm512_sqrt_ps((__m512)a.v); }
#endif
#if defined(__AVX__)
PRIMRAY_INLINE vfloat<8> sqrt(vfloat<8> a) { return (vfloat<8>::Raw)_mm256_sqrt_ps((__m256)a.v); }
#endif
PRIMRAY_INLINE vfloat<4> sqrt(vfloat<4> a) { return (vfloat<4>::Raw)_mm_sqrt_ps((__m128)a.v); }

// sqrt of what rounding may have pushed below zero.
template <int W>
PRIMRAY_INLINE vfloat<W> safe_sqrt(vfloat<W> a) {
  return sqrt(max(a, 0.0f));
}

template <int W>
PRIMRAY_INLINE vint<W> truncate(vfloat<W> a) {
  return vint<W>(__builtin_convertvector(a.v, typename vint<W>::Raw));
}
template <int W>
PRIMRAY_INLINE vfloat<W> to_float(vint<W> a) {
  return vfloat<W>(__builtin_convertvector(a.v, typename vfloat<W>::Raw));
}
// A 32-bit fraction as a float in [0, 1).
template <int W>
PRIMRAY_INLINE vfloat<W> unit_float(vuint<W> a) {
  return to_float(bit_cast<vint<W>>(a >> 8)) * 0x1p-24f;
}
// Rounded down; for |a| < 2^31.
template <int W>
PRIMRAY_INLINE vint<W> floor_to_int(vfloat<W> a) {
  vint<W> t = truncate(a);
  return t + vint<W>((to_float(t) > a).v);  // a true lane is -1
}

template <int W, class T>
PRIMRAY_INLINE Vector<T, W> load(const T* p) {
  Vector<T, W> r;
  std::memcpy(&r.v, p, sizeof r.v);
  return r;
}
template <class T, int W>
PRIMRAY_INLINE void store(T* p, Vector<T, W> a) {
  std::memcpy(p, &a.v, sizeof a.v);
}
#if defined(__AVX512F__)
PRIMRAY_INLINE vfloat<16> gather16(const float* base, vint<16> index) {
  return (vfloat<16>::Raw)_mm512_i32gather_ps((__m512i)index.v, base, 4);
}
PRIMRAY_INLINE vint<16> gather16(const int32_t* base, vint<16> index) {
  return (vint<16>::Raw)_mm512_i32gather_epi32((__m512i)index.v, base, 4);
}
#endif
#if defined(__AVX2__)
PRIMRAY_INLINE vfloat<8> gather8(const float* base, vint<8> index) {
  return (vfloat<8>::Raw)_mm256_i32gather_ps(base, (__m256i)index.v, 4);
}
PRIMRAY_INLINE vint<8> gather8(const int32_t* base, vint<8> index) {
  return (vint<8>::Raw)_mm256_i32gather_epi32(base, (__m256i)index.v, 4);
}
#endif
// base[index] in every lane: indices of all lanes must be in range, also of those not wanted.
template <int W, class T>
PRIMRAY_INLINE Vector<T, W> gather(const T* base, vint<W> index) {
#if defined(__AVX512F__)
  if constexpr (W == 16) return gather16(base, index);
#endif
#if defined(__AVX2__)
  if constexpr (W == 8) return gather8(base, index);
#endif
  Vector<T, W> r;
  for (int i = 0; i < W; ++i) r.v[i] = base[index.v[i]];
  return r;
}
// Lanes 0, 1, 2, ...
template <int W>
PRIMRAY_INLINE vint<W> lane_numbers() {
  vint<W> r;
  for (int i = 0; i < W; ++i) r.v[i] = i;
  return r;
}
// r[i] = a[from[i]].
template <class T, int W>
PRIMRAY_INLINE Vector<T, W> permute(Vector<T, W> a, vint<W> from) {
#if defined(__GNUC__) && !defined(__clang__)
  return __builtin_shuffle(a.v, (typename RawVector<int32_t, W>::type)from.v);
#else
  Vector<T, W> r;
  for (int i = 0; i < W; ++i) r.v[i] = a.v[from.v[i] & (W - 1)];
  return r;
#endif
}

}  // namespace primray
