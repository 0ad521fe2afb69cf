// Phase functions of media, per solid angle, by the cosine of the angle between the directions of propagation before and after.
//
// A medium has one number for its phase function. In (-1, 1) it is the mean cosine of Henyey and Greenstein's (1941, "Diffuse
// radiation in the galaxy"). From kDroplets on, it is kDroplets plus the diameter of water droplets in micrometres, up to 50:
// their Mie scattering of visible light by the fit of Jendersie and d'Eon (2023, "An Approximate Mie Scattering Function for
// Fog and Cloud Rendering"), a blend of Henyey and Greenstein's function with that of Draine (2003, "Scattering by Interstellar
// Dust Grains. I. Optical and Ultraviolet"). Lanes without droplets cost one branch more than Henyey and Greenstein's alone.
#pragma once

#include <cmath>

#include "math/transcendental.hpp"
#include "math/vec3.hpp"

namespace primray {

constexpr float kDroplets = 2.0f, kLargestDroplet = 50.0f;
constexpr float kInvFourPi = 0.0795774715f;

// Returns the direction about +z with this cosine, turned by `v`.
template <int W>
PRIMRAY_INLINE vvec3<W> direction_at(vfloat<W> cosine, vfloat<W> sine, vfloat<W> v) {
  const SinCos<W> phi = sincos_turns(v);
  return {sine * phi.cos, sine * phi.sin, cosine};
}
template <int W>
PRIMRAY_INLINE vvec3<W> direction_at(vfloat<W> cosine, vfloat<W> v) {
  return direction_at(cosine, safe_sqrt(1.0f - cosine * cosine), v);
}

template <int W>
PRIMRAY_INLINE vbool<W> is_droplets(vfloat<W> phase) {
  return phase > vfloat<W>(1.0f);
}

// Henyey and Greenstein's function by q = 1 + g^2 - 2 g cosine, in lanes or of doubles. `isotropic`: the value without a
// preferred direction.
template <class F>
PRIMRAY_INLINE F henyey_greenstein_at(F q, F g, float isotropic) {
  using std::sqrt;
  return (1.0f - g * g) * isotropic / (q * sqrt(q));
}
template <int W>
PRIMRAY_INLINE vfloat<W> henyey_greenstein(vfloat<W> cosine, vfloat<W> g) {
  return henyey_greenstein_at(max(1.0f + g * g - 2.0f * g * cosine, 1e-12f), g, kInvFourPi);
}

// Cosine of a direction sampled from Henyey and Greenstein's function; u = 0 is straight ahead.
template <int W>
PRIMRAY_INLINE vfloat<W> sample_henyey_greenstein(vfloat<W> g, vfloat<W> u) {
  using F = vfloat<W>;
  const F even = 1.0f - 2.0f * u, q = (1.0f - g * g) / (1.0f + g * even);
  const vbool<W> flat = abs(g) < F(1e-3f);
  // First terms of its series near 0.
  const F peaked = (1.0f + g * g - q * q) / select(flat, F(1.0f), 2.0f * g);
  return clamp(select(flat, even + 1.5f * g * (1.0f - even * even), peaked), -1.0f, 1.0f);
}

// Draine's phase function: Henyey and Greenstein's times 1 + alpha cosine^2, normalised. With alpha = 1 and g = 0 it is
// Rayleigh's, with alpha = 1 alone Cornette and Shanks's.
template <int W>
struct Draine {
  using F = vfloat<W>;
  F g, alpha;

  PRIMRAY_INLINE F norm() const { return 1.0f + alpha * (1.0f + 2.0f * g * g) * (1.0f / 3); }
  PRIMRAY_INLINE F density(F cosine) const { return henyey_greenstein(cosine, g) * (1.0f + alpha * cosine * cosine) / norm(); }
  PRIMRAY_INLINE F mean_cosine() const { return g * (1.0f + alpha * (3.0f + 2.0f * g * g) * 0.2f) / norm(); }

