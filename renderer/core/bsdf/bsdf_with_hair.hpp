// Lobes in scenes with hair: lanes on hair use its lobes (hair/hair.hpp), the others those of scenes without hair, which do not
// include this file.
#pragma once

#include <optional>

#include "bsdf/bsdf_with_open_pbr.hpp"
#include "bsdf/hair/hair.hpp"

namespace primray {

template <int W>
struct BsdfWithHair : BsdfWithOpenPbr<W> {
  using F = vfloat<W>;
  using V = vvec3<W>;
  using Base = BsdfWithOpenPbr<W>;
  static constexpr bool kFibres = true;

  vbool<W> is_hair;
  bool all_hair = false;
  std::optional<Hair<W>> hair;  // if any lane is hair

  BsdfWithHair(const SurfaceTable& table, vint<W> surface, vbool<W> active, const V& wo, vbool<W> front)
      : BsdfWithHair(SurfaceRows<W>(table, surface), active, wo, front) {}
  BsdfWithHair(const SurfaceRows<W>& field, vbool<W> active, const V& wo, vbool<W> front, F beside = F(1.0f),
               vbool<W> deep = vbool<W>(false))
      : Base(field, active, wo, front, beside, deep), is_hair(false) {
    is_hair = active & ((field.flags() & vint<W>(kHair)) != vint<W>(0));
    if (any(is_hair)) set_hair(field, active, wo, front);
  }

  vbool<W> lets_through() const { return is_hair | Base::lets_through(); }

  __attribute__((noinline)) BsdfEval<W> eval(const V& wo, const V& wi) const {
    if (!hair) return Base::eval(wo, wi);
    BsdfEval<W> e = hair->eval(wi);
    const F there = this->presence;
    e.specular = e.specular * there, e.pdf = e.pdf * there;
    if (all_hair) return e;
    const BsdfEval<W> other = Base::eval(wo, wi);
    return {select(is_hair, e.diffuse, other.diffuse), select(is_hair, e.specular, other.specular),
            select(is_hair, e.pdf, other.pdf)};
  }

  __attribute__((noinline)) BsdfSample<W> sample(const V& wo, F lobe, F u, F v) const {
    if (!hair) return Base::sample(wo, lobe, u, v);
    const BsdfSample<W> s = sample_hair(wo, lobe, u, v);
    return all_hair ? s : Base::select_sample(is_hair, s, Base::sample(wo, lobe, u, v));
  }

 private:
  __attribute__((noinline)) void set_hair(const SurfaceRows<W>& field, vbool<W> active, const V& wo, vbool<W> front) {
    all_hair = !any(active & !is_hair);
    hair.emplace(field.hair_rows(is_hair), wo);
    // Where light hits the far wall from within, it has already passed through the fibre.
    const vbool<W> within = is_hair & !front;
    this->presence = select(within, 0.0f, this->presence);
    this->any_presence |= any(within);
  }
  BsdfSample<W> sample_hair(const V& wo, F lobe, F u, F v) const {
    if (!this->any_presence) return hair->sample(lobe, u, v);
    const F there = this->presence;
    const vbool<W> gone = is_hair & (lobe >= there), all(true);
    BsdfSample<W> s = hair->sample(min(lobe / max(there, 1e-20f), 0x1.fffffep-1f), u, v);
    s.pdf = s.pdf * there;
    return Base::select_sample(gone, BsdfSample<W>{-wo, V(F(1.0f)), F(0.0f), all, all, all, V(F(0.0f))}, s);
  }
};

// Straight transmittance of a shadow ray through surfaces of such scenes.
template <int W>
PRIMRAY_INLINE vvec3<W> straight_through_hair(const SurfaceRows<W>& field, vbool<W> active, vbool<W> front,
                                              const vvec3<W>& other) {
  const vbool<W> is_hair = active & ((field.flags() & vint<W>(kHair)) != vint<W>(0));
  return select(is_hair, vvec3<W>(select(front, 1.0f - field(kPresence), 1.0f)), other);
}

// Rotates the frames of hair in lanes `m` about their normals, until +x points along the fibre.
template <int W>
PRIMRAY_RARE void align_fibre(const SurfaceRows<W>& field, vbool<W> m, const vvec3<W>& along, Frame<vfloat<W>>& frame) {
  m &= (field.flags() & vint<W>(kHair)) != vint<W>(0);
  if (!any(m)) return;
  const vvec3<W> t = along - frame.n * dot(along, frame.n);
  const vfloat<W> size2 = dot(t, t);
  m &= (size2 > vfloat<W>(1e-36f)) & (size2 < vfloat<W>(1e30f));
  const vvec3<W> s = t * (1.0f / sqrt(select(m, size2, 1.0f)));
  frame.s = select(m, s, frame.s);
  frame.t = select(m, cross(frame.n, s), frame.t);
}

}  // namespace primray
