// Lobes in scenes with OpenPBR surfaces: lanes on such surfaces use OpenPbr (open_pbr/open_pbr.hpp), the others Bsdf.
#pragma once

#include <optional>

#include "bsdf/bsdf.hpp"
#include "bsdf/open_pbr/open_pbr.hpp"

namespace primray {

template <int W>
PRIMRAY_INLINE vbool<W> select(vbool<W> m, vbool<W> a, vbool<W> b) {
  return (m & a) | (b & !m);
}

template <int W>
struct BsdfWithOpenPbr : Bsdf<W> {
  static constexpr bool kFollowsMedia = true;
  using F = vfloat<W>;
  using V = vvec3<W>;

  vbool<W> is_open_pbr;
  bool all_open_pbr = false;
  std::optional<OpenPbr<W>> open_pbr;  // if any lane is OpenPBR

  BsdfWithOpenPbr(const SurfaceTable& table, vint<W> surface, vbool<W> active, const V& wo, vbool<W> front)
      : BsdfWithOpenPbr(SurfaceRows<W>(table, surface), active, wo, front) {}
  // `beside` and `deep`: see OpenPbr.
  BsdfWithOpenPbr(const SurfaceRows<W>& field, vbool<W> active, const V& wo, vbool<W> front, F beside = F(1.0f),
                  vbool<W> deep = vbool<W>(false))
      : Bsdf<W>(field, active, wo, front), is_open_pbr(false) {
    is_open_pbr = active & ((field.flags() & vint<W>(kOpenPbr)) != vint<W>(0));
    if (any(is_open_pbr)) set_open_pbr(field, active, wo, front, beside, deep);
  }

  vfloat<W> cosine_lobe() const {
    const F other = Bsdf<W>::cosine_lobe();
    return open_pbr ? select(is_open_pbr, open_pbr->p_diffuse, other) : other;
  }
  vbool<W> lets_through() const { return open_pbr ? is_open_pbr & open_pbr->lets_through() : vbool<W>(false); }

  __attribute__((noinline)) BsdfEval<W> eval(const V& wo, const V& wi) const {
    if (!open_pbr) return Bsdf<W>::eval(wo, wi);
    BsdfEval<W> e = open_pbr->eval(wo, wi);
    const F there = this->presence;
    e.diffuse = e.diffuse * there, e.specular = e.specular * there, e.pdf = e.pdf * there;
    if (all_open_pbr) return e;
    const BsdfEval<W> other = Bsdf<W>::eval(wo, wi);
    return {select(is_open_pbr, e.diffuse, other.diffuse), select(is_open_pbr, e.specular, other.specular),
            select(is_open_pbr, e.pdf, other.pdf)};
  }

  __attribute__((noinline)) BsdfSample<W> sample(const V& wo, F lobe, F u, F v) const {
    if (!open_pbr) return Bsdf<W>::sample(wo, lobe, u, v);
    const BsdfSample<W> s = sample_open_pbr(wo, lobe, u, v);
    return all_open_pbr ? s : select_sample(is_open_pbr, s, Bsdf<W>::sample(wo, lobe, u, v));
  }

  static BsdfSample<W> select_sample(vbool<W> m, const BsdfSample<W>& a, const BsdfSample<W>& b) {
    return {select(m, a.wi, b.wi),
            select(m, a.weight, b.weight),
            select(m, a.pdf, b.pdf),
            select(m, a.is_delta, b.is_delta),
            select(m, a.transmits, b.transmits),
            select(m, a.straight, b.straight),
            select(m, a.diffuse_share, b.diffuse_share),
            select(m, a.enters, b.enters)};
  }

 private:
  // Also sets the members that are read for any surface.
  __attribute__((noinline)) void set_open_pbr(const SurfaceRows<W>& field, vbool<W> active, const V& wo, vbool<W> front,
                                              F beside, vbool<W> deep) {
    const vbool<W> m = is_open_pbr;
    all_open_pbr = !any(active & !m);
    const OpenPbr<W>& o = open_pbr.emplace(field.open_pbr_rows(m), m, m & this->thin, wo, front, beside, deep);
    this->p_diffuse = select(m, o.p_diffuse + o.p_behind + o.p_fuzz, this->p_diffuse);
    this->p_specular = select(m, o.p_specular, this->p_specular), this->p_coat = select(m, o.p_coat, this->p_coat);
    this->mirror = select(m, o.mirror, this->mirror);
    this->transmission = select(m, o.straight_transmittance(wo), this->transmission);
    this->coat_keep = select(m, F(1.0f), this->coat_keep);
    this->thin = this->thin | (m & o.matched);  // light continues straight
  }
  BsdfSample<W> sample_open_pbr(const V& wo, F lobe, F u, F v) const {
    if (!this->any_presence) return open_pbr->sample(wo, lobe, u, v);
    const F there = this->presence;
    const vbool<W> gone = is_open_pbr & (lobe >= there), all(true);
    BsdfSample<W> s = open_pbr->sample(wo, min(lobe / max(there, 1e-20f), 0x1.fffffep-1f), u, v);
    s.pdf = s.pdf * there;
    return select_sample(gone, BsdfSample<W>{-wo, V(F(1.0f)), F(0.0f), all, all, all, V(F(0.0f))}, s);
  }
};

// Rotates the frames of OpenPBR surfaces in lanes `m` about their normals, until +x points along the projected tangent.
template <int W>
PRIMRAY_RARE void align_tangent(const SurfaceRows<W>& field, vbool<W> m, Frame<vfloat<W>>& frame) {
  const vint<W> flags = field.flags();
  m &= (flags & vint<W>(kOpenPbr)) != vint<W>(0);
  if (!any(m)) return;
  const vvec3<W> along = field.open_pbr_rows(m).color(kOpenTangent);
  const vvec3<W> t = along - frame.n * dot(along, frame.n);
  const vfloat<W> size2 = dot(t, t);
  m &= (size2 > vfloat<W>(1e-12f)) & (size2 < vfloat<W>(1e30f));
  const vvec3<W> s = t * (1.0f / sqrt(select(m, size2, 1.0f)));
  frame.s = select(m, s, frame.s);
  frame.t = select(m, cross(frame.n, s), frame.t);
}

}  // namespace primray