  // Cosine of a sampled direction; u = 0 is straight ahead. The integral of the density from there is known in closed form as a
  // function of s, the integral of Henyey and Greenstein's; Newton's method inverts it. Its slope, (1 + alpha cosine^2) / norm,
  // falls up to the cosine 0 and then rises, so that steps from the end on the result's side of that never pass the result.
  PRIMRAY_INLINE F sample(F u) const {
    const F c = 1.0f + g * g, scale = 1.0f / norm();
    const F middle = (1.0f + g) * (g / (sqrt(c) + 1.0f) + 1.0f) / (2.0f * sqrt(c));
    const vbool<W> backward = u > middle * (1.0f + alpha * mean_square(F(0.0f), (1.0f - g) * sqrt(c))) * scale;
    F s = select(backward, F(1.0f), F(0.0f)), cosine = select(backward, F(-1.0f), F(1.0f));
    vbool<W> active(true);
    // Some 6 steps are usual, and 16 the most with the alphas of droplets.
    for (int step = 0; step < 32 && any(active); ++step) {
      const F z = 1.0f + g * (1.0f - 2.0f * s), p = (1.0f - g) * (1.0f - g * g) / z;
      const F left = u - s * (1.0f + alpha * mean_square(cosine, p)) * scale;
      const F next = clamp(s + left / ((1.0f + alpha * cosine * cosine) * scale), 0.0f, 1.0f);
      const vbool<W> moved = active & (select(backward, s - next, next - s) > 1e-7f * next);
      s = select(active, next, s), cosine = select(active, cosine_at(s), cosine);
      active = moved;
    }
    return clamp(cosine, -1.0f, 1.0f);
  }

 private:
  // Cosine up to which the integral of Henyey and Greenstein's function is s: sample_henyey_greenstein without its division by
  // g.
  PRIMRAY_INLINE F cosine_at(F s) const {
    const F e = 1.0f - 2.0f * s, z = 1.0f + g * e, g2 = g * g;
    return (e + g * (0.5f * (e * e + 3.0f) + g * e + 0.5f * g2 * (e * e - 1.0f))) / (z * z);
  }
  // Mean square of the cosine by Henyey and Greenstein's function, from straight ahead to `cosine`. With c = 1 + g^2 and
  // y^2 = c - 2 g cosine, it follows from the integral of (c - y^2)^2 / (2 g)^2; written so that nothing is divided by g.
  // p: y times its value straight ahead, 1 - g.
  PRIMRAY_INLINE F mean_square(F cosine, F p) const {
    const F c = 1.0f + g * g, t = (2.0f * c * (1.0f + cosine) - 4.0f * g * cosine) / (c + p);
    return (t * t * (3.0f * c + p) - 4.0f * cosine * p) / (12.0f * c);
  }
};

// Lobes of droplets: Draine's with probability `weight`, else Henyey and Greenstein's with mean cosine `g`.
template <int W>
struct DropletLobes {
  using F = vfloat<W>;
  F g;
  Draine<W> draine;
  F weight;

  // Jendersie and d'Eon 2023, table of fits by the diameter.
  PRIMRAY_RARE static DropletLobes of(F phase) {
    const F d = clamp(phase - kDroplets, 1e-3f, kLargestDroplet);
    const vbool<W> below_5 = d < F(5.0f);
    const F large = max(d, 5.0f);
    DropletLobes r;
    r.g = exp(-0.0990567f / (large - 1.67154f));
    r.draine.g = exp(-2.20679f / (large + 3.91029f) - 0.428934f);
    r.draine.alpha = exp(3.62489f - 8.29288f / (large + 5.52825f));
    r.weight = exp(-0.599085f / (large - 0.641583f) - 0.665888f);
    if (any(below_5)) r.take(below_5 & (d >= F(1.5f)), medium_sized(clamp(d, 1.5f, 5.0f)));
    if (any(d < F(1.5f))) {
      r.take((d < F(1.5f)) & (d > F(0.1f)), small(clamp(d, 0.1f, 1.5f)));
      r.take(d <= F(0.1f), tiny(min(d, 0.1f)));
    }
    return r;
  }

  PRIMRAY_INLINE F density(F cosine) const {
    // The peak of large droplets is so narrow that 1 + g^2 - 2 g cosine would have no digits left.
    const F close = 1.0f - g, q = close * close + 2.0f * g * (1.0f - cosine);
    const F peak = close * (1.0f + g) * kInvFourPi / (q * sqrt(q));
    return peak + weight * (draine.density(cosine) - peak);
  }
  PRIMRAY_INLINE F mean_cosine() const { return g + weight * (draine.mean_cosine() - g); }
  // 1 minus the cosine of a sampled direction, which has more digits than the cosine has.
  PRIMRAY_INLINE F sample(F u) const {
    const vbool<W> broad = u < weight;
    const F rest = min(select(broad, u / weight, (u - weight) / (1.0f - weight)), 0x1.fffffep-1f);
    const F close = 1.0f - g, z = 1.0f + g * (1.0f - 2.0f * rest);
    const F peak = close * rest * (close * (1.0f + g) / z + close) / z;
    return any(broad) ? select(broad, 1.0f - draine.sample(rest), peak) : peak;
  }

