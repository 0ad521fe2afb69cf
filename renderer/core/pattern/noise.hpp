// Gradient and cell noise on lattices, in lanes: the functions of MaterialX's library, with the same hash of cells, so that
// images match.
//
// Perlin 2002, "Improving Noise", with gradients chosen and scaled as in Open Shading Language; the hash is the final mixing of
// Bob Jenkins's lookup3 (2006, public domain).
#pragma once

#include "math/lanes.hpp"

namespace primray::pattern {

template <int W>
PRIMRAY_INLINE vuint<W> rotated(vuint<W> x, int k) {
  return (x << k) | (x >> (32 - k));
}

// Three words of lookup3's state.
template <int W>
struct HashState {
  vuint<W> a, b, c;

  PRIMRAY_INLINE explicit HashState(uint32_t words) : a(0xdeadbeefu + (words << 2) + 13u), b(a), c(a) {}
  PRIMRAY_INLINE void mix() {
    a -= c, a = a ^ rotated(c, 4), c += b;
    b -= a, b = b ^ rotated(a, 6), a += c;
    c -= b, c = c ^ rotated(b, 8), b += a;
    a -= c, a = a ^ rotated(c, 16), c += b;
    b -= a, b = b ^ rotated(a, 19), a += c;
    c -= b, c = c ^ rotated(b, 4), b += a;
  }
  // Final mixing.
  PRIMRAY_INLINE vuint<W> end() const {
    vuint<W> x = a, y = b, z = c;
    z = (z ^ y) - rotated(y, 14);
    x = (x ^ z) - rotated(z, 11);
    y = (y ^ x) - rotated(x, 25);
    z = (z ^ y) - rotated(y, 16);
    x = (x ^ z) - rotated(z, 4);
    y = (y ^ x) - rotated(x, 14);
    return (z ^ y) - rotated(y, 24);
  }
};

// Cell of two or three integer coordinates.
template <int N, int W>
struct Cell {
  vint<W> at[N];

  // State with the cell in it, of `words` in all.
  PRIMRAY_INLINE HashState<W> state(uint32_t words) const {
    HashState<W> s(words);
    vuint<W>* to[3] = {&s.a, &s.b, &s.c};
    for (int k = 0; k < N; ++k) *to[k] += bit_cast<vuint<W>>(at[k]);
    return s;
  }
  PRIMRAY_INLINE vuint<W> hash() const { return state(N).end(); }
  // Hash in [0, 1] of the cell and one further number, the channel.
  PRIMRAY_INLINE vuint<W> hash(uint32_t more) const {
    HashState<W> s = state(N + 1);
    if constexpr (N == 3) s.mix(), s.a += vuint<W>(more);
    if constexpr (N == 2) s.c += vuint<W>(more);
    return s.end();
  }
};

// All 32 bits as a fraction, rounded once; 1 at most.
template <int W>
PRIMRAY_INLINE vfloat<W> fraction(vuint<W> bits) {
  const vint<W> high = bit_cast<vint<W>>(bits >> 16), low = bit_cast<vint<W>>(bits & vuint<W>(0xffffu));
  return (to_float(high) * 65536.0f + to_float(low)) * 0x1p-32f;
}

template <int W>
PRIMRAY_INLINE vfloat<W> negated_where(vfloat<W> x, vuint<W> bit) {
  return bit_cast<vfloat<W>>(bit_cast<vuint<W>>(x) ^ (bit << 31));
}

// Gradient at a lattice point, times the offset from it.
template <int W>
PRIMRAY_INLINE vfloat<W> sloped(vuint<W> hash, const vfloat<W> (&d)[2]) {
  const vuint<W> h = hash & vuint<W>(7u), one(1u);
  const vbool<W> low = h < vuint<W>(4u);
  const vfloat<W> u = select(low, d[0], d[1]), v = 2.0f * select(low, d[1], d[0]);
  return negated_where(u, h & one) + negated_where(v, (h >> 1) & one);
}
template <int W>
PRIMRAY_INLINE vfloat<W> sloped(vuint<W> hash, const vfloat<W> (&d)[3]) {
  const vuint<W> h = hash & vuint<W>(15u), one(1u);
  const vfloat<W> u = select(h < vuint<W>(8u), d[0], d[1]);
  const vbool<W> first = (h == vuint<W>(12u)) | (h == vuint<W>(14u));
  const vfloat<W> v = select(h < vuint<W>(4u), d[1], select(first, d[0], d[2]));
  return negated_where(u, h & one) + negated_where(v, (h >> 1) & one);
}

// Perlin noise of N coordinates, approximately in [-1, 1]: 1 to 3 channels, of which the first equals the single-channel noise.
template <int N, int W>
PRIMRAY_INLINE void noise(const vfloat<W> (&p)[N], int channels, vfloat<W>* out) {
  using F = vfloat<W>;
  vint<W> cell[N];
  F f[N], fade[N];
  for (int k = 0; k < N; ++k) {
    cell[k] = floor_to_int(p[k]);
    f[k] = p[k] - to_float(cell[k]);
    fade[k] = f[k] * f[k] * f[k] * (f[k] * (f[k] * 6.0f - 15.0f) + 10.0f);
  }
  constexpr int kCorners = 1 << N;
  vuint<W> hash[kCorners];
  F between[kCorners][N];
  for (int c = 0; c < kCorners; ++c) {
    Cell<N, W> at;
    for (int k = 0; k < N; ++k) {
      const int step = c >> k & 1;
      at.at[k] = cell[k] + vint<W>(step), between[c][k] = f[k] - float(step);
    }
    hash[c] = at.hash();
  }
  constexpr float kScale = N == 2 ? 0.6616f : 0.9820f;
  for (int channel = 0; channel < channels; ++channel) {
    F value[kCorners];
    for (int c = 0; c < kCorners; ++c) value[c] = sloped(hash[c] >> (8 * channel), between[c]);
    for (int k = 0, left = kCorners; k < N; ++k) {
      left >>= 1;
      for (int c = 0; c < left; ++c) value[c] = value[2 * c] * (1.0f - fade[k]) + value[2 * c + 1] * fade[k];
    }
    out[channel] = value[0] * kScale;
  }
}

// Maximum number of octaves: further ones would be below float precision.
constexpr float kMostOctaves = 32;

// Fractal noise: each octave is `lacunarity` times as fine and `diminish` times as high as the one before.
template <int N, int W>
PRIMRAY_INLINE void fractal(const vfloat<W>* at, vfloat<W> octaves, vfloat<W> lacunarity, vfloat<W> diminish, int channels,
                            vfloat<W>* out) {
  using F = vfloat<W>;
  F p[N], amplitude(1.0f), sum[3] = {F(0.0f), F(0.0f), F(0.0f)};
  for (int k = 0; k < N; ++k) p[k] = at[k];
  for (float i = 0; i < kMostOctaves; ++i) {
    const vbool<W> wanted = F(i) < octaves;
    if (!any(wanted)) break;
    F value[3];
    noise<N>(p, channels, value);
    for (int c = 0; c < channels; ++c) sum[c] = select(wanted, sum[c] + amplitude * value[c], sum[c]);
    amplitude *= diminish;
    for (F& x : p) x *= lacunarity;
  }
  for (int c = 0; c < channels; ++c) out[c] = sum[c];
}

// One number in [0, 1] for each cell.
template <int N, int W>
PRIMRAY_INLINE vfloat<W> cell_noise(const vfloat<W>* p) {
  Cell<N, W> cell;
  for (int k = 0; k < N; ++k) cell.at[k] = floor_to_int(p[k]);
  return fraction(cell.hash());
}

}  // namespace primray::pattern
