// Phase function in the place of a surface's lobes, for vertices inside a medium: all directions are transmitted.
#pragma once

#include "bsdf/bsdf.hpp"
#include "bsdf/surface.hpp"
#include "medium/medium.hpp"

namespace primray {

// Local frame: +z points back along the ray.
template <int W>
struct PhaseLobes : Bsdf<W> {
  static constexpr bool kInMedium = true, kAmongBodies = true;
  vfloat<W> phase;

  explicit PhaseLobes(vfloat<W> mean_cosine)
      : Bsdf<W>(plain(), vbool<W>(false), {vfloat<W>(0.0f), vfloat<W>(0.0f), vfloat<W>(1.0f)}, vbool<W>(true)),
        phase(mean_cosine) {}

  static vbool<W> lets_through() { return vbool<W>(true); }
  PRIMRAY_INLINE BsdfEval<W> eval(const vvec3<W>&, const vvec3<W>& wi) const {
    const vfloat<W> density = phase_density(-wi.z, phase);
    return {vvec3<W>(density), vvec3<W>(vfloat<W>(0.0f)), density};
  }
  PRIMRAY_INLINE BsdfSample<W> sample(const vvec3<W>&, vfloat<W>, vfloat<W> u, vfloat<W> v) const {
    const vbool<W> never(false);
    const vvec3<W> one(vfloat<W>(1.0f)), on = sample_phase(phase, u, v), wi{on.x, on.y, -on.z};
    return {wi, one, phase_density(on.z, phase), never, wi.z < vfloat<W>(0.0f), never, one};
  }

 private:
  // Row of a surface without lobes; nothing of it is evaluated.
  static SurfaceRows<W> plain() {
    static const float row[kSurfaceFields] = {};
    return SurfaceRows<W>(row, vint<W>(0), nullptr);
  }
};

}  // namespace primray
