// Guiding of random walks below opaque surfaces towards the surface (Krivanek and d'Eon 2014, "A Zero-Variance-Based Sampling
// Scheme for Monte Carlo Subsurface Scattering", by Dwivedi 1982).
//
// Deep in a half-space whose every path out counts the same, the light that gets out falls as exp(-z / nu) with the depth z in
// mean free paths, where nu is the diffusion length of the albedo. The walk that follows that importance has directions with a
// density as 1 / (nu - w), where w is the cosine with the normal, and an extinction that is 1 - w / nu times the medium's.
//
// A body ends on the other side too. In a slab of thickness D the importance is that of both surfaces, proportional to
// cosh((D - 2 z) / (2 nu)): walks are guided towards the nearer one, and with a share of tanh(|D - 2 z| / (2 nu)) of the most,
// which is the relative slope. So nothing is guided in the middle of a body, in thin ones, and in those that lose no light.
// D is measured along the path's first ray. Directions and distances are sampled by a mixture of the medium's own and of the
// guide's, for each channel by its share of the throughput, and weighted by the whole mixture's density (one-sample multiple
// importance sampling); the same guide is right whatever the shape, if less useful far from a slab.
#pragma once

#include "medium/medium.hpp"
#include "medium/phase_function.hpp"

namespace primray {

// Largest share of guided steps.
constexpr float kGuidedSteps = 0.6f;
// Limits of the diffusion length, in mean free paths. From the upper one on, at an albedo of 0.9998, nothing is guided.
constexpr float kLeastDiffusion = 1.0005f, kMostDiffusion = 40;
// Value of WalkGuide::middle before the first collision.
constexpr float kUnguided = 1e30f;
// The first ray of a walk is traced this many diffusion lengths far at least.
constexpr float kMeasuredLengths = 4;

// Dwivedi's diffusion length for isotropic scattering, in mean free paths, by a fit (Cycles, subsurface_random_walk.h);
// Krivanek and d'Eon 2014 give its equation.
template <int W>
PRIMRAY_INLINE vfloat<W> diffusion_length(vfloat<W> albedo) {
  const vfloat<W> a = clamp(albedo, 0.2f, 1.0f);
  const vfloat<W> left = 1.0f - power_of_unit<W>(a, 2.44294f - 0.0215813f * a + 0.578637f / a);
  return clamp(1.0f / sqrt(max(left, 1e-8f)), kLeastDiffusion, kMostDiffusion);
}

// Guide of a path in a walk, at its last vertex.
template <int W>
struct WalkGuide {
  vvec3<W> normal{vfloat<W>(0.0f)};  // outwards, where the path entered
  vfloat<W> middle{kUnguided};       // D - 2 z
  vfloat<W> phase_pdf{1.0f};         // density of the ray's direction by the phase function
  vvec3<W> nu{vfloat<W>(2.0f)};      // diffusion length by channel, in mean free paths

  // Guide of paths that enter `medium` below a surface with this normal.
  static PRIMRAY_RARE WalkGuide entering(const Medium<W>& medium, const vvec3<W>& normal) {
    WalkGuide r;
    const auto length = [](vfloat<W> scattering, vfloat<W> extinction) {
      return diffusion_length<W>(scattering / max(extinction, 1e-30f));
    };
    r.normal = normal;
    r.nu = {length(medium.scattering.x, medium.extinction.x), length(medium.scattering.y, medium.extinction.y),
            length(medium.scattering.z, medium.extinction.z)};
    return r;
  }
  PRIMRAY_INLINE vbool<W> guides() const { return abs(middle) < vfloat<W>(kUnguided); }
  // Distance that the first ray is traced at least.
  PRIMRAY_INLINE vfloat<W> measured(const Medium<W>& medium) const {
    const vvec3<W>& e = medium.extinction;
    const auto length = [](vfloat<W> nu, vfloat<W> extinction) { return nu / max(extinction, 1e-30f); };
    return kMeasuredLengths * max(max(length(nu.x, e.x), length(nu.y, e.y)), length(nu.z, e.z));
  }
  // Moves the guide to the collision at distance `t` along direction `d`; `end`: where that ray ended, or hit.
  PRIMRAY_INLINE void move(const vvec3<W>& d, vfloat<W> t, vfloat<W> end) {
    const vfloat<W> out = dot(d, normal);
    middle = select(guides(), middle, abs(out) * end) + 2.0f * out * t;
  }
};

// Mixture by which a guided walk samples its next step: the shares of the medium's own directions and distances, and of guided
// ones, by channel. They add up to 1.
template <int W>
struct StepMixture {
  using F = vfloat<W>;
  using V = vvec3<W>;
  V classic, guided;
  V nearer;  // normal of the nearer surface
  const V& nu;
  V range;  // ln((nu + 1) / (nu - 1))

