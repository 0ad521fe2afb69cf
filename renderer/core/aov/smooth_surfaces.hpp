// Denoiser guides behind smooth surfaces: guides look past mirrors and clear glass to the first surface that scatters widely.
// What is seen in them has edges that their own albedo and normals do not show.
#pragma once

#include "bsdf/bsdf.hpp"
#include "surface/interaction.hpp"

namespace primray {

// Share of the light below which a branch is never taken: guides should be free of noise where possible.
constexpr float kSmallShare = 0.1f;
// Maximum number of smooth surfaces that a ray follows; the surface hit after that counts as what it is.
constexpr int kMostSmooth = 8;

// Continuation of rays at a surface, unless straight.
template <int W>
struct Bend {
  vbool<W> lanes;
  vvec3<W> d;     // incoming direction; in those lanes, the outgoing one
  vvec3<W> tint;  // throughput of that branch, divided by its probability
};

// Finds the lanes of `hit` on a surface that mostly reflects as a mirror or transmits without scattering; each takes the branch
// that carries more, or where both carry much, one of them by the random number `u`. The Fresnel factor is Schlick's, as in
// Bsdf.
template <int W>
PRIMRAY_INLINE void bend_at_smooth(vbool<W> hit, const Interaction<W>& it, const SurfaceRows<W>& rows, vfloat<W> u,
                                   Bend<W>& bend) {
  using F = vfloat<W>;
  using B = vbool<W>;
  using V = vvec3<W>;
  const F zero(0.0f), one(1.0f);
  const vint<W> flags = truncate(rows(kFlags));
  const auto has = [&](SurfaceFlag flag) { return (flags & vint<W>(flag)) != vint<W>(0); };
  const F pass = rows(kTransmission);
  const B is_mirror = rows(kAlpha) == zero, is_clear = (pass > zero) & (is_mirror | !has(kOpenPbr));
  B smooth = hit & has(kPreview) & (is_mirror | is_clear) & (rows(kPresence) >= one);
  if (!any(smooth)) return;
  const B front = dot(it.ng, bend.d) < zero;
  const F side = select(front, one, F(-1.0f));
  const V ng = it.ng * side, shaded = it.ns * side;
  const V n = select(dot(shaded, bend.d) < zero, shaded, ng);
  const F cosine = min(-dot(n, bend.d), one), eta = select(front, rows(kIor), one / rows(kIor));
  // Like Bsdf: from the denser side Schlick's term takes the angle on the other side, and all light is reflected beyond the
  // critical angle.
  const B to_rarer = !has(kThin) & (pass > zero) & (eta < one);
  const F sin2 = (one - cosine * cosine) / (eta * eta), rarer = safe_sqrt(one - sin2);
  const B reflects_all = to_rarer & (sin2 >= one);
  V fresnel = lerp(rows.color(kF0), rows.color(kF90), pow5(one - select(to_rarer, rarer, cosine)));
  fresnel = select(reflects_all, V(one), fresnel);
  const V passed = select(reflects_all, V(zero), (V(one) - min(fresnel, 1.0f)) * pass);
  const V diffuse = (V(one) - min(fresnel, 1.0f)) * rows.color(kDiffuse) * it.color;
  const F reflects = select(is_mirror, luminance(fresnel), zero), lets = select(is_clear, luminance(passed), zero);
  const F scatters = luminance(diffuse) + select(is_mirror, zero, luminance(fresnel));
  smooth &= reflects + lets > scatters;
  const F share = reflects / max(reflects + lets, 1e-20f);
  const B back = u < (share - kSmallShare) * (1.0f / (1.0f - 2.0f * kSmallShare));
  const F ratio = one / eta, inside = safe_sqrt(one - ratio * ratio * (one - cosine * cosine));
  const V refracted = select(has(kThin), bend.d, bend.d * ratio + n * (ratio * cosine - inside));
  const V d = select(back, bend.d + n * (2.0f * cosine), refracted);
  // The true surface decides on which side a direction is.
  const F out = dot(d, ng);
  smooth &= (back & (out > zero)) | ((!back) & (out < zero));
  bend.tint = select(back, fresnel * (one / max(share, 1e-6f)), passed * (one / max(one - share, 1e-6f)));
  bend.d = select(smooth, d, bend.d);
  bend.lanes = smooth;
}

}  // namespace primray
