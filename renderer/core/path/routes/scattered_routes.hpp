// Transitions of light path states at scattering events.
#pragma once

#include "bsdf/basics/scattering.hpp"
#include "path/routes/route_store.hpp"

namespace primray {

// Resolves, before paths scatter again, by which lobe they left the last vertex: channel by channel, with the lobe's share as
// its probability.
template <int W>
PRIMRAY_RARE void resolve_routes(PathLanes<W>& p) {
  if (!any(p.route_diffuse != p.route_other)) return;
  // This sample dimension is used by camera rays only.
  const vfloat<W> u = p.sampler.single(p.vertex, Purpose::kFilm);
  for (int i = 0; i < W; ++i) {
    int32_t mask = 0;
    if (u[i] < p.diffuse_share.x[i]) mask |= 0xff;
    if (u[i] < p.diffuse_share.y[i]) mask |= 0xff00;
    if (u[i] < p.diffuse_share.z[i]) mask |= 0xff0000;
    const int32_t chosen = (p.route_diffuse[i] & mask) | (p.route_other[i] & ~mask);
    p.route_diffuse.set(i, chosen), p.route_other.set(i, chosen);
  }
}

// Resolves the states in lanes `m` only.
template <int W>
PRIMRAY_RARE void resolve_where(vbool<W> m, PathLanes<W>& p) {
  PathLanes<W> resolved = p;
  resolve_routes(resolved);
  p.route_diffuse = select(m, resolved.route_diffuse, p.route_diffuse);
  p.route_other = select(m, resolved.route_other, p.route_other);
}

// Sets the states of `n`: paths `p`, already resolved, that continue with the BSDF sample `s`.
template <bool kInMedium, int W>
PRIMRAY_RARE void step_routes(const RouteTables& t, const PathLanes<W>& p, const BsdfSample<W>& s, PathLanes<W>& n) {
  for (int i = 0; i < W; ++i) {
    const int32_t route = p.route_other[i];
    RouteEvent diffuse = kVolume, other = kVolume;
    if (!kInMedium) {
      diffuse = s.transmits[i] ? kTransmittedDiffuse : kReflectedDiffuse;
      other = s.transmits[i] ? (s.is_delta[i] ? kTransmittedSingular : kTransmittedGlossy)
                             : (s.is_delta[i] ? kReflectedSingular : kReflectedGlossy);
      if (s.straight[i]) diffuse = other = kStraight;
    }
    // A path that enters an opaque surface takes its transition when it leaves.
    const bool stays = s.enters[i];
    n.route_diffuse.set(i, stays ? route : step(t, route, diffuse)),
        n.route_other.set(i, stays ? route : step(t, route, other));
  }
}

// Advances the states of paths that scatter in a medium.
template <int W>
PRIMRAY_RARE void step_in_medium(const RouteTables& t, vbool<W> m, PathLanes<W>& n) {
  for (uint32_t b = bits(m); b; b &= b - 1) {
    const int i = __builtin_ctz(b);
    const int32_t route = step(t, n.route_other[i], kVolume);
    n.route_diffuse.set(i, route), n.route_other.set(i, route);
  }
}

// Diffuse share of f_cos, weighted by the light's lobe multipliers.
PRIMRAY_INLINE float share_of(float diffuse, float specular) {
  const float sum = diffuse + specular;
  return sum > 0 ? diffuse / sum : 0.0f;
}

// State of the light sample in lane `i` at vertices where the resolved paths `p` scatter.
template <bool kInMedium, int W>
PRIMRAY_INLINE RoutedLight sampled_route(const RouteTables& t, const PathLanes<W>& p, const BsdfEval<W>& f, bool beyond,
                                         float diffuse, float specular, int32_t end, int i) {
  const int32_t route = p.route_other[i];
  const RouteEvent by_diffuse = kInMedium ? kVolume : beyond ? kTransmittedDiffuse : kReflectedDiffuse;
  const RouteEvent by_other = kInMedium ? kVolume : beyond ? kTransmittedGlossy : kReflectedGlossy;
  return {step(t, route, by_diffuse),
          step(t, route, by_other),
          same_ends(end),
          {share_of(f.diffuse.x[i] * diffuse, f.specular.x[i] * specular),
           share_of(f.diffuse.y[i] * diffuse, f.specular.y[i] * specular),
           share_of(f.diffuse.z[i] * diffuse, f.specular.z[i] * specular)}};
}

}  // namespace primray