  PRIMRAY_INLINE StepMixture(const WalkGuide<W>& guide, const Medium<W>& medium, const V& beta) : nu(guide.nu) {
    const F scale = 1.0f / max(beta.x + beta.y + beta.z, 1e-30f), away = abs(guide.middle), mean_cosine = medium.phase;
    const F kept = 1.0f - abs(mean_cosine), most = kGuidedSteps * kept * kept;
    const auto share = [&](F extinction, F length) {
      const F e = exp_of_minus(away * extinction / length);
      return select(length < F(kMostDiffusion), most * (1.0f - e) / (1.0f + e), 0.0f);
    };
    const auto log_of = [](F length) { return 0.693147181f * log2<W>((length + 1.0f) / (length - 1.0f)); };
    const V own = beta * scale;
    guided = {share(medium.extinction.x, nu.x), share(medium.extinction.y, nu.y), share(medium.extinction.z, nu.z)};
    guided = select(guide.guides(), guided * own, V(F(0.0f)));
    classic = own - guided;
    nearer = select(guide.middle < F(0.0f), -guide.normal, guide.normal);
    range = {log_of(nu.x), log_of(nu.y), log_of(nu.z)};
  }
  // Densities of guided directions with cosine `w` about the nearer surface's normal, per solid angle.
  PRIMRAY_INLINE V density(F w) const {
    const auto of = [&](F length, F log) { return (0.5f * kInvPi) / ((length - w) * log); };
    return {of(nu.x, range.x), of(nu.y, range.y), of(nu.z, range.z)};
  }
};

// Direction of a step.
template <int W>
struct WalkDirection {
  vvec3<W> d;
  vfloat<W> phase_pdf;
  vfloat<W> weight;  // of the throughput
};

// Samples the direction in which the walk leaves the guide's vertex, where it came along `d`.
template <int W>
PRIMRAY_INLINE WalkDirection<W> sample_walk_direction(const WalkGuide<W>& guide, const Medium<W>& medium, const vvec3<W>& beta,
                                                      const vvec3<W>& d, vfloat<W> u, vfloat<W> v) {
  using F = vfloat<W>;
  using V = vvec3<W>;
  const StepMixture<W> mix(guide, medium, beta);

  // Choose between the phase function and the guides of the channels; what is left of `u` is uniform again.
  const F by_phase = mix.classic.x + mix.classic.y + mix.classic.z, after_x = by_phase + mix.guided.x,
          after_y = after_x + mix.guided.y;
  const vbool<W> by_guide = u >= by_phase;
  const F begin = select(u < after_x, by_phase, select(u < after_y, after_x, after_y));
  const F size = select(u < after_x, mix.guided.x, select(u < after_y, mix.guided.y, mix.guided.z));
  const F length = select(u < after_x, mix.nu.x, select(u < after_y, mix.nu.y, mix.nu.z));
  const F log = select(u < after_x, mix.range.x, select(u < after_y, mix.range.y, mix.range.z));
  const F rest = clamp(select(by_guide, (u - begin) / max(size, 1e-30f), u / max(by_phase, 1e-30f)), 0.0f, 0x1.fffffep-1f);

  WalkDirection<W> r;
  r.d = Frame<F>(d).to_world(sample_phase(medium.phase, rest, v));
  if (any(by_guide)) {
    const F w = clamp(length - (length + 1.0f) * exp_of_minus(rest * log), -1.0f, 1.0f);
    r.d = select(by_guide, Frame<F>(mix.nearer).to_world(direction_at(w, v)), r.d);
  }
  r.phase_pdf = max(phase_density(dot(r.d, d), medium.phase), 1e-30f);
  r.weight = r.phase_pdf / (by_phase * r.phase_pdf + dot(mix.guided, mix.density(dot(r.d, mix.nearer))));
  return r;
}

// Distances of a step along direction `d`: six exponential distributions with these shares and rates.
template <int W>
struct WalkDistance {
  using F = vfloat<W>;
  using V = vvec3<W>;
  V classic, guided, extinction, stretched;

