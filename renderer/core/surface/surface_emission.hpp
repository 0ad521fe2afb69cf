// Radiance that a surface emits at sampled points, times its presence, for emitter sampling; in lanes `own`, what it would emit
// with an emission of 1 everywhere (build/lights/lights.hpp). Its mean is average_emission() (input_facts.hpp).
#pragma once

#include "surface/evaluate_inputs.hpp"

namespace primray {

// Emission at barycentrics (u, v) of `triangle`, an index over the scene: p = p0 + u (p1 - p0) + v (p2 - p0). `placement` and
// `instance_row` (within the placement): its instance, or -1 and 0. Textures are read at the finest level, whereas a ray that
// hits the point averages them over its cone: the two differ only by filtering.
template <int W>
PRIMRAY_INLINE vvec3<W> triangle_emission(const Scene& scene, vbool<W> active, vint<W> triangle, vint<W> vertex_base,
                                          vint<W> placement, vint<W> instance_row, vfloat<W> u, vfloat<W> v,
                                          vbool<W> own = vbool<W>(false)) {
  using I = vint<W>;
  const I zero(0);
  triangle = select(active, triangle, zero);
  const I surface = gather<W>(scene.meshes.surface.data(), gather<W>(scene.triangle_mesh.data(), triangle));
  const SurfaceRows<W> rows(scene.surfaces, surface);
  const vvec3<W> one(vfloat<W>(1.0f));
  vvec3<W> r = select(own, one, rows.color(kEmission)) * rows(kPresence);
  if (!scene.has_inputs) return r;
  const I number = gather<W>(scene.surface_inputs_of.data(), surface);
  vbool<W> left = active & (number >= zero);
  if (!any(left)) return r;
  const SurfacePoint<W> point(scene, active, triangle, vertex_base, placement, instance_row, u, v);
  while (any(left)) {
    const int k = number[__builtin_ctz(bits(left))];
    const vbool<W> same = left & (number == I(k));
    left &= !same;
    const SurfaceInputs& inputs = scene.surface_inputs[k];
    const InputSource *emission = inputs.find(InputField::kEmissiveColor), *opacity = inputs.find(InputField::kOpacity);
    InputReader<W> reader(scene, same, point, vfloat<W>(0.0f));
    reader.run_tape(inputs, [](InputField f) { return f == InputField::kEmissiveColor || f == InputField::kOpacity; });
    const float* constant = &scene.surfaces.rows[size_t(surface[__builtin_ctz(bits(same))]) * kSurfaceFields];
    vvec3<W> L = emission ? not_negative(reader.read(*emission)) : broadcast<W>(constant + kEmission);
    L = select(own, one, L);
    // Surfaces emit only where they are present: not in holes, and by its share where opacityMode "presence" applies.
    const float threshold = inputs.constants.opacity_threshold;
    if (opacity && threshold > 0) {
      L = select(reader.read(*opacity).x >= vfloat<W>(threshold), L, vvec3<W>(vfloat<W>(0.0f)));
    } else if (inputs.constants.presence) {
      L *= opacity ? clamp(reader.read(*opacity).x, 0.0f, 1.0f) : vfloat<W>(constant[kPresence]);
    }
    r = select(same, L, r);
  }
  return r;
}

}  // namespace primray
