// Shadow rays that need their hits: through surfaces that let light pass straight, and towards lights with special shadows
// (light/shadow.hpp). All other shadow rays are plain occlusion queries.
#pragma once

#include "accel/query.hpp"
#include "bsdf/bsdf_with_hair.hpp"
#include "integrator/rays/ray_recorder.hpp"
#include "light/mesh/emitter.hpp"
#include "light/shadow.hpp"
#include "medium/ray_medium.hpp"
#include "surface/evaluate_inputs.hpp"
#include "surface/interaction.hpp"

namespace primray {

template <int W>
PRIMRAY_RARE vvec3<W> straight_with_open_pbr(const SurfaceRows<W>& rows, vbool<W> active, const vvec3<W>& wo, vbool<W> front,
                                             vfloat<W> ior_outside) {
  return straight_transmittance(BsdfWithOpenPbr<W>(rows, active, wo, front, ior_outside));
}

// Surface hit by a shadow ray, and its transmittance for light that continues straight.
template <int W>
struct ShadowStep {
  Interaction<W> it;
  vbool<W> front;
  vvec3<W> through;
  vbool<W> overridden{false};  // boundaries of lower priority inside overlapping media, and boundaries of volumes
  vbool<W> bounds{false};      // those of volumes, from which rays go on from where they began, at `t_bounds`
  vfloat<W> t_bounds{0.0f};

  // `media`: medium stack along the ray, if media are followed; updated to the one behind the surface.
  PRIMRAY_INLINE ShadowStep(const Scene& scene, vbool<W> active, const Rays<W>& rays, const Hits<W>& hits,
                            ShadowMedia<W>* media)
      : it(interact(scene, active, rays, hits)), front(dot(it.ng, rays.d) < vfloat<W>(0.0f)), through(vfloat<W>(0.0f)) {
    if (!scene.has_thin) return;
    const vfloat<W> z = clamp(abs(dot(it.ns, rays.d)), 0.0f, 1.0f);
    const vvec3<W> wo{safe_sqrt(1.0f - z * z), vfloat<W>(0.0f), z};
    SurfaceRows<W> rows(scene.surfaces, it.surface, active);
    LaneRows<W> varying;
    if (any_inputs(scene, active, it.surface)) {
      // Normal maps do not bend light that passes straight, and shadow rays have no ray cones.
      vvec3<W> unbent = it.ns;
      rows = evaluate_inputs(scene, active, hits, it.surface, vfloat<W>(0.0f), it.p, it.ng, unbent, varying);
    }
    if (media) {
      cross(scene, active, rays, hits, rows, wo, *media);
    } else {
      through = scene.surfaces.open_pbr.empty() ? straight_transmittance(Bsdf<W>(rows, active, wo, front))
                                                : straight_with_open_pbr(rows, active, wo, front, vfloat<W>(1.0f));
    }
    if (!scene.surfaces.hair.empty()) through = straight_through_hair(rows, active, front, through);
  }
  PRIMRAY_RARE void cross(const Scene& scene, vbool<W> active, const Rays<W>& rays, const Hits<W>& hits,
                          const SurfaceRows<W>& rows, const vvec3<W>& wo, ShadowMedia<W>& media) {
    bounds = bounds_volume(scene, active, it.surface);
    if (any(bounds)) enter_missed(scene, *media.sets, bounds, hits, it.surface, front, media.volumes);
    const vvec3<W> left = transmittance_along(scene, media, rays, hits.t, active), one(vfloat<W>(1.0f));
    const Boundary<W> b(scene, active, media.stack, it.surface, front);
    overridden = b.overridden | bounds;
    through = select(overridden, one, straight_with_open_pbr(rows, active, wo, front, b.ior_outside)) * left;
    media.stack = select(active, b.beyond, media.stack);
    media.origin_distance = select(active, origin_distance_of(it.offset, it.ng, rays.d), media.origin_distance);
    if (!any(bounds)) return;
    cross_boundaries(scene, *media.sets, bounds, hits, it.surface, front, media.volumes);
    media.origin_distance = select(bounds, -hits.t, media.origin_distance);
    t_bounds = behind_boundary(hits.t, it.offset);
  }
  // Advances rays past the hit, towards the same end point: it may be so close to the light's surface that a ray aimed beside
  // it would hit that surface.
  PRIMRAY_INLINE void advance(Rays<W>& rays) const {
    const Rays<W> before = rays;
    rays.tnear = vfloat<W>(0.0f);
    const vvec3<W> o = it.p + it.ng * (it.offset * select(front, vfloat<W>(-1.0f), vfloat<W>(1.0f)));
    const vfloat<W> left = rays.tfar - dot(o - rays.o, rays.d);
    const vbool<W> ends = (left > vfloat<W>(0.0f)) & (left < vfloat<W>(kInfinity));
    const vvec3<W> to = rays.d * rays.tfar - (o - rays.o);
    const vfloat<W> length_to = length(to);
    rays.d = select(ends, to * (1.0f / length_to), rays.d);
    rays.tfar = select(ends, length_to, left);
    rays.o = o;
    if (any(bounds)) stay_at_boundaries(before, rays);
  }

