// Emission from lights that path rays hit: area lights, distant lights with an angle, and domes, weighted by MIS against light
// sampling.
//
// Camera rays, and rays after a mirror or refraction, see the nearest light as an opaque body. All other rays pass through
// lights, as light samples do, and collect the radiance of each.
#pragma once

#include "integrator/rays/path_pool.hpp"
#include "light/sampler/portal.hpp"
#include "light/sampler/selection.hpp"
#include "medium/ray_medium.hpp"
#include "scene/scene.hpp"

namespace primray {

// Relative slack for the ends of shadow rays and for hits on lights: points on lights are only this exact.
constexpr float kNearlyOne = 1 - 0x1p-16f;

// Power heuristic with exponent 2: Veach 1997, "Robust Monte Carlo Methods for Light Transport Simulation", section 9.2.2. (The
// balance heuristic had 5 % more relMSE on the Cornell box.)
template <int W>
PRIMRAY_INLINE vfloat<W> mis_weight(vfloat<W> pdf, vfloat<W> other) {
  const vfloat<W> r = other / pdf;
  return 1.0f / (1.0f + r * r);
}

// Among many lights (LightTable::hierarchy), lights that a scattered ray would hit with less than this probability are found by
// light sampling alone: it samples them almost as well, and most rays then need not be tested against them. The probability is
// estimated from the bounding sphere of the light.
constexpr float kRareHit = 0.05f;

// Returns the lanes in which `light`, seen from p, is hit too rarely (kRareHit) by rays of density `bsdf_pdf`. Light sampling
// and BSDF sampling must agree on it, as MIS weights depend on it.
template <int W>
PRIMRAY_INLINE vbool<W> rarely_hit(const LightTable& lights, vint<W> light, const vvec3<W>& p, vfloat<W> bsdf_pdf) {
  const LightRow<W> row(lights, light);
  const vvec3<W> to = row.vector(kOrigin) - p;  // lights that move have no radius
  const vfloat<W> radius = gather<W>(lights.hierarchy.radius.data(), light);
  return (radius > vfloat<W>(0.0f)) & (kPi * radius * radius * bsdf_pdf < kRareHit * dot(to, to));
}
// Distance, in multiples of a light's radius, within which rays are tested against it; unlimited for rays without a density,
// which see every light as a body.
template <int W>
PRIMRAY_INLINE vfloat<W> hit_test_distance(vfloat<W> bsdf_pdf) {
  const vfloat<W> reach = 1.001f + 1.001f * sqrt(bsdf_pdf * (kPi / kRareHit));
  return select(bsdf_pdf > vfloat<W>(0.0f), reach, vfloat<W>(1e36f));
}

// Returns the lanes of `m` whose rays, ignoring occlusion, could hit a light.
template <int W>
PRIMRAY_RARE vbool<W> may_hit_light(const LightHierarchy& hierarchy, vbool<W> m, const vvec3<W>& o, const vvec3<W>& d,
                                    vfloat<W> bsdf_pdf) {
  vbool<W> found(false);
  visit_lights(hierarchy, m, o, d, vfloat<W>(kInfinity), hit_test_distance(bsdf_pdf),
               [&](int, vbool<W> lanes) { found |= lanes; });
  return found;
}

// Factor of a light's radiance by how the path last scattered (UsdLux inputs:diffuse and inputs:specular); 1 for camera rays.
template <int W>
PRIMRAY_INLINE vvec3<W> lobe_factor(LobeFactors f, const PathLanes<W>& p) {
  const vvec3<W> one(vfloat<W>(1.0f));
  if (f.diffuse == 1 && f.specular == 1) return one;
  const vvec3<W> mixed = p.diffuse_share * vfloat<W>(f.diffuse) + (one - p.diffuse_share) * vfloat<W>(f.specular);
  return select(p.depth == vint<W>(0), one, mixed);
}

// Probability with which light `i` is chosen at point `p` with normal `n`, on a surface of link row `link`; `total` is
// total_at().
template <int W>
PRIMRAY_INLINE vfloat<W> probability_at(const LightTable& lights, int i, vbool<W> m, const vvec3<W>& p, const vvec3<W>& n,
                                        vfloat<W> total, vint<W> link) {
  if (lights.links.any()) return linked_probability(lights, i, m, p, n, total, link);
  return light_probability(lights, i, m, p, n, total);
}

// Sum of the importances of all lights at `p`, where lights are chosen by weighing each of them; otherwise 1.
template <int W>
PRIMRAY_INLINE vfloat<W> total_at(const LightTable& lights, const vvec3<W>& p, vint<W> link) {
  if (lights.by_tree()) return vfloat<W>(1.0f);
  if (lights.links.any()) return linked_total_importance(lights, p, link);
  return lights.count > 1 ? total_importance(lights, p) : vfloat<W>(1.0f);
}

// Lanes that see a light as a body, and for these the light and its distance.
template <int W>
struct LightHits {
  vbool<W> covered{false};
  vfloat<W> nearest{kInfinity};
  vint<W> light{-1};
};

// Ray queries against a light that moves, evaluated at the rays' times; `from` is the origin on the last surface that
// scattered.
template <int W>
PRIMRAY_RARE vvec3<W> to_row(const LightTable& lights, size_t path, const Rays<W>& ray) {
  return poses_of(lights.motion.paths[path], ray.time).vector_to_row(ray.d);
}
template <int W>
PRIMRAY_RARE LocalHit<W> moving_light_hit(const LightTable& lights, int i, size_t path, const vvec3<W>& from,
                                          const Rays<W>& ray, vvec3<W>& L) {
  const LightPoses<W> poses = poses_of(lights.motion.paths[path], ray.time);
  return light_hit<W>(lights, i, poses.point_to_row(from), poses.vector_to_row(ray.d), L);
}

// Default listener of intersect_lights(): ignores every light.
struct NoListener {};

// Adds the radiance of area and distant lights that the rays hit to `gathered`, attenuated by `medium` if there is one; the
// path in the medium begins `origin_distance` before the ray's origin. `listener` receives the contribution of each light, and
// at the end those of bodies.
template <int W, class Listener = NoListener>
PRIMRAY_INLINE LightHits<W> intersect_lights(const LightTable& lights, vbool<W> active, vbool<W> hit, const PathLanes<W>& p,
                                             vfloat<W> t_surface, vvec3<W>& gathered, const RayMedium<W>* medium = nullptr,
                                             vfloat<W> origin_distance = vfloat<W>(0.0f), const Listener& listener = {}) {
  using F = vfloat<W>;
  constexpr bool kListens = !std::is_same_v<Listener, NoListener>;
  LightHits<W> seen;
  if (!lights.needs_hit_test) return seen;
  const vbool<W> sees_body = active & (p.bsdf_pdf == F(0.0f)), camera = p.depth == vint<W>(0);
  const vvec3<W> zero(F(0.0f)), from = p.ray.o - p.ray.d * p.travelled;
  const bool linked = lights.links.any();
  const bool weighed = lights.count > 1 && !lights.by_tree();
  const bool many = !lights.hierarchy.empty();
  F total(0.0f);
  bool has_total = false;
  vvec3<W> body = zero;
  const auto add_light = [&](int i, vbool<W> lanes) {
    // Intersect the light
    const float* row = lights.row(i);
    const LightType type = LightType(int_at(row, kType));
    if (!can_be_hit(type)) return;
    vvec3<W> L{F(row[kRadiance]), F(row[kRadiance + 1]), F(row[kRadiance + 2])};
    const int32_t path = lights.motion.any() ? lights.motion.row(i) : -1;
    const LocalHit<W> h =
        path < 0 ? light_hit<W>(lights, i, from, p.ray.d, L) : moving_light_hit(lights, i, size_t(path), from, p.ray, L);
    const F t = h.t - p.travelled;
    vbool<W> hits_light = lanes & (h.pdf > F(0.0f));
    const int flags = int_at(row, kLightFlags);
    if (flags & kHidden) hits_light &= !camera;
    if (linked) hits_light &= in_collection(lights.links, p.link, lights.light_link[i]);
    if (type == LightType::kDistant) {
      hits_light = hits_light & (!hit) & (!camera);
    } else {
      hits_light &= (t * kNearlyOne <= t_surface) & (t >= p.ray.tnear) & (t <= p.ray.tfar);
    }
    if (!any(hits_light)) return;

    // Compute its radiance along the rays
    if (medium) L *= medium->transmittance(type == LightType::kDistant ? F(kInfinity) : t + origin_distance);
    L *= lobe_factor({row[kDiffuseFactor], row[kSpecularFactor]}, p);
    if (lights.has_shaping) L *= hit_shaping(lights, row, path < 0 ? p.ray.d : to_row(lights, size_t(path), p.ray));

    // Add it where light sampling could not have found it; of bodies the nearest
    const vbool<W> direct = hits_light & sees_body & ((t < seen.nearest) | vbool<W>(type == LightType::kDistant));
    if (type == LightType::kDistant) {
      gathered += select(direct, L, zero);
      if constexpr (kListens) listener.light(i, direct, L);
    } else {
      seen.nearest = select(direct, t, seen.nearest), seen.light = select(direct, vint<W>(i), seen.light);
      body = select(direct, L, body);
      seen.covered |= direct;
    }

    // Add it with its MIS weight elsewhere
    vbool<W> scattered = hits_light & !sees_body;
    if (many) scattered &= !rarely_hit(lights, vint<W>(i), from, p.bsdf_pdf);
    if ((flags & kSpecial) || !any(scattered)) return;
    if ((weighed || linked) && !has_total) total = total_at(lights, from, p.link), has_total = true;
    const F light_pdf = h.pdf * probability_at(lights, i, scattered, from, p.normal, total, p.link);
    gathered += select(scattered, L * mis_weight(p.bsdf_pdf, light_pdf), zero);
    if constexpr (requires { listener.weighted(scattered, light_pdf); }) listener.weighted(scattered, light_pdf);
    if constexpr (kListens) listener.light(i, scattered, L * mis_weight(p.bsdf_pdf, light_pdf));
  };

  // Visit all lights, or those near the rays
  if (!many) {
    for (int i = 0; i < lights.analytic_count; ++i) add_light(i, active);
  } else {
    visit_lights(lights.hierarchy, active, from, p.ray.d, min(t_surface, p.ray.tfar) + p.travelled,
                 hit_test_distance(p.bsdf_pdf), add_light);
  }
  gathered += body;
  if constexpr (kListens) listener.bodies(seen, body);
  return seen;
}

// Returns the radiance of all domes along the rays; valid in lanes `m`.
template <int W, class Listener = NoListener>
PRIMRAY_INLINE vvec3<W> evaluate_domes(const LightTable& lights, vbool<W> m, const PathLanes<W>& p,
                                       const Listener& listener = {}) {
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
      if constexpr (requires { listener.weighted(wanted, light_pdf); }) listener.weighted(wanted, light_pdf);
      L *= select(direct, F(1.0f), mis_weight(p.bsdf_pdf, light_pdf));
    }
    sum += L;
    if constexpr (!std::is_same_v<Listener, NoListener>) listener.dome(k, m, L);
  }
  return sum;
}

}  // namespace primray