  WalkDistance() = default;
  PRIMRAY_INLINE WalkDistance(const WalkGuide<W>& guide, const Medium<W>& medium, const V& beta, const V& d)
      : extinction(medium.extinction) {
    const StepMixture<W> mix(guide, medium, beta);
    const F w = dot(d, mix.nearer);
    // Given the direction, the guide is likelier where it is likelier to have chosen that.
    const V likely = mix.guided * mix.density(w) * (1.0f / guide.phase_pdf);
    const V sum = mix.classic + likely;
    const F scale = 1.0f / max(sum.x + sum.y + sum.z, 1e-30f);
    classic = mix.classic * scale, guided = likely * scale;
    const auto rate = [&](F e, F length) { return e * (1.0f - w / length); };
    stretched = {rate(extinction.x, mix.nu.x), rate(extinction.y, mix.nu.y), rate(extinction.z, mix.nu.z)};
  }

  PRIMRAY_INLINE F draw(F u, F choice) const {
    const F shares[6] = {classic.x, classic.y, classic.z, guided.x, guided.y, guided.z};
    const F rates[6] = {extinction.x, extinction.y, extinction.z, stretched.x, stretched.y, stretched.z};
    F rate = rates[0], before(0.0f);
    for (int k = 1; k < 6; ++k) before += shares[k - 1], rate = select(choice >= before, rates[k], rate);
    return -0.693147181f * log2_cosine(1.0f - u, u * (2.0f - u)) / max(rate, 1e-30f);
  }

  // Probability that a step is at least as long as `t`.
  PRIMRAY_INLINE F survival(F t) const {
    const auto left = [&](const V& rate) -> V {
      return {exp_of_minus(rate.x * t), exp_of_minus(rate.y * t), exp_of_minus(rate.z * t)};
    };
    return dot(classic, left(extinction)) + dot(guided, left(stretched));
  }

  // The collision at distance `t` if that is before `end`; otherwise the end. `scattering`: the medium's.
  PRIMRAY_INLINE DistanceSample<W> at(F t, F end, const V& scattering, const V& beta) const {
    DistanceSample<W> s;
    s.scatters = t < min(end, kEndless);
    s.t = select(s.scatters, t, end);
    const F way = min(s.t, kEndless);
    const auto left = [&](const V& rate) -> V {
      return {exp_of_minus(rate.x * way), exp_of_minus(rate.y * way), exp_of_minus(rate.z * way)};
    };
    const V own = left(extinction), bent = left(stretched);
    const F by_scattering = dot(classic, extinction * own) + dot(guided, stretched * bent);
    const F by_end = dot(classic, own) + dot(guided, bent);
    s.beta = select(s.scatters, beta * scattering * own * (1.0f / max(by_scattering, 1e-30f)),
                    beta * own * (1.0f / max(by_end, 1e-30f)));
    return s;
  }
};

}  // namespace primray