 private:
  // Keeps rays that pass the boundary of a volume as they were `before`; see pass_volumes().
  PRIMRAY_RARE void stay_at_boundaries(const Rays<W>& before, Rays<W>& rays) const {
    rays.o = select(bounds, before.o, rays.o), rays.d = select(bounds, before.d, rays.d);
    rays.tfar = select(bounds, before.tfar, rays.tfar), rays.tnear = select(bounds, t_bounds, rays.tnear);
  }
};

// Transmittance and radiance scale over the last segment of shadow rays, which nothing blocks.
template <int W>
PRIMRAY_RARE vvec3<W> transmittance_at_end(const Scene& scene, const ShadowMedia<W>& media, const Rays<W>& rays) {
  const vbool<W> reaches = rays.tfar < vfloat<W>(kInfinity);
  return transmittance_along(scene, media, rays, rays.tfar, reaches) * radiance_scale(scene, media.stack);
}

// Traces shadow rays through surfaces that let light pass straight, attenuates `carried`, and returns the lanes that arrive.
// `media`: see ShadowStep. `passed`, if given, counts the surfaces passed by each ray.
template <int W>
PRIMRAY_RARE vbool<W> pass_thin(const Scene& scene, RayRecorder* recorder, vbool<W> active, Rays<W> rays, vvec3<W>& carried,
                                ShadowMedia<W>* media, vint<W>* passed = nullptr) {
  const vfloat<W> zero(0.0f);
  vbool<W> arrived(false);
  while (any(active)) {
    if (recorder) recorder->record(false, true, active, rays);
    const Hits<W> hits = intersect(scene, true, active, rays);
    const vbool<W> hit = active & (hits.geom != vint<W>(-1));
    if (media) carried = select(active & !hit, carried * transmittance_at_end(scene, *media, rays), carried);
    arrived |= active & !hit;
    active = hit;
    if (!any(active)) break;
    const ShadowStep<W> step(scene, active, rays, hits, media);
    if (passed) *passed += select(active & !step.overridden, vint<W>(1), vint<W>(0));
    // Lanes that have arrived keep what they carry.
    carried = select(active, carried * step.through, carried);
    active &= max_component(carried) > zero;
    step.advance(rays);
    active &= rays.tfar > zero;
    arrived |= hit & (max_component(carried) > zero) & !(rays.tfar > zero);
  }
  return arrived;
}

// Traces shadow rays towards special lights; returns the factor of their light. The first opaque caster ends a shadow,
// transmissive casters before it tint it. Each caster is weighted by its distance; surfaces that cast no shadow of the light
// are skipped. Geometry that is a light always hides its own far side, which is not a shadow. `passed`: see pass_thin().
template <int W>
PRIMRAY_RARE vvec3<W> pass_special(const Scene& scene, RayRecorder* recorder, vbool<W> active, Rays<W> rays, vint<W> light,
                                   ShadowMedia<W>* media, vint<W>* passed = nullptr) {
  const vfloat<W> zero(0.0f), one(1.0f);
  const vint<W> none(-1);
  const LightTable& lights = scene.lights;
  const ShadowLanes<W> shadow(lights.shadow_rows, light);
  const vbool<W> has_body = (LightRow<W>(lights, light).flags() & vint<W>(kGeometry)) != vint<W>(0);
  const vvec3<W> from = rays.o;
  vvec3<W> open(one);
  vbool<W> casting = active & shadow.enabled, hidden(false);
  active = casting | (active & has_body);
  while (any(active)) {
    if (recorder) recorder->record(false, true, active, rays);
    const Hits<W> hits = intersect(scene, true, active, rays);
    const vbool<W> free = active & (hits.geom == none);
    if (media) open = select(free, open * transmittance_at_end(scene, *media, rays), open);
    active &= !free;
    if (!any(active)) break;
    const ShadowStep<W> step(scene, active, rays, hits, media);
    if (any(active & has_body)) {
      const vbool<W> own = active & has_body & (emitter_light(scene, active, hits, step.it) == light);
      hidden |= own, active &= !own;
    }
    const vfloat<W> distance = length(step.it.p - from);
    const vbool<W> caster = active & casting & in_collection(lights.links, step.it.link, shadow.casters);
    const vfloat<W> strength = shadow.strength(distance);
    open = select(caster, open * (vvec3<W>(one) - (vvec3<W>(one) - step.through) * strength), open);
    const vbool<W> opaque = !(max_component(step.through) > zero);
    if (passed) *passed += select(caster & !opaque & !step.overridden, vint<W>(1), vint<W>(0));
    casting &= (!(caster & opaque)) & (distance < shadow.end);
    active &= casting | has_body;
    step.advance(rays);
    active &= rays.tfar > zero;
  }
  const vvec3<W> left = shadow.color + (vvec3<W>(one) - shadow.color) * open;
  return select(hidden, vvec3<W>(zero), left);
}

}  // namespace primray
