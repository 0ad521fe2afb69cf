// Vertices in media: a phase function takes the place of a surface's lobes.
#pragma once

#include "integrator/media.hpp"
#include "integrator/vertex.hpp"

namespace primray {

// Calls f(v) for the vertex at distance `t` along the rays, with a phase function for its lobes. `path`: see PhaseLobes.
// `media`: the medium state there, if media are followed.
template <int W, class F>
PRIMRAY_INLINE void with_phase_vertex(const Round& round, const PathLanes<W>& p, vint<W> path, vfloat<W> t, vfloat<W> phase,
                                      const MediumInterface<W>* media, const F& f) {
  const vvec3<W> back = -p.ray.d;
  Interaction<W> it;
  it.p = p.ray.o + p.ray.d * t, it.ng = it.ns = back;
  it.offset = it.least_cosine = vfloat<W>(0.0f);
  it.at_edge = it.smooth = vbool<W>(false);
  it.surface = it.mesh = it.triangle = it.curved = vint<W>(0);
  it.link = round.needs.links ? max(p.link, vint<W>(0)) : vint<W>(0);
  it.color = vvec3<W>(vfloat<W>(1.0f));
  const Hits<W> hits{};
  const vvec3<W> head_on(vfloat<W>(0.0f), vfloat<W>(0.0f), vfloat<W>(1.0f));
  PhaseLobes<W> lobes(phase);
  lobes.path = path;
  GuideLocation<W, true> place{vint<W>(-1), vfloat<W>(0.0f)};
  if (round.settings.guide) place = find_place_inside<W>(*round.settings.guide, it.p, phase);
  f(Vertex<W, PhaseLobes<W>>{it, back, Frame<vfloat<W>>(back), head_on, lobes, hits, place, nullptr, media});
}

}  // namespace primray
