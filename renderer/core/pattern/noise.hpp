// Noise on lattices, in lanes: gradient and cell noise, Worley noise and flakes, the functions of MaterialX's library, with the
// same hash of cells, so that images match.
//
// Perlin 2002, "Improving Noise", with gradients chosen and scaled as in Open Shading Language; the hash is the final mixing of
// Bob Jenkins's lookup3 (2006, public domain).
#pragma once

#include "math/lanes.hpp"
#include "math/transcendental.hpp"

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

namespace primray::pattern {

// Worley noise: distances to the nearest of feature points, one in each cell, or the cell value of the nearest.

// Nearest feature points in the surrounding cells.
template <int N, int W>
struct Nearest {
  vfloat<W> square[3];  // squared distances, the least first
  vfloat<W> offset[N];  // from here to the nearest
};

template <int N, int W>
PRIMRAY_INLINE Nearest<N, W> nearest_points(const vfloat<W>* p, vfloat<W> jitter) {
  using F = vfloat<W>;
  Cell<N, W> home;
  F local[N];
  for (int k = 0; k < N; ++k) home.at[k] = floor_to_int(p[k]), local[k] = p[k] - to_float(home.at[k]);
  Nearest<N, W> r;
  for (F& s : r.square) s = F(1e6f);
  for (F& o : r.offset) o = F(0.0f);
  constexpr int kCells = N == 2 ? 9 : 27;
  for (int i = 0; i < kCells; ++i) {
    // The last coordinate varies fastest: of equally near points the first is kept.
    const int step[3] = {N == 2 ? i / 3 - 1 : i / 9 - 1, N == 2 ? i % 3 - 1 : i / 3 % 3 - 1, i % 3 - 1};
    Cell<N, W> cell;
    for (int k = 0; k < N; ++k) cell.at[k] = home.at[k] + vint<W>(step[k]);
    F to[N], square(0.0f);
    for (int k = 0; k < N; ++k) {
      to[k] = (fraction(cell.hash(uint32_t(k))) - 0.5f) * jitter + 0.5f + float(step[k]) - local[k];
      square += to[k] * to[k];
    }
    const vbool<W> first = square < r.square[0], second = square < r.square[1], third = square < r.square[2];
    r.square[2] = select(second, r.square[1], select(third, square, r.square[2]));
    r.square[1] = select(first, r.square[0], select(second, square, r.square[1]));
    r.square[0] = select(first, square, r.square[0]);
    for (int k = 0; k < N; ++k) r.offset[k] = select(first, to[k], r.offset[k]);
  }
  return r;
}

template <int N, int W>
PRIMRAY_INLINE void worley_distances(const vfloat<W>* p, vfloat<W> jitter, int count, vfloat<W>* out) {
  const Nearest<N, W> found = nearest_points<N>(p, jitter);
  for (int i = 0; i < count; ++i) out[i] = sqrt(found.square[i]);
}

// One, two or three numbers in [0, 1] for the cell of the nearest feature point.
template <int N, int W>
PRIMRAY_INLINE void worley_cells(const vfloat<W>* p, vfloat<W> jitter, int count, vfloat<W>* out) {
  const Nearest<N, W> found = nearest_points<N>(p, jitter);
  Cell<N, W> cell;
  for (int k = 0; k < N; ++k) cell.at[k] = floor_to_int(p[k] + found.offset[k]);
  for (int i = 0; i < count; ++i) out[i] = fraction(count == 1 ? cell.hash() : cell.hash(uint32_t(i)));
}

}  // namespace primray::pattern

namespace primray::pattern {

// Flakes: randomly rotated cubes, at most one per cell, of which the one of highest priority is visible.
//
// Implements flake3d of MaterialX 1.39. A rotation is made of three random numbers after Arvo, "Fast Random Rotation Matrices"
// (Graphics Gems III, 1992).
template <int W>
PRIMRAY_INLINE vfloat<W> hash_more(const Cell<3, W>& cell, uint32_t more, uint32_t channel, uint32_t words) {
  HashState<W> s = cell.state(words);
  s.mix();
  s.a += vuint<W>(more), s.b += vuint<W>(channel);
  return fraction(s.end());
}

template <int W>
PRIMRAY_INLINE vvec3<W> turned(const vvec3<W>& p, const vfloat<W> (&u)[3]) {
  using F = vfloat<W>;
  const SinCos<W> theta = sincos_turns(u[0]), phi = sincos_turns(u[1]);
  const F z = u[2] * 2.0f, r = sqrt(z);
  const vvec3<W> v{phi.sin * r, phi.cos * r, safe_sqrt(2.0f - z)};
  const F sx = v.x * theta.cos - v.y * theta.sin, sy = v.x * theta.sin + v.y * theta.cos;
  return vvec3<W>{v.x * sx - theta.cos, v.x * sy - theta.sin, v.x * v.z} * p.x +
         vvec3<W>{v.y * sx + theta.sin, v.y * sy - theta.cos, v.y * v.z} * p.y + vvec3<W>{v.z * sx, v.z * sy, 1.0f - z} * p.z;
}

// `p`: in flake sizes. Returns presence, two numbers for the flake's normal, and its own random number.
template <int W>
PRIMRAY_INLINE void flake(const vfloat<W>* at, vfloat<W> probability, vfloat<W>* out) {
  using F = vfloat<W>;
  constexpr float kDiameter = 0.866025404f;  // 1.5 / sqrt(3)
  const Cell<3, W> home{{floor_to_int(at[0]), floor_to_int(at[1]), floor_to_int(at[2])}};
  F best(0.0f);
  Cell<3, W> seen{{vint<W>(0), vint<W>(0), vint<W>(0)}};
  for (int i = 0; i < 27; ++i) {
    const int step[3] = {i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1};
    Cell<3, W> cell;
    F d[3];
    for (int k = 0; k < 3; ++k) cell.at[k] = home.at[k] + vint<W>(step[k]), d[k] = at[k] - to_float(cell.at[k]) - 0.5f;
    vbool<W> there = d[0] * d[0] + d[1] * d[1] + d[2] * d[2] < F(kDiameter * kDiameter * 3.0f);
    there &= !(fraction(cell.hash()) > probability);
    if (!any(there)) continue;
    const F priority = fraction(cell.hash(3u));
    there &= !(priority < best);
    const F turn[3] = {fraction(cell.hash(0u)), fraction(cell.hash(1u)), fraction(cell.hash(2u))};
    const vvec3<W> q = abs(turned(vvec3<W>{d[0], d[1], d[2]}, turn));
    there &= max_component(q) <= F(kDiameter);
    best = select(there, priority, best);
    for (int k = 0; k < 3; ++k) seen.at[k] = select(there, cell.at[k], seen.at[k]);
  }
  const vbool<W> is = best > F(0.0f);
  out[0] = select(is, best, 0.0f);
  for (uint32_t k = 0; k < 3; ++k) out[1 + k] = select(is, hash_more(seen, 2u, k, 5u), 0.0f);
}

}  // namespace primray::pattern
