// SIMD types: W floats, ints or truth values that take the same arithmetic in parallel: vfloat, vint, vuint, vbool, select.
//
// Plain arithmetic on the compilers' vector extensions; W = 1 is the scalar formula. Every operation rounds according to IEEE
// 754, lane by lane, so the number of lanes never changes a bit of a result (contraction is off). Intrinsics are used only
// where the compilers miss the one instruction: gathers, square roots and the bits of a mask.
#pragma once

#include <immintrin.h>

#include <cstdint>
#include <cstring>
#include <type_traits>

#include "base/assert.hpp"

namespace primray {

// A debug build leaves inlining to the compiler: instrumented, whole path loops in one function take minutes to compile.
#if PRIMRAY_DEBUG
#define PRIMRAY_INLINE inline
#else
#define PRIMRAY_INLINE inline __attribute__((always_inline))
#endif
// Code that few scenes need: not inlined, so that it takes no registers and no space in the loop of the others.
#define PRIMRAY_RARE inline __attribute__((noinline))

template <class T, int W>
struct RawVector {
  typedef T type __attribute__((vector_size(sizeof(T) * W)));
};

// One truth value per lane: all bits set or none.
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

#if defined(__AVX512F__)
// Mask register.
template <>
struct vbool<16> {
  __mmask16 mask;

  vbool() = default;
  PRIMRAY_INLINE vbool(__mmask16 m) : mask(m) {}
  PRIMRAY_INLINE vbool(RawVector<int32_t, 16>::type raw) : mask(_mm512_movepi32_mask((__m512i)raw)) {}
  PRIMRAY_INLINE explicit vbool(bool b) : mask(b ? 0xffff : 0) {}
  PRIMRAY_INLINE bool operator[](int i) const { return mask >> i & 1; }

  PRIMRAY_INLINE friend vbool operator&(vbool a, vbool b) { return __mmask16(a.mask & b.mask); }
  PRIMRAY_INLINE friend vbool operator|(vbool a, vbool b) { return __mmask16(a.mask | b.mask); }
  PRIMRAY_INLINE friend vbool operator!(vbool a) { return __mmask16(~a.mask); }
  PRIMRAY_INLINE vbool& operator&=(vbool b) { return *this = *this & b; }
  PRIMRAY_INLINE vbool& operator|=(vbool b) { return *this = *this | b; }
};
#endif

// Whether each lane has all bits set or none.
template <int W>
bool is_mask(vbool<W> m) {
  for (int i = 0; i < W; ++i)
    if (m.v[i] != 0 && m.v[i] != -1) return false;
  return true;
}

// Bits of the lanes that are true, lane 0 lowest.
template <int W>
PRIMRAY_INLINE uint32_t bits(vbool<W> m) {
  PRIMRAY_ASSERT(is_mask(m));
  uint32_t r = 0;
  for (int i = 0; i < W; ++i) r |= uint32_t(m.v[i] & 1) << i;
  return r;
}
#if defined(__AVX512F__)
PRIMRAY_INLINE uint32_t bits(vbool<16> m) { return m.mask; }
#endif
#if defined(__AVX__)
PRIMRAY_INLINE uint32_t bits(vbool<8> m) {
  PRIMRAY_ASSERT(is_mask(m));
  return _mm256_movemask_ps((__m256)m.v);
}
#endif
PRIMRAY_INLINE uint32_t bits(vbool<4> m) {
  PRIMRAY_ASSERT(is_mask(m));
  return _mm_movemask_ps((__m128)m.v);
}

template <int W>
PRIMRAY_INLINE bool any(vbool<W> m) {
  return bits(m) != 0;
}
template <int W>
PRIMRAY_INLINE bool all(vbool<W> m) {
  return bits(m) == uint32_t((uint64_t(1) << W) - 1);
}

enum class Order { kLess, kGreater, kNotAbove, kNotBelow, kEqual, kUnequal };

// Comparison of a and b, lane by lane; a NaN is unequal to all and not ordered.
template <Order kOrder, class T, int W>
PRIMRAY_INLINE vbool<W> compare(typename RawVector<T, W>::type a, typename RawVector<T, W>::type b) {
#if defined(__AVX512F__)
  if constexpr (W == 16) {
    constexpr int kFloat[] = {_CMP_LT_OQ, _CMP_GT_OQ, _CMP_LE_OQ, _CMP_GE_OQ, _CMP_EQ_OQ, _CMP_NEQ_UQ};
    constexpr int kInt[] = {_MM_CMPINT_LT, _MM_CMPINT_NLE, _MM_CMPINT_LE, _MM_CMPINT_NLT, _MM_CMPINT_EQ, _MM_CMPINT_NE};
    if constexpr (std::is_same_v<T, float>) return vbool<W>(_mm512_cmp_ps_mask((__m512)a, (__m512)b, kFloat[int(kOrder)]));
    if constexpr (std::is_same_v<T, int32_t>) return vbool<W>(_mm512_cmp_epi32_mask((__m512i)a, (__m512i)b, kInt[int(kOrder)]));
    if constexpr (std::is_same_v<T, uint32_t>)
      return vbool<W>(_mm512_cmp_epu32_mask((__m512i)a, (__m512i)b, kInt[int(kOrder)]));
  }
#endif
  if constexpr (kOrder == Order::kLess) return vbool<W>(a < b);
  if constexpr (kOrder == Order::kGreater) return vbool<W>(a > b);
  if constexpr (kOrder == Order::kNotAbove) return vbool<W>(a <= b);
  if constexpr (kOrder == Order::kNotBelow) return vbool<W>(a >= b);
  if constexpr (kOrder == Order::kEqual) return vbool<W>(a == b);
  if constexpr (kOrder == Order::kUnequal) return vbool<W>(a != b);
}

template <class T, int W>
struct Vector {
  using Raw = typename RawVector<T, W>::type;
  using Bool = vbool<W>;
  static constexpr int kLanes = W;
  Raw v;

