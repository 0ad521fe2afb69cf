// Emissive geometry as lights (build/emitters/emitters.hpp), in lanes: the radiance that a ray sees on hitting it, and the
// density with which light sampling would have chosen that point.
#pragma once

#include "light/mesh/mesh_light.hpp"
#include "light/mesh/sphere_emitter.hpp"
#include "light/sampler/selection.hpp"
#include "ray/ray.hpp"

namespace primray {

// Light row of the surfaces that lanes `m` hit, or -1.
template <int W>
PRIMRAY_INLINE vint<W> emitter_light(const Scene& scene, vbool<W> m, const Hits<W>& h, const Interaction<W>& it) {
  const EmitterTable& table = scene.emitters;
  const vint<W> zero(0), none(-1);
  const HitGroup<W> in(scene, m, h);
  const vbool<W> is_triangle = in.is_triangle(scene, m);
  vint<W> number = none;
  if (any(is_triangle)) number = select(is_triangle, gather<W>(table.of_mesh.data(), select(is_triangle, it.mesh, zero)), none);
  const vbool<W> is_curved = scene.curved.any() ? m & !is_triangle : vbool<W>(false);
  if (scene.curved.any() && any(is_curved))
    number = select(is_curved, gather<W>(table.of_curved.data(), select(is_curved, it.curved, zero)), number);
  vint<W> base(table.static_light);
  if (in.any_instanced) {
    const vint<W> first = gather<W>(table.placement_light.data(), in.placement);
    base = select(in.instanced, first + gather<W>(table.placement_rows.data(), in.placement) * h.inst_prim, base);
    number = select(in.instanced & (first < zero), none, number);
  }
  return select((number >= zero) & (base >= zero), base + number, none);
}

// Index of the geometry light that lanes `m` hit, or -1.
template <int W>
PRIMRAY_INLINE vint<W> geometry_light(const Scene& scene, vbool<W> m, const Hits<W>& h, const Interaction<W>& it) {
  const GeometryLights& lights = scene.geometry_lights;
  const vint<W> zero(0), none(-1);
  const HitGroup<W> in(scene, m, h);
  const vbool<W> is_triangle = in.is_triangle(scene, m);
  const vbool<W> is_curved = scene.curved.any() ? m & !is_triangle : vbool<W>(false);
  vint<W> number = none;
  if (any(is_triangle))
    number = select(is_triangle, gather<W>(lights.of_mesh.data(), select(is_triangle, it.mesh, zero)), none);
  if (any(is_curved))
    number = select(is_curved, gather<W>(lights.of_curved.data(), select(is_curved, it.curved, zero)), number);
  return number;
}

// Radiance that surfaces with emission `glow` and opacity `presence` show to lanes `m`, if some shapes are lights
// (build/lights/lights.hpp): as bodies to the camera, mirrors and refractions, and their light to other rays.
template <int W>
PRIMRAY_RARE vvec3<W> shown_emission(const Scene& scene, vbool<W> m, const Hits<W>& h, const Interaction<W>& it,
                                     const PathLanes<W>& p, const vvec3<W>& glow, vfloat<W> presence) {
  const GeometryLights& lights = scene.geometry_lights;
  const vint<W> zero(0), none(-1);
  vint<W> number = geometry_light(scene, m, h, it);
  m &= number >= zero;
  if (!any(m)) return glow;
  number = select(m, number, zero);
  const vint<W> flags = gather<W>(lights.flags.data(), number);
  const auto has = [&](int32_t flag) { return (flags & vint<W>(flag)) != zero; };
  // The radiance of this instance, if known.
  vvec3<W> radiance = gather_vec3<W>(lights.radiance.data(), number * vint<W>(3));
  const vint<W> light = scene.emitters.any() ? emitter_light(scene, m, h, it) : none;
  if (const vbool<W> placed = m & (light >= zero); any(placed)) {
    const LightRow<W> row(scene.lights, select(placed, light, zero));
    radiance = select(placed, row.vector(kEmissionFactor), radiance);
    if (scene.lights.has_shaping) radiance *= emitter_shaping(scene, row, placed, light, p.ray.d, h.time);
  }
  const vvec3<W> one(vfloat<W>(1.0f));
  vvec3<W> given = radiance * select(has(GeometryLights::kOwn), one * presence, glow);
  if (scene.lights.lobe_factors) {
    const vfloat<W> diffuse = gather<W>(lights.diffuse.data(), number), specular = gather<W>(lights.specular.data(), number);
    given = select(p.depth == zero, given, given * (p.diffuse_share * diffuse + (one - p.diffuse_share) * specular));
  }
  if (scene.lights.links.any()) {
    const vbool<W> reached = in_collection(scene.lights.links, p.link, gather<W>(lights.link.data(), number));
    given = select(reached, given, vvec3<W>(vfloat<W>(0.0f)));
  }
  const vbool<W> body = (p.bsdf_pdf == vfloat<W>(0.0f)) & !has(GeometryLights::kShown);
  return select(m & !body, given, glow);
}

// Density per solid angle with which light sampling, at the last surface that scattered the paths `p`, would have chosen the
// point that their rays hit; infinite if only light sampling may find it.
template <int W>
PRIMRAY_INLINE vfloat<W> emitter_pdf(const Scene& scene, vbool<W> m, const Hits<W>& h, const Interaction<W>& it,
                                     const PathLanes<W>& p) {
  const vfloat<W> none(0.0f), distance = h.t + p.travelled;
  const vvec3<W> from = p.ray.o - p.ray.d * p.travelled;
  const vint<W> light = emitter_light(scene, m, h, it);
  m &= light >= vint<W>(0);
  if (!any(m)) return none;
  const LightRow<W> row(scene.lights, select(m, light, vint<W>(light[__builtin_ctz(bits(m))])));
  const vbool<W> sphere = m & is_type(row.type(), LightType::kSphere), mesh = m & is_type(row.type(), LightType::kMesh);
  vfloat<W> pdf = none;
  if (any(mesh)) pdf = select(mesh, mesh_pdf(scene, mesh, row, it.triangle, from, p.normal, p.ray.d, distance, h.time), pdf);
  if (any(sphere)) pdf = select(sphere, sphere_pdf(scene, sphere, row, light, from, p.ray.d, h.time), pdf);
  const LightTable& lights = scene.lights;
  const vfloat<W> chosen = lights.links.any() ? linked_probability_of(lights, light, m, from, p.normal, p.link)
                                              : probability_of(lights, light, m, from, p.normal);
  pdf = pdf * chosen;
  if (lights.has_special()) {
    const vbool<W> special = (row.flags() & vint<W>(kSpecial)) != vint<W>(0);
    pdf = select(special & (pdf > none), vfloat<W>(kInfinity), pdf);
  }
  return select(m, pdf, none);
}

}  // namespace primray
