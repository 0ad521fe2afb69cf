// Portals: rectangles through which a dome is sampled, such as the windows of a room (UsdLux PortalLight, DomeLight portals).
//
// Portals only guide samples: light arrives from every direction, through a portal or not. A dome with portals is sampled from
// a mixture of its image's distribution and of directions through a portal, which is chosen for the point like a rectangle
// light; where no portal is visible, or only from the side that it does not transmit to (-z), by the image alone. Domes and
// portals that move are taken as they are at the time of the ray.
#pragma once

#include "light/sampler/selection.hpp"

namespace primray {

constexpr float kPortalShare = 0.5f;  // share of portal samples, for a dome whose image is sampled too

// Share of samples at p that go through portals.
template <int W>
PRIMRAY_INLINE vfloat<W> portal_share(const Dome& dome, const LightTable& portals, const vvec3<W>& p) {
  const vfloat<W> share(dome.sampled ? kPortalShare : 1.0f);
  if (portals.by_tree()) return share;
  return select(total_importance(portals, p) > vfloat<W>(0.0f), share, vfloat<W>(0.0f));
}

// Density with which directions through portals are chosen.
template <int W>
PRIMRAY_INLINE vfloat<W> portal_pdf(const LightTable& portals, const vvec3<W>& p, const vvec3<W>& wi, vfloat<W> time) {
  const bool weighed = portals.count > 1 && !portals.by_tree();
  const vfloat<W> total = weighed ? total_importance(portals, p) : vfloat<W>(1.0f);
  vfloat<W> pdf(0.0f);
  for (int i = 0; i < portals.count; ++i) {
    vvec3<W> o = p, d = wi;
    if (const int32_t path = portals.motion.any() ? portals.motion.row(i) : -1; path >= 0) {
      const LightPoses<W> poses = poses_of(portals.motion.paths[size_t(path)], time);
      o = poses.point_to_row(p), d = poses.vector_to_row(wi);
    }
    const vfloat<W> met = light_hit<W>(portals.row(i), o, d).pdf;
    const vbool<W> m = met > vfloat<W>(0.0f);
    if (any(m)) pdf += met * light_probability(portals, i, m, p, vvec3<W>(vfloat<W>(0.0f)), total);
  }
  return pdf;
}

// Density of the mixture for dome number `k`; `by_image` is that of its image.
template <int W>
PRIMRAY_RARE vfloat<W> dome_pdf(const LightTable& table, int k, const vvec3<W>& p, const vvec3<W>& wi, vfloat<W> by_image,
                                vfloat<W> time) {
  const LightTable& portals = table.portals[k];
  if (portals.count == 0) return by_image;
  const vfloat<W> share = portal_share(table.domes[k], portals, p);
  return by_image * (1.0f - share) + portal_pdf(portals, p, wi, time) * share;
}

// Replaces the samples of lanes `m`, whose `light` is a dome, by samples of the mixture if the dome has portals. `choice`: an
// independent random number in [0, 1).
template <int W>
PRIMRAY_RARE void sample_portals(const LightTable& table, vbool<W> m, vint<W> light, const vvec3<W>& p, vfloat<W> choice,
                                 vfloat<W> u, vfloat<W> v, vfloat<W> time, LightSample<W>& s) {
  const vint<W> dome = LightRow<W>(table, select(m, light, vint<W>(light[__builtin_ctz(bits(m))]))).integer(kDomeIndex);
  for (int k = 0; k < int(table.domes.size()); ++k) {
    const LightTable& portals = table.portals[k];
    const vbool<W> mine = m & (dome == vint<W>(k));
    if (portals.count == 0 || !any(mine)) continue;
    const vfloat<W> share = portal_share(table.domes[k], portals, p);
    const vbool<W> through = mine & (choice < share);
    vbool<W> chosen = mine & !through & vbool<W>(table.domes[k].sampled);
    if (any(through)) {
      const vfloat<W> rest = min(choice / max(share, 1e-30f), 0x1.fffffep-1f);
      const vuint<W> number = bit_cast<vuint<W>>(truncate(rest * 0x1p24f)) << 8;
      const LightChoice<W> c = choose_light(portals, through, p, vvec3<W>(vfloat<W>(0.0f)), number);
      const LightSample<W> n = light_sample(portals, c.light, through & (c.probability > vfloat<W>(0.0f)), p, u, v, time);
      s.wi = select(through, n.wi, s.wi);
      chosen |= through & (n.pdf > vfloat<W>(0.0f));
    }
    vfloat<W> pdf;
    const vvec3<W> L = dome_eval(table.domes[k], dome_direction(table, size_t(k), s.wi, time), pdf);
    pdf = dome_pdf(table, k, p, s.wi, pdf, time);
    s.pdf = select(mine, select(chosen, pdf, vfloat<W>(0.0f)), s.pdf);
    s.L = select(mine, L, s.L), s.t = select(mine, vfloat<W>(kInfinity), s.t);
  }
}

}  // namespace primray
