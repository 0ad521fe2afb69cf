// Fog that fills the scene: of constant density below a height, and thinning out exponentially above it. Its extinction is
// grey, so its transmittance has a closed form along any ray and its distances are sampled exactly; a colour is in its albedo.
#pragma once

#include "math/transcendental.hpp"
#include "math/vec3.hpp"
#include "medium/medium.hpp"
#include "scene/fog.hpp"

namespace primray {

// Number that selects the dimensions of a fog's collision and of its emission, beyond those of all vertices.
constexpr int kFogDimensions = 1 << 24;

// (1 - e^-x) / x for x >= 0.
template <int W>
PRIMRAY_INLINE vfloat<W> mean_of_exp(vfloat<W> x) {
  const vfloat<W> series = 1.0f - x * (0.5f - x * (0.166666667f - x * (0.0416666667f - x * 0.00833333333f)));
  return select(x < vfloat<W>(0.05f), series, (1.0f - exp_of_minus(min(x, 1e30f))) / max(x, 1e-30f));
}
// ln(1 + x) / x for x >= 0.
template <int W>
PRIMRAY_INLINE vfloat<W> mean_of_inverse(vfloat<W> x) {
  const vfloat<W> q = 1.0f / (1.0f + x);
  const vfloat<W> log = -0.693147181f * log2_cosine(q, x * (2.0f + x) * q * q);
  return select(x < vfloat<W>(1e-4f), 1.0f - 0.5f * x, log / max(x, 1e-30f));
}
// -ln(1 - y) for 0 <= y < 1.
template <int W>
PRIMRAY_INLINE vfloat<W> depth_of(vfloat<W> y) {
  return -0.693147181f * log2_cosine(1.0f - y, y * (2.0f - y));
}

// Density of the fog at points, relative to that below the top.
template <int W>
PRIMRAY_INLINE vfloat<W> density_at(const Fog& fog, const vvec3<W>& p) {
  using F = vfloat<W>;
  if (fog.up.x == 0 && fog.up.y == 0 && fog.up.z == 0) return F(1.0f);
  const F above = fog.up.x * p.x + fog.up.y * p.y + fog.up.z * p.z - fog.top;
  if (fog.falloff == 0) return select(above > F(0.0f), F(0.0f), F(1.0f));
  return exp_of_minus(max(above, 0.0f) * (1 / fog.falloff));
}

// The fog along rays: lengths are counted as if the density were that below the top.
template <int W>
struct FogAlong {
  using F = vfloat<W>;
  vbool<W> lanes{false};
  F height{0.0f}, slope{0.0f};  // above the top at the origin, and its growth per length
  float falloff = 0;
  float extinction = 0;

  FogAlong() = default;
  PRIMRAY_INLINE FogAlong(const Fog& fog, vbool<W> m, const vvec3<W>& o, const vvec3<W>& d)
      : lanes(m), falloff(fog.falloff), extinction(fog.extinction) {
    const bool endless = fog.up.x == 0 && fog.up.y == 0 && fog.up.z == 0;
    const vvec3<W> up{F(fog.up.x), F(fog.up.y), F(fog.up.z)};
    height = endless ? F(-1.0f) : dot(up, o) - fog.top;
    slope = endless ? F(0.0f) : dot(up, d);
  }

  // Length up to distance `t`, at most kEndless.
  PRIMRAY_INLINE F length(F t) const {
    const F zero(0.0f), way = min(t, kEndless), rise = max(abs(slope), 1e-20f);
    const vbool<W> rises = slope > zero;
    const F reached = min(abs(height) / rise, kEndless);  // distance at which a ray that nears the top is there
    const vbool<W> starts_below = height <= zero;
    const vbool<W> nears = (starts_below & rises) | (!(starts_below | rises));
    const F crossing = select(nears, min(reached, way), F(kEndless));
    // Parts below and above the top.
    const F first = min(crossing, way), second = way - first;
    const F below = select(starts_below, first, second), above = select(starts_below, second, first);
    if (falloff == 0) return below;
    const F lowest = max(select(rises, height, height + slope * above), 0.0f);
    const float per_fall = 1 / falloff;
    return min(below + above * exp_of_minus(lowest * per_fall) * mean_of_exp(rise * above * per_fall), kEndless);
  }
  // Distance up to which the length is `l`; kInfinity if the fog is shorter.
  PRIMRAY_INLINE F distance(F l) const {
    const F zero(0.0f), rise = max(abs(slope), 1e-20f);
    const vbool<W> rises = slope > zero, starts_below = height <= zero;
    const F to_top = abs(height) / rise;
    const F never(kInfinity);
    // Constant density first.
    const vbool<W> in_constant = starts_below & ((!rises) | (l <= to_top));
    if (falloff == 0) return select(in_constant, l, select(starts_below | rises, never, to_top + l));
    const float per_fall = 1 / falloff;
    const F rate = rise * per_fall, start = exp_of_minus(max(height, 0.0f) * per_fall);
    // Upwards: the length left is start (1 - e^-x) / rate.
    const F left = max(select(starts_below, l - to_top, l), 0.0f), y = left * rate / max(start, 1e-37f);
    const vbool<W> ends = y < F(1.0f);
    const F up = select(ends, select(starts_below, to_top, zero) + depth_of(min(y, 0.99999994f)) / rate, never);
    // Downwards: (e^x - 1) start / rate, and then constant.
    const F whole = (1.0f - start) / rate, z = l * rate / max(start, 1e-30f);
    const F near = l / max(start, 1e-30f) * mean_of_inverse(z);
    const F deep = to_top + 0.693147181f * log2(max(start + l * rate, 1e-37f)) / rate;
    const F down = select(l < whole, select(start > F(1e-18f), near, max(deep, 0.0f)), to_top + (l - whole));
    return select(in_constant, l, select(rises, up, down));
  }
  PRIMRAY_INLINE F transmittance(F t) const { return select(lanes, exp_of_minus(extinction * length(t)), F(1.0f)); }
  // Distance at which light collides first, by `u` in [0, 1).
  PRIMRAY_INLINE F collision(F u) const {
    return select(lanes, distance(depth_of(u) / max(F(extinction), 1e-30f)), F(kInfinity));
  }
};

}  // namespace primray
