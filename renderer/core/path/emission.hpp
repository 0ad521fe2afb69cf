// Light that a ray meets by itself: lights with area or cone, and domes, with its MIS weight against sampling them.
//
// Camera rays, and rays after a mirror or refraction, see the nearest light as a body. Others go through lights, as light
// samples do, and take each one's radiance.
#pragma once

#include "light/selection/linked_selection.hpp"
#include "light/selection/portal.hpp"
#include "medium/medium.hpp"
#include "path/rays/pool.hpp"
#include "scene/scene.hpp"

namespace primray {

// Shadow rays end, and lights are met, this much early or late: points on a light are only so exact.
constexpr float kNearlyOne = 1 - 0x1p-16f;

// Veach 1997, "Robust Monte Carlo Methods for Light Transport Simulation", section 9.2.2: the power heuristic with exponent 2.
// (The balance heuristic had 5 % more relMSE on the Cornell box.)
template <int W>
PRIMRAY_INLINE vfloat<W> mis_weight(vfloat<W> pdf, vfloat<W> other) {
  const vfloat<W> r = other / pdf;
  return 1.0f / (1.0f + r * r);
}

// Among many lights (LightTable::hierarchy), light sampling alone finds those that a scattered ray would meet with less than
// this probability: it does so almost as well, and most rays then need not look for them. Judged by the ball about a light's
// box.
constexpr float kRarelyMet = 0.05f;

// Whether that holds in each lane for `light`, seen from p, and a ray with that density: both ways to a light must agree on it.
template <int W>
PRIMRAY_INLINE vbool<W> rarely_met(const LightTable& lights, vint<W> light, const vvec3<W>& p, vfloat<W> bsdf_pdf) {
  const LightRow<W> row(lights, light);
  const vvec3<W> to = row.vector(kOrigin) - p;  // those that move have no radius
  const vfloat<W> radius = gather<W>(lights.hierarchy.radius.data(), light);
  return (radius > vfloat<W>(0.0f)) & (kPi * radius * radius * bsdf_pdf < kRarelyMet * dot(to, to));
}
// How many of its radii away a light may be for a ray to meet it otherwise; all lights are bodies to rays without a density.
template <int W>
PRIMRAY_INLINE vfloat<W> meeting_reach(vfloat<W> bsdf_pdf) {
  const vfloat<W> reach = 1.001f + 1.001f * sqrt(bsdf_pdf * (kPi / kRarelyMet));
  return select(bsdf_pdf > vfloat<W>(0.0f), reach, vfloat<W>(1e36f));
}

// Lanes of `m` whose ray, not cut off by surfaces, could find a light.
template <int W>
PRIMRAY_RARE vbool<W> may_meet(const LightHierarchy& met, vbool<W> m, const vvec3<W>& o, const vvec3<W>& d,
                               vfloat<W> bsdf_pdf) {
  vbool<W> found(false);
  visit_lights(met, m, o, d, vfloat<W>(kInfinity), meeting_reach(bsdf_pdf), [&](int, vbool<W> lanes) { found |= lanes; });
  return found;
}

// What a light's multipliers leave of its radiance, by how the path last scattered; the camera sees it whole.
template <int W>
PRIMRAY_INLINE vvec3<W> lobe_factor(LobeFactors f, const PathLanes<W>& p) {
  const vvec3<W> one(vfloat<W>(1.0f));
  if (f.diffuse == 1 && f.specular == 1) return one;
  const vvec3<W> mixed = p.diffuse_share * vfloat<W>(f.diffuse) + (one - p.diffuse_share) * vfloat<W>(f.specular);
  return select(p.depth == vint<W>(0), one, mixed);
}

// The probability with which light `i` was chosen at `p`, with normal `n`, on a surface that wears row `link`; `total` from
// total_at.
template <int W>
PRIMRAY_INLINE vfloat<W> probability_at(const LightTable& lights, int i, vbool<W> m, const vvec3<W>& p, const vvec3<W>& n,
                                        vfloat<W> total, vint<W> link) {
  if (lights.links.any()) return linked_probability(lights, i, m, p, n, total, link);
  return light_probability(lights, i, m, p, n, total);
}

// What that needs where each light is weighed.
template <int W>
PRIMRAY_INLINE vfloat<W> total_at(const LightTable& lights, const vvec3<W>& p, vint<W> link) {
  if (lights.by_tree()) return vfloat<W>(1.0f);
  if (lights.links.any()) return linked_total_importance(lights, p, link);
  return lights.count > 1 ? total_importance(lights, p) : vfloat<W>(1.0f);
}

// Lanes that see a light's body, which and how far away.
template <int W>
struct MetLights {
  vbool<W> covered{false};
  vfloat<W> nearest{kInfinity};
  vint<W> light{-1};
};

// A ray's direction for a light that moves, and what it meets of it; `from`: where the ray left the last surface.
template <int W>
PRIMRAY_RARE vvec3<W> to_row(const LightTable& lights, size_t path, const Rays<W>& ray) {
  return stances_of(lights.motion.paths[path], ray.time).vector_to_row(ray.d);
}
template <int W>
PRIMRAY_RARE LocalHit<W> moving_light_hit(const LightTable& lights, int i, size_t path, const vvec3<W>& from,
                                          const Rays<W>& ray, vvec3<W>& L) {
  const LightStances<W> stances = stances_of(lights.motion.paths[path], ray.time);
  return light_hit<W>(lights, i, stances.point_to_row(from), stances.vector_to_row(ray.d), L);
}

// What hears of each light that is met: nobody.
struct NobodyListens {};

// Adds what area and distant lights send back along the rays to `gathered`, through `medium` where there is one, which begins
// `lead` before the rays. `listener` is told of each light's part, and of bodies
// at the end.
template <int W, class Listener = NobodyListens>
PRIMRAY_INLINE MetLights<W> meet_lights(const LightTable& lights, vbool<W> active, vbool<W> hit, const PathLanes<W>& p,
                                        vfloat<W> t_surface, vvec3<W>& gathered, const Medium<W>* medium = nullptr,
                                        vfloat<W> lead = vfloat<W>(0.0f), const Listener& listener = {}) {
  using F = vfloat<W>;
  constexpr bool kHeard = !std::is_same_v<Listener, NobodyListens>;
  MetLights<W> seen;
  if (!lights.needs_hit_test) return seen;
  const vbool<W> sees_body = active & (p.bsdf_pdf == F(0.0f)), camera = p.depth == vint<W>(0);
  const vvec3<W> zero(F(0.0f)), from = p.ray.o - p.ray.d * p.travelled;
  const bool linked = lights.links.any();
  const bool weighed = lights.count > 1 && !lights.by_tree();
  const bool many = !lights.hierarchy.empty();
  F total(0.0f);
  bool has_total = false;
  vvec3<W> body = zero;
  const auto meet = [&](int i, vbool<W> lanes) {
    const float* row = lights.row(i);
    const LightType type = LightType(int(row[kType]));
    if (!can_be_met(type)) return;
    vvec3<W> L{F(row[kRadiance]), F(row[kRadiance + 1]), F(row[kRadiance + 2])};
    const int32_t path = lights.motion.any() ? lights.motion.row(i) : -1;
    const LocalHit<W> h =
        path < 0 ? light_hit<W>(lights, i, from, p.ray.d, L) : moving_light_hit(lights, i, size_t(path), from, p.ray, L);
    const F t = h.t - p.travelled;
    vbool<W> met = lanes & (h.pdf > F(0.0f));
    const int flags = int(row[kLightFlags]);
    if (flags & kHidden) met &= !camera;
    if (linked) met &= in_collection(lights.links, p.link, lights.light_link[i]);
    if (type == LightType::kDistant) {
      met = met & (!hit) & (!camera);
    } else {
      met &= (t * kNearlyOne <= t_surface) & (t >= p.ray.tnear) & (t <= p.ray.tfar);
    }
    if (!any(met)) return;
    if (medium) L *= medium->left_after(type == LightType::kDistant ? F(kInfinity) : t + lead);
    L *= lobe_factor({row[kDiffuseFactor], row[kSpecularFactor]}, p);
    if (lights.has_shaping) L *= met_shaping(lights, row, path < 0 ? p.ray.d : to_row(lights, size_t(path), p.ray));
    const vbool<W> direct = met & sees_body & ((t < seen.nearest) | vbool<W>(type == LightType::kDistant));
    if (type == LightType::kDistant) {
      gathered += select(direct, L, zero);
      if constexpr (kHeard) listener.light(i, direct, L);
    } else {
      seen.nearest = select(direct, t, seen.nearest), seen.light = select(direct, vint<W>(i), seen.light);
      body = select(direct, L, body);
      seen.covered |= direct;
    }
    vbool<W> scattered = met & !sees_body;
    if (many) scattered &= !rarely_met(lights, vint<W>(i), from, p.bsdf_pdf);
    if ((flags & kSpecial) || !any(scattered)) return;
    if ((weighed || linked) && !has_total) total = total_at(lights, from, p.link), has_total = true;
    const F light_pdf = h.pdf * probability_at(lights, i, scattered, from, p.normal, total, p.link);
    gathered += select(scattered, L * mis_weight(p.bsdf_pdf, light_pdf), zero);
    if constexpr (kHeard) listener.light(i, scattered, L * mis_weight(p.bsdf_pdf, light_pdf));
  };
  if (!many) {
    for (int i = 0; i < lights.analytic_count; ++i) meet(i, active);
  } else {
    visit_lights(lights.hierarchy, active, from, p.ray.d, min(t_surface, p.ray.tfar) + p.travelled, meeting_reach(p.bsdf_pdf),
                 meet);
  }
  gathered += body;
  if constexpr (kHeard) listener.bodies(seen, body);
  return seen;
}

// Radiance of all domes along the rays; right in lanes `m`.
template <int W, class Listener = NobodyListens>
PRIMRAY_INLINE vvec3<W> meet_domes(const LightTable& lights, vbool<W> m, const PathLanes<W>& p, const Listener& listener = {}) {
  using F = vfloat<W>;
  vvec3<W> sum(F(0.0f));
  for (size_t k = 0; k < lights.domes.size(); ++k) {
    F pdf;
    vvec3<W> L = dome_eval(lights.domes[k], dome_direction(lights, k, p.ray.d, p.ray.time), pdf) *
                 lobe_factor(lights.dome_factors[k], p);
    const DomeTraits& traits = lights.dome_traits[k];
    const vbool<W> direct = p.bsdf_pdf == F(0.0f);
    if (traits.hidden || traits.special || traits.link != 0) {
      vbool<W> seen = in_collection(lights.links, p.link, traits.link);
      if (traits.hidden) seen &= !(p.depth == vint<W>(0));
      if (traits.special) seen &= direct;
      L = select(seen, L, vvec3<W>(F(0.0f)));
    }
    const int light = lights.dome_light[k];
    if (light >= 0 && !traits.special) {
      const vvec3<W> from = p.ray.o - p.ray.d * p.travelled;
      if (lights.has_portals()) pdf = dome_pdf(lights, int(k), from, p.ray.d, pdf, p.ray.time);
      const F total = total_at(lights, from, p.link);
      const vbool<W> wanted = m & (!direct) & (pdf > F(0.0f));
      const F light_pdf = pdf * probability_at(lights, light, wanted, from, p.normal, total, p.link);
      L *= select(direct, F(1.0f), mis_weight(p.bsdf_pdf, light_pdf));
    }
    sum += L;
    if constexpr (!std::is_same_v<Listener, NobodyListens>) listener.dome(k, m, L);
  }
  return sum;
}

}  // namespace primray