  Vector() = default;
  PRIMRAY_INLINE Vector(Raw raw) : v(raw) {}
  PRIMRAY_INLINE Vector(T s) : v(s - Raw{}) {}  // s - 0 keeps every bit of s, even of -0
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
  PRIMRAY_INLINE friend Bool operator<(Vector a, Vector b) { return compare<Order::kLess, T, W>(a.v, b.v); }
  PRIMRAY_INLINE friend Bool operator>(Vector a, Vector b) { return compare<Order::kGreater, T, W>(a.v, b.v); }
  PRIMRAY_INLINE friend Bool operator<=(Vector a, Vector b) { return compare<Order::kNotAbove, T, W>(a.v, b.v); }
  PRIMRAY_INLINE friend Bool operator>=(Vector a, Vector b) { return compare<Order::kNotBelow, T, W>(a.v, b.v); }
  PRIMRAY_INLINE friend Bool operator==(Vector a, Vector b) { return compare<Order::kEqual, T, W>(a.v, b.v); }
  PRIMRAY_INLINE friend Bool operator!=(Vector a, Vector b) { return compare<Order::kUnequal, T, W>(a.v, b.v); }
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
#if defined(__AVX512F__)
  if constexpr (W == 16)
    return (typename Vector<T, W>::Raw)_mm512_mask_blend_epi32(m.mask, (__m512i)b.v, (__m512i)a.v);
  else
#endif
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

// -1 in the lanes that are true, otherwise 0.
template <int W>
PRIMRAY_INLINE vint<W> minus_one_where(vbool<W> m) {
#if defined(__AVX512F__)
  if constexpr (W == 16)
    return (vint<16>::Raw)_mm512_movm_epi32(m.mask);
  else
#endif
    return vint<W>(m.v);
}

template <class T, int W>
PRIMRAY_INLINE Vector<T, W> min(Vector<T, W> a, std::type_identity_t<Vector<T, W>> b) {
  // The instructions return the second operand if both are equal or if one is NaN, like the formula.
#if defined(__AVX512F__)
  if constexpr (W == 16 && std::is_same_v<T, float>) return (vfloat<16>::Raw)_mm512_min_ps((__m512)a.v, (__m512)b.v);
#endif
#if defined(__AVX__)
  if constexpr (W == 8 && std::is_same_v<T, float>) return (vfloat<8>::Raw)_mm256_min_ps((__m256)a.v, (__m256)b.v);
#endif
  return a.v < b.v ? a.v : b.v;
}
template <class T, int W>
PRIMRAY_INLINE Vector<T, W> max(Vector<T, W> a, std::type_identity_t<Vector<T, W>> b) {
#if defined(__AVX512F__)
  if constexpr (W == 16 && std::is_same_v<T, float>) return (vfloat<16>::Raw)_mm512_max_ps((__m512)a.v, (__m512)b.v);
#endif
#if defined(__AVX__)
  if constexpr (W == 8 && std::is_same_v<T, float>) return (vfloat<8>::Raw)_mm256_max_ps((__m256)a.v, (__m256)b.v);
#endif
  return a.v > b.v ? a.v : b.v;
}
template <int W>
PRIMRAY_INLINE vfloat<W> clamp(vfloat<W> x, float lo, float hi) {
  return min(max(x, lo), hi);
}

// Reinterprets the bits as another type.
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

// a b + c, rounded once if the ISA class has an instruction for it, for every number of lanes alike.
template <int W>
PRIMRAY_INLINE vfloat<W> multiply_add(vfloat<W> a, vfloat<W> b, vfloat<W> c) {
#if defined(__FMA__)
#if defined(__AVX512F__)
  if constexpr (W == 16) return (typename vfloat<W>::Raw)_mm512_fmadd_ps((__m512)a.v, (__m512)b.v, (__m512)c.v);
#endif
  if constexpr (W == 8) return (typename vfloat<W>::Raw)_mm256_fmadd_ps((__m256)a.v, (__m256)b.v, (__m256)c.v);
  if constexpr (W == 4) return (typename vfloat<W>::Raw)_mm_fmadd_ps((__m128)a.v, (__m128)b.v, (__m128)c.v);
  vfloat<W> r;
  for (int i = 0; i < W; ++i) r.v[i] = __builtin_fmaf(a.v[i], b.v[i], c.v[i]);
  return r;
#else
  return a * b + c;
#endif
}

// Square root of a value that rounding may have made negative.
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
// 32-bit fraction as a float in [0, 1).
template <int W>
PRIMRAY_INLINE vfloat<W> unit_float(vuint<W> a) {
  return to_float(bit_cast<vint<W>>(a >> 8)) * 0x1p-24f;
}
// Floor; for |a| < 2^31.
template <int W>
PRIMRAY_INLINE vint<W> floor_to_int(vfloat<W> a) {
  vint<W> t = truncate(a);
  return t + minus_one_where(to_float(t) > a);
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
// A debug build reads lane by lane, since sanitizers do not check what gather instructions read.
#if defined(__AVX512F__) && !PRIMRAY_DEBUG
#define PRIMRAY_GATHER_16 1
#endif
#if defined(__AVX2__) && !PRIMRAY_DEBUG
#define PRIMRAY_GATHER_8 1
#endif
#if PRIMRAY_GATHER_16
PRIMRAY_INLINE vfloat<16> gather16(const float* base, vint<16> index) {
  return (vfloat<16>::Raw)_mm512_i32gather_ps((__m512i)index.v, base, 4);
}
PRIMRAY_INLINE vint<16> gather16(const int32_t* base, vint<16> index) {
  return (vint<16>::Raw)_mm512_i32gather_epi32((__m512i)index.v, base, 4);
}
#endif
#if PRIMRAY_GATHER_8
PRIMRAY_INLINE vfloat<8> gather8(const float* base, vint<8> index) {
  return (vfloat<8>::Raw)_mm256_i32gather_ps(base, (__m256i)index.v, 4);
}
PRIMRAY_INLINE vint<8> gather8(const int32_t* base, vint<8> index) {
  return (vint<8>::Raw)_mm256_i32gather_epi32(base, (__m256i)index.v, 4);
}
#endif
// base[index] in every lane: all lanes' indices must be in range, even of lanes that are not used.
template <int W, class T>
PRIMRAY_INLINE Vector<T, W> gather(const T* base, vint<W> index) {
#if PRIMRAY_GATHER_16
  if constexpr (W == 16) return gather16(base, index);
#endif
#if PRIMRAY_GATHER_8
  if constexpr (W == 8) return gather8(base, index);
#endif
  Vector<T, W> r;
  for (int i = 0; i < W; ++i) r.v[i] = base[index.v[i]];
  return r;
}
// Words of 32 bits at base + kStride * index in every lane, and those after them: one load of 64 bits per lane and a
// transposition cost less than one gather, where gathers are slow.
template <class T, int W>
struct TwoLanes {
  Vector<T, W> x, y;
};
template <int W, int kStride>
PRIMRAY_INLINE TwoLanes<int32_t, W> gather_words(const void* base, vint<W> index) {
  const char* const bytes = static_cast<const char*>(base);
  using Raw = typename vint<W>::Raw;
#if defined(__AVX512F__)
  if constexpr (W == 16) {
    alignas(64) int32_t at[16];
    store(at, index);
    const auto word = [&](int i) { return bytes + int64_t(at[i]) * kStride; };
    // Lanes i and i + 1, i + 4 and i + 5, ...
    const auto pairs = [&](int i) {
      const auto two = [&](int k) {
        const __m128 low = _mm_castsi128_ps(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(word(k))));
        return _mm_loadh_pi(low, reinterpret_cast<const __m64*>(word(k + 1)));
      };
      const __m256 low = _mm256_insertf128_ps(_mm256_castps128_ps256(two(i)), two(i + 4), 1);
      const __m256 high = _mm256_insertf128_ps(_mm256_castps128_ps256(two(i + 8)), two(i + 12), 1);
      return _mm512_insertf32x8(_mm512_castps256_ps512(low), high, 1);
    };
    const __m512 a = pairs(0), b = pairs(2);
    return {(Raw)_mm512_shuffle_ps(a, b, 0x88), (Raw)_mm512_shuffle_ps(a, b, 0xdd)};
  }
#endif
#if defined(__AVX2__)
  if constexpr (W == 8) {
    alignas(32) int32_t at[8];
    store(at, index);
    const auto word = [&](int i) { return bytes + int64_t(at[i]) * kStride; };
    const auto pairs = [&](int i) {
      const auto two = [&](int k) {
        const __m128 low = _mm_castsi128_ps(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(word(k))));
        return _mm_loadh_pi(low, reinterpret_cast<const __m64*>(word(k + 1)));
      };
      return _mm256_insertf128_ps(_mm256_castps128_ps256(two(i)), two(i + 4), 1);
    };
    const __m256 a = pairs(0), b = pairs(2);
    return {(Raw)_mm256_shuffle_ps(a, b, 0x88), (Raw)_mm256_shuffle_ps(a, b, 0xdd)};
  }
#endif
  TwoLanes<int32_t, W> r;
  for (int i = 0; i < W; ++i) {
    int32_t words[2];
    std::memcpy(words, bytes + int64_t(index[i]) * kStride, sizeof words);
    r.x.set(i, words[0]), r.y.set(i, words[1]);
  }
  return r;
}
// base[index] and base[index + 1] in every lane, both of which must exist.
template <int W, class T>
PRIMRAY_INLINE TwoLanes<T, W> gather_two(const T* base, vint<W> index) {
  const TwoLanes<int32_t, W> r = gather_words<W, int(sizeof(T))>(base, index);
  return {bit_cast<Vector<T, W>>(r.x), bit_cast<Vector<T, W>>(r.y)};
}
// base[index] to base[index + 3] in every lane, all four of which must exist: one load per lane and a transposition cost less
// than gathers of the four, or of three of them.
template <class T, int W>
struct FourLanes {
  Vector<T, W> x, y, z, w;
};
template <int W, class T>
PRIMRAY_INLINE FourLanes<T, W> gather_four(const T* base, vint<W> index) {
#if defined(__AVX512F__)
  if constexpr (W == 16) {
    alignas(64) int32_t at[16];
    store(at, index);
    const auto four = [&](int i) { return _mm_loadu_si128(reinterpret_cast<const __m128i*>(base + at[i])); };
    // Lanes i, i + 4, i + 8, i + 12.
    const auto rows = [&](int i) {
      const __m256i low = _mm256_inserti128_si256(_mm256_castsi128_si256(four(i)), four(i + 4), 1);
      const __m256i high = _mm256_inserti128_si256(_mm256_castsi128_si256(four(i + 8)), four(i + 12), 1);
      return _mm512_inserti64x4(_mm512_castsi256_si512(low), high, 1);
    };
    const __m512i a = rows(0), b = rows(1), c = rows(2), d = rows(3);
    const __m512i ab_xy = _mm512_unpacklo_epi32(a, b), ab_zw = _mm512_unpackhi_epi32(a, b);
    const __m512i cd_xy = _mm512_unpacklo_epi32(c, d), cd_zw = _mm512_unpackhi_epi32(c, d);
    using Raw = typename Vector<T, W>::Raw;
    return {(Raw)_mm512_unpacklo_epi64(ab_xy, cd_xy), (Raw)_mm512_unpackhi_epi64(ab_xy, cd_xy),
            (Raw)_mm512_unpacklo_epi64(ab_zw, cd_zw), (Raw)_mm512_unpackhi_epi64(ab_zw, cd_zw)};
  }
#endif
#if defined(__AVX2__)
  if constexpr (W == 8) {
    alignas(32) int32_t at[8];
    store(at, index);
    const auto four = [&](int i) { return _mm_loadu_si128(reinterpret_cast<const __m128i*>(base + at[i])); };
    const auto rows = [&](int i) { return _mm256_inserti128_si256(_mm256_castsi128_si256(four(i)), four(i + 4), 1); };
    const __m256i a = rows(0), b = rows(1), c = rows(2), d = rows(3);
    const __m256i ab_xy = _mm256_unpacklo_epi32(a, b), ab_zw = _mm256_unpackhi_epi32(a, b);
    const __m256i cd_xy = _mm256_unpacklo_epi32(c, d), cd_zw = _mm256_unpackhi_epi32(c, d);
    using Raw = typename Vector<T, W>::Raw;
    return {(Raw)_mm256_unpacklo_epi64(ab_xy, cd_xy), (Raw)_mm256_unpackhi_epi64(ab_xy, cd_xy),
            (Raw)_mm256_unpacklo_epi64(ab_zw, cd_zw), (Raw)_mm256_unpackhi_epi64(ab_zw, cd_zw)};
  }
#endif
  return {gather<W>(base, index), gather<W>(base + 1, index), gather<W>(base + 2, index), gather<W>(base + 3, index)};
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
