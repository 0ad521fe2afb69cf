// Flakes: randomly rotated cubes, at most one per cell, of which the one of highest priority is visible.
//
// Implements flake3d of MaterialX 1.39. A rotation is made of three random numbers after Arvo, "Fast Random Rotation Matrices"
// (Graphics Gems III, 1992).
#pragma once

#include "math/transcendental.hpp"
#include "pattern/noise.hpp"

namespace primray::pattern {

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
