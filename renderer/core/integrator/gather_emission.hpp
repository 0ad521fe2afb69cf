// Emission that paths gather at the end of their rays: from lights and the environment, which rays may hit by themselves, and
// from the surface that they hit; and the alpha of camera rays, which covers what they hit.
#pragma once

#include "integrator/camera_visibility.hpp"
#include "integrator/emission.hpp"
#include "integrator/log_vertex.hpp"
#include "integrator/lpe_light.hpp"
#include "integrator/outline_rays.hpp"
#include "light/mesh/emitter.hpp"

namespace primray {

// Returns emission along the rays: from lights that they hit, and from the environment. Removes lanes that a light's body
// covers from `hit`. `looks`: lanes whose lights were not already added in a medium (integrator/cross_media.hpp).
template <int W>
PRIMRAY_INLINE vvec3<W> gather_emission(Round& round, vbool<W> active, vbool<W> looks, const PathLanes<W>& p,
                                        const Hits<W>& hits, vbool<W>& hit) {
  const LightTable& lights = round.scene.lights;
  vvec3<W> gathered(vfloat<W>(0.0f));

  // Add lights that the rays hit
  if (round.needs.lpe) record_light_hits(round, looks, p, hits, hit);
  if constexpr (W == 1) {
    if (PathLog* const log = path_log<W>(round)) log_light_hits(*log, round, looks, p, hits, hit);
  }
  const LightHits<W> light_hits = intersect_lights(lights, looks, hit, p, hits.t, gathered);
  const vbool<W> covered = light_hits.covered;
  if (const vbool<W> camera = covered & (p.vertex == vint<W>(0)); round.outlined && any(camera))
    gathered = select(is_outlined(round, camera, p.slot, light_hits.light), vvec3<W>(vfloat<W>(0.0f)), gathered);
  hit &= !covered;

  // Add the environment behind everything
  const vbool<W> escaped = active & !hit & !covered;
  vbool<W> nothing = escaped;
  if (!lights.domes.empty() && any(escaped)) {
    const vvec3<W> sky = evaluate_domes(lights, escaped, p);
    if (round.needs.lpe) record_domes(round, escaped, p);
    if constexpr (W == 1) {
      if (PathLog* const log = path_log<W>(round)) log_domes(*log, round, p);
    }
    gathered += select(escaped, sky, vvec3<W>(vfloat<W>(0.0f)));
    nothing &= !(max_component(sky) > vfloat<W>(0.0f));
  }

  // Update alpha
  if (round.scene.has_thin) {
    const vbool<W> straight = escaped & (p.depth == vint<W>(0)) & (p.vertex > vint<W>(0));
    if (any(straight)) reduce_alpha_of_escaped(round, straight, nothing, p);
  }
  for (uint32_t b = bits(active & (p.vertex == vint<W>(0)) & (hit | covered)); b; b &= b - 1)
    alpha_of(round, p.slot[__builtin_ctz(b)]) = 1.0f;
  return gathered;
}

// Returns the radiance that surfaces emit towards the paths of lanes `hit`, with its MIS weight.
template <int W>
PRIMRAY_INLINE vvec3<W> emitted_radiance(const Scene& scene, vbool<W> hit, const SurfaceHit<W>& surface,
                                         const PathLanes<W>& p) {
  const vfloat<W> zero(0.0f);
  vvec3<W> L = surface.rows.color(kEmission) * surface.rows(kPresence);
  if (scene.geometry_lights.any()) L = shown_emission(scene, hit, surface.hits, surface.it, p, L, surface.rows(kPresence));
  // A camera ray, or one after a mirror or refraction, could not have been a light sample.
  const vbool<W> sampled = hit & (max_component(L) > zero) & (p.bsdf_pdf > zero);
  if (scene.emitters.any() && any(sampled)) {
    const vfloat<W> pdf = emitter_pdf(scene, sampled, surface.hits, surface.it, p);
    L *= select(sampled & (pdf > zero), mis_weight(p.bsdf_pdf, pdf), vfloat<W>(1.0f));
  }
  return L;
}

// Returns the emission of the surfaces that lanes `hit` of the paths at `at` hit.
template <int W>
PRIMRAY_INLINE vvec3<W> gather_surface_emission(Round& round, int at, vbool<W> hit, const SurfaceHit<W>& surface,
                                                const PathLanes<W>& p) {
  vvec3<W> shines = select(hit, emitted_radiance(round.scene, hit, surface, p), vvec3<W>(vfloat<W>(0.0f)));
  if (round.needs.lpe) record_surface_emission(round, hit, surface.hits, surface.it, shines);
  if constexpr (W == 1) {
    if (PathLog* const log = path_log<W>(round)) log_surface_emission(*log, round.scene, hit, p, surface, shines);
  }
  if (round.follows_media()) shines = shines * radiance_scale_at<W>(round, at);
  return shines;
}

// Adds the emission recorded for the packet at `at` to light path expressions.
template <int W>
PRIMRAY_RARE void add_recorded_at(Round& round, int at, const PathLanes<W>& p) {
  add_recorded(round, p, round.follows_media() ? p.beta * radiance_scale_at<W>(round, at) : p.beta);
}

}  // namespace primray