 private:
  PRIMRAY_INLINE static F exp(F x) { return exp2(1.44269504f * x); }
  PRIMRAY_INLINE static F log(F x) { return log2(x) * 0.693147181f; }
  PRIMRAY_INLINE static SinCos<W> sincos(F x) { return sincos_turns(x * 0.159154943f); }
  PRIMRAY_INLINE void take(vbool<W> m, const DropletLobes& o) {
    g = select(m, o.g, g), weight = select(m, o.weight, weight);
    draine.g = select(m, o.draine.g, draine.g), draine.alpha = select(m, o.draine.alpha, draine.alpha);
  }
  // From 1.5 to 5 micrometres.
  static DropletLobes medium_sized(F d) {
    const F l = log(d), ll = log(l);
    const SinCos<W> a = sincos(l);
    DropletLobes r;
    r.g = 0.0604931f * ll + 0.940256f;
    r.draine.g = 0.500411f - 0.081287f / (a.sin / a.cos - 2.0f * l + 1.27551f);
    r.draine.alpha = 7.30354f * l + 6.31675f;
    r.weight = 0.026914f * (l - sincos(5.68947f * (ll - 0.0292149f)).cos) + 0.376475f;
    return r;
  }
  // From 0.1 to 1.5 micrometres.
  static DropletLobes small(F d) {
    const F l = log(d), inner = sincos((l - 0.238604f) * (l + 1.00667f) / (0.507522f - 0.15677f * l)).cos;
    DropletLobes r;
    r.g = 0.862f - 0.143f * l * l;
    r.draine.g = 0.379685f * sincos(1.19692f * inner + 1.37932f * l + 0.0625835f).cos + 0.344213f;
    r.draine.alpha = F(250.0f);
    r.weight = 0.146209f * sincos(3.38707f * l + 2.11193f).cos + 0.316072f + 0.0778917f * l;
    return r;
  }
  // Up to 0.1 micrometres, where it approaches Rayleigh's function.
  static DropletLobes tiny(F d) {
    DropletLobes r;
    r.g = 13.8f * d * d;
    r.draine.g = 1.1456f * d * sincos(9.29044f * d).sin;
    r.draine.alpha = F(250.0f);
    r.weight = 0.252977f - 312.983f * exp2(4.3f * log2(d));
    return r;
  }
};

template <int W>
PRIMRAY_RARE vfloat<W> droplet_density(vfloat<W> cosine, vfloat<W> phase) {
  return DropletLobes<W>::of(phase).density(cosine);
}

template <int W>
PRIMRAY_RARE vvec3<W> sample_droplets(vfloat<W> phase, vfloat<W> u, vfloat<W> v) {
  const vfloat<W> off = DropletLobes<W>::of(phase).sample(u);
  return direction_at(1.0f - off, safe_sqrt(off * (2.0f - off)), v);
}

template <int W>
PRIMRAY_INLINE vfloat<W> phase_density(vfloat<W> cosine, vfloat<W> phase) {
  const vfloat<W> density = henyey_greenstein(cosine, phase);
  const vbool<W> droplets = is_droplets(phase);
  if (any(droplets)) [[unlikely]]
    return select(droplets, droplet_density(cosine, phase), density);
  return density;
}

template <int W>
PRIMRAY_RARE vfloat<W> mean_cosine(vfloat<W> phase) {
  return select(is_droplets(phase), DropletLobes<W>::of(phase).mean_cosine(), phase);
}

// Samples the phase function: the direction of propagation, about +z.
template <int W>
PRIMRAY_INLINE vvec3<W> sample_phase(vfloat<W> phase, vfloat<W> u, vfloat<W> v) {
  const vvec3<W> found = direction_at(sample_henyey_greenstein(phase, u), v);
  const vbool<W> droplets = is_droplets(phase);
  if (any(droplets)) [[unlikely]]
    return select(droplets, sample_droplets(phase, u, v), found);
  return found;
}

}  // namespace primray
