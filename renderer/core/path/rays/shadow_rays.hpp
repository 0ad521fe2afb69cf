// Shadow rays that must look at what they hit: surfaces that let light straight through, and lights whose shadows are special
// (light/shadow.hpp). Others only ask Embree whether anything is in the way.
#pragma once

#include "accel/query.hpp"
#include "bsdf/bsdf_with_hair.hpp"
#include "emitter/emitter.hpp"
#include "light/shadow.hpp"
#include "medium/bodies.hpp"
#include "path/rays/ray_recorder.hpp"
#include "surface/evaluate_inputs.hpp"
#include "surface/interaction.hpp"

namespace primray {

template <int W>
PRIMRAY_RARE vvec3<W> straight_with_open_pbr(const SurfaceRows<W>& rows, vbool<W> active, const vvec3<W>& wo, vbool<W> front,
                                             vfloat<W> beside) {
  return straight_transmittance(BsdfWithOpenPbr<W>(rows, active, wo, front, beside));
}

// What a shadow ray met, and the part of its light that goes straight on.
template <int W>
struct ShadowStep {
  Interaction<W> it;
  vbool<W> front;
  vvec3<W> through;
  vbool<W> unseen{false};  // boundaries that are not there

  // `around`: the bodies around the ray, where they are followed; left as they are behind what was met.
  PRIMRAY_INLINE ShadowStep(const Scene& scene, vbool<W> active, const Rays<W>& rays, const Hits<W>& hits,
                            BodiesAround<W>* around)
      : it(interact(scene, active, rays, hits)), front(dot(it.ng, rays.d) < vfloat<W>(0.0f)), through(vfloat<W>(0.0f)) {
    if (!scene.has_thin) return;
    const vfloat<W> z = clamp(abs(dot(it.ns, rays.d)), 0.0f, 1.0f);
    const vvec3<W> wo{safe_sqrt(1.0f - z * z), vfloat<W>(0.0f), z};
    SurfaceRows<W> rows(scene.surfaces, it.surface);
    LaneRows<W> varying;
    if (any_inputs(scene, active, it.surface)) {
      // Normal maps bend no light that goes straight on, and shadow rays have no cones.
      vvec3<W> unbent = it.ns;
      rows = evaluate_inputs(scene, active, hits, it.surface, vfloat<W>(0.0f), it.p, it.ng, unbent, varying);
    }
    if (around) {
      cross(scene, active, rays, hits.t, rows, wo, *around);
    } else {
      through = scene.surfaces.open_pbr.empty() ? straight_transmittance(Bsdf<W>(rows, active, wo, front))
                                                : straight_with_open_pbr(rows, active, wo, front, vfloat<W>(1.0f));
    }
    if (!scene.surfaces.hair.empty()) through = straight_through_hair(rows, active, front, through);
  }
  PRIMRAY_RARE void cross(const Scene& scene, vbool<W> active, const Rays<W>& rays, vfloat<W> t, const SurfaceRows<W>& rows,
                          const vvec3<W>& wo, BodiesAround<W>& around) {
    const vvec3<W> left = medium_of(scene, around.bodies).left_after(t + around.lead), one(vfloat<W>(1.0f));
    const Boundary<W> b(scene, active, around.bodies, it.surface, front);
    through = select(b.unseen, one, straight_with_open_pbr(rows, active, wo, front, b.beside)) * left;
    unseen = b.unseen;
    around.bodies = select(active, b.beyond, around.bodies);
    around.lead = select(active, lead_of(it.offset, it.ng, rays.d), around.lead);
  }
  // Goes on from the point that was hit, as far as is left: to the same end, since that may lie so close to its light's surface
  // that a ray beside it would meet that.
  PRIMRAY_INLINE void go_on(Rays<W>& rays) const {
    const vvec3<W> o = it.p + it.ng * (it.offset * select(front, vfloat<W>(-1.0f), vfloat<W>(1.0f)));
    const vfloat<W> left = rays.tfar - dot(o - rays.o, rays.d);
    const vbool<W> ends = (left > vfloat<W>(0.0f)) & (left < vfloat<W>(kInfinity));
    const vvec3<W> to = rays.d * rays.tfar - (o - rays.o);
    const vfloat<W> length_to = length(to);
    rays.d = select(ends, to * (1.0f / length_to), rays.d);
    rays.tfar = select(ends, length_to, left);
    rays.o = o;
  }
};

// Of the light of rays that have nothing before them any more.
template <int W>
PRIMRAY_RARE vvec3<W> left_at_end(const Scene& scene, const BodiesAround<W>& around, const Rays<W>& rays) {
  return medium_of(scene, around.bodies).left_after(rays.tfar + around.lead) * radiance_from(scene, around.bodies);
}

// Follows shadow rays through surfaces that let light straight through; what arrives is left in `carried`. `around`: see
// ShadowStep. `passed`, where asked for: counts what each went through.
template <int W>
PRIMRAY_RARE vbool<W> pass_thin(const Scene& scene, RayRecorder* recorder, vbool<W> active, Rays<W> rays, vvec3<W>& carried,
                                BodiesAround<W>* around, vint<W>* passed = nullptr) {
  const vfloat<W> zero(0.0f);
  vbool<W> arrived(false);
  while (any(active)) {
    if (recorder) recorder->record(false, true, active, rays);
    const Hits<W> hits = intersect(scene, true, active, rays);
    const vbool<W> hit = active & (hits.geom != vint<W>(-1));
    if (around) carried = select(active & !hit, carried * left_at_end(scene, *around, rays), carried);
    arrived |= active & !hit;
    active = hit;
    if (!any(active)) break;
    const ShadowStep<W> step(scene, active, rays, hits, around);
    if (passed) *passed += select(active & !step.unseen, vint<W>(1), vint<W>(0));
    // Lanes that have arrived keep what they carry.
    carried = select(active, carried * step.through, carried);
    active &= max_component(carried) > zero;
    step.go_on(rays);
    active &= rays.tfar > zero;
    arrived |= hit & (max_component(carried) > zero) & !(rays.tfar > zero);
  }
  return arrived;
}

// What shadow rays to special lights bring of their light. The first opaque caster ends a shadow; panes before it tint it. Each
// weighs by its distance; hits on what casts no shadow of the light are passed. A light that is geometry always hides its own
// far side, which is no shadow. `passed` as of pass_thin.
template <int W>
PRIMRAY_RARE vvec3<W> pass_special(const Scene& scene, RayRecorder* recorder, vbool<W> active, Rays<W> rays, vint<W> light,
                                   BodiesAround<W>* around, vint<W>* passed = nullptr) {
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
    if (around) open = select(free, open * left_at_end(scene, *around, rays), open);
    active &= !free;
    if (!any(active)) break;
    const ShadowStep<W> step(scene, active, rays, hits, around);
    if (any(active & has_body)) {
      const vbool<W> own = active & has_body & (emitter_light(scene, active, hits, step.it) == light);
      hidden |= own, active &= !own;
    }
    const vfloat<W> distance = length(step.it.p - from);
    const vbool<W> caster = active & casting & in_collection(lights.links, step.it.link, shadow.casters);
    const vfloat<W> strength = shadow.strength(distance);
    open = select(caster, open * (vvec3<W>(one) - (vvec3<W>(one) - step.through) * strength), open);
    const vbool<W> opaque = !(max_component(step.through) > zero);
    if (passed) *passed += select(caster & !opaque & !step.unseen, vint<W>(1), vint<W>(0));
    casting &= (!(caster & opaque)) & (distance < shadow.end);
    active &= casting | has_body;
    step.go_on(rays);
    active &= rays.tfar > zero;
  }
  const vvec3<W> left = shadow.color + (vvec3<W>(one) - shadow.color) * open;
  return select(hidden, vvec3<W>(zero), left);
}

}  // namespace primray
