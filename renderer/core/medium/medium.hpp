// Homogeneous participating media, in lanes: transmittance and distance sampling.
//
// Distances are sampled by the extinction of one channel and weighted by the mean of the densities of all three, each by its
// share of the path's throughput (one-sample multiple importance sampling; Miller, Georgiev and Jarosz 2019, "A null-scattering
// path integral formulation of light transport", spectral MIS). The throughput of a channel then never exceeds the sum of what
// came.
#pragma once

#include "math/transcendental.hpp"
#include "math/vec3.hpp"

namespace primray {

// Distance beyond which a medium has no end: light from beyond all surfaces means that the mesh of the interior is open, and
// such a medium absorbs nothing unless it scatters.
constexpr float kEndless = 1e30f;

template <int W>
struct Medium {
  vvec3<W> extinction{vfloat<W>(0.0f)}, scattering{vfloat<W>(0.0f)};  // per unit of the core's lengths
  vfloat<W> phase{0.0f};                                              // see medium/phase_function.hpp
  PRIMRAY_INLINE vbool<W> exists() const { return max_component(extinction) > vfloat<W>(0.0f); }
  PRIMRAY_INLINE vbool<W> scatters() const { return max_component(scattering) > vfloat<W>(0.0f); }
  // Transmittance over distance `t`.
  PRIMRAY_INLINE vvec3<W> transmittance(vfloat<W> t) const {
    const vfloat<W> way = min(t, kEndless);
    const vvec3<W> left{exp_of_minus(extinction.x * way), exp_of_minus(extinction.y * way), exp_of_minus(extinction.z * way)};
    return select((t >= vfloat<W>(kEndless)) & !scatters(), vvec3<W>(vfloat<W>(1.0f)), left);
  }
};

// Result of distance sampling up to at most `end`.
template <int W>
struct DistanceSample {
  vbool<W> scatters;  // before the end, at `t`
  vfloat<W> t;
  vvec3<W> beta;  // throughput of the path from there on
};

// Draws the distance of a collision by `u` and `channel` in [0, 1), for paths with throughput `beta`.
template <int W>
PRIMRAY_INLINE vfloat<W> draw_distance(const Medium<W>& medium, const vvec3<W>& beta, vfloat<W> u, vfloat<W> channel) {
  const vfloat<W> x = channel * (beta.x + beta.y + beta.z);
  const vvec3<W>& e = medium.extinction;
  const vfloat<W> rate = select(x < beta.x, e.x, select(x < beta.x + beta.y, e.y, e.z));
  // -ln(1 - u) / rate.
  return -0.693147181f * log2_cosine(1.0f - u, u * (2.0f - u)) / max(rate, 1e-30f);
}

template <int W>
PRIMRAY_INLINE DistanceSample<W> sample_distance(const Medium<W>& medium, const vvec3<W>& beta, vfloat<W> end, vfloat<W> u,
                                                 vfloat<W> channel) {
  using F = vfloat<W>;
  using V = vvec3<W>;
  const F scale = 1.0f / max(beta.x + beta.y + beta.z, 1e-30f), t = draw_distance(medium, beta, u, channel);
  const V& e = medium.extinction;
  DistanceSample<W> s;
  s.scatters = t < min(end, kEndless);
  s.t = select(s.scatters, t, end);
  const F way = min(s.t, kEndless);
  const V left{exp_of_minus(e.x * way), exp_of_minus(e.y * way), exp_of_minus(e.z * way)};
  const F by_scattering = dot(beta, e * left) * scale, by_end = dot(beta, left) * scale;
  const V at_scattering = beta * medium.scattering * left * (1.0f / max(by_scattering, 1e-30f));
  s.beta = select(s.scatters, at_scattering, beta * left * (1.0f / max(by_end, 1e-30f)));
  return s;
}

}  // namespace primray
