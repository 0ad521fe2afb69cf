// Shading of surfaces outside of media: builds the lobes of a vertex, samples lights there, and continues the paths.
#pragma once

#include "bsdf/bsdf_with_hair.hpp"
#include "integrator/log_vertex.hpp"
#include "integrator/sample_light.hpp"
#include "integrator/scatter.hpp"

namespace primray {

template <int W, class Lobes>
void sample_direct_and_continue(Round& round, vbool<W> scatters, const Vertex<W, Lobes>& v, const PathLanes<W>& p) {
  vbool<W> lit = scatters & (p.depth < vint<W>(round.settings.max_depth));
  if constexpr (Lobes::kFollowsMedia) {
    if (v.media) lit &= !v.media->incoming.in_subsurface();
  }
  // Paths inside a fibre continue straight.
  if constexpr (Lobes::kFibres) lit &= v.bsdf.presence > vfloat<W>(0.0f);
  if (round.scene.lights.count > 0) sample_lights(round, lit, v, p);
  scatter(round, scatters, v, p);
}

template <int W, class Lobes>
PRIMRAY_RARE void sample_direct_and_continue_guided(Round& round, vbool<W> scatters, Vertex<W, Lobes>& v,
                                                    const PathLanes<W>& p) {
  const auto sends = [&](const vvec3<W>& w, vfloat<W> width2) { return suits(v.bsdf, v.wo, v.frame.to_local(w), width2); };
  const CausticLanes<W> guide(*round.settings.caustics, scatters & follows_caustics<W>(v.bsdf), v.it.p, sends);
  if (any(guide.share > vfloat<W>(0.0f))) v.caustics = &guide;
  sample_direct_and_continue(round, scatters, v, p);
}

// Samples lights and scatters at `surface`. `media`: those around it, if media are followed. `more`: arguments of Lobes.
template <class Lobes, int W, class... More>
PRIMRAY_INLINE void shade_surface(Round& round, vbool<W> scatters, const PathLanes<W>& p, const SurfaceHit<W>& surface,
                                  const MediumInterface<W>* media, const More&... more) {
  const IntegratorSettings& settings = round.settings;
  const vvec3<W> wo = surface.frame.to_local(-p.ray.d);
  Vertex<W, Lobes> v{surface.it,
                     surface.ng,
                     surface.frame,
                     wo,
                     Lobes(surface.rows, scatters, wo, surface.front, more...),
                     surface.hits,
                     {vint<W>(-1), vint<W>(0)},
                     nullptr,
                     media};
  v.bsdf.diffuse *= surface.it.color;
  if constexpr (W == 1) {
    if (PathLog* const log = path_log<W>(round)) log_lobes(*log, p, v);
  }
  if (settings.guide) v.place = find_place(*settings.guide, scatters, surface.it.p, surface.ng, v.bsdf);
  if (settings.caustics) return sample_direct_and_continue_guided(round, scatters, v, p);
  sample_direct_and_continue(round, scatters, v, p);
}

template <int W>
PRIMRAY_RARE void shade_open_pbr(Round& round, vbool<W> scatters, const PathLanes<W>& p, SurfaceHit<W>& surface) {
  align_tangent(surface.rows, scatters, surface.frame);
  const MediumInterface<W>* const none = nullptr;
  shade_surface<BsdfWithOpenPbr<W>>(round, scatters, p, surface, none);
}

template <int W>
PRIMRAY_RARE void shade_hair(Round& round, vbool<W> scatters, const PathLanes<W>& p, SurfaceHit<W>& surface) {
  align_tangent(surface.rows, scatters, surface.frame);
  align_fibre(surface.rows, scatters & surface.it.on_curve, surface.it.tangent, surface.frame);
  const MediumInterface<W>* const none = nullptr;
  shade_surface<BsdfWithHair<W>>(round, scatters, p, surface, none);
}

}  // namespace primray
