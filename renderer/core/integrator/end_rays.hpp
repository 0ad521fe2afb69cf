// Stage before trace in scenes with scattering media: draws the distance at which each path in one of them will collide, and
// ends its ray there. A step of a random walk is then as short a ray as it is a step, and what lies beyond is not searched.
// cross_media() draws the same distance again, so that the ends need not be kept: a ray that reaches its end collides.
#pragma once

#include "integrator/media.hpp"
#include "integrator/round.hpp"

namespace primray {

// Returns the lanes whose rays end where they collide: those of paths in scattering media of objects, but where light from all
// along the ray is added, and but camera rays, which have ends of their own.
template <int W>
PRIMRAY_INLINE vbool<W> ends_at_collision(const Scene& scene, const MediumState<W>& state, const Medium<W>& medium,
                                          vint<W> depth) {
  const vbool<W> scatters = medium.scatters(), in_walk = state.in_subsurface();
  const vbool<W> within = scatters & !in_walk & (state.stack.top() >= vint<W>(0)) & (depth > vint<W>(0));
  if (!any(within) || scene.interiors.emits) return scatters & in_walk;
  return (scatters & in_walk) | (within & !is_lit(scene, state));
}

// Numbers that draw the distance up to the next collision, and the channel by which it is drawn; these sample dimensions are
// used by camera rays only.
template <int W>
PRIMRAY_INLINE Pair<W> distance_numbers(const Sampler<W>& sampler, vint<W> vertex) {
  return sampler.pair(vertex + vint<W>(1), Purpose::kLens);
}

template <int W>
PRIMRAY_RARE void end_rays(Round& round) {
  using F = vfloat<W>;
  PathPool& pool = *round.worker.pool;
  const MediumStateColumns& states = *round.worker.medium_states->pool;
  for (int at = 0; at < pool.count; at += W) {
    const MediumState<W> state = states.at<W>(at);
    const Medium<W> medium = state.medium(round.scene);
    const vbool<W> ends = ends_at_collision(round.scene, state, medium, load<W>(pool.depth + at));
    if (!any(ends)) continue;
    const vvec3<W> beta{load<W>(pool.beta_r + at), load<W>(pool.beta_g + at), load<W>(pool.beta_b + at)};
    const Pair<W> u =
        distance_numbers<W>({load<W>(pool.reversed_index + at), load<W>(pool.seed + at)}, load<W>(pool.vertex + at));
    F t = draw_distance(medium, beta, u.u, u.v);
    if (const vbool<W> walks = ends & state.in_subsurface(); any(walks)) {
      const WalkGuide<W> guide = states.guide_at<W>(at);
      const vbool<W> guided = walks & guide.guides();
      t = select(walks & !guided, max(t, guide.measured(medium)), t);
      if (any(guided)) t = select(guided, WalkDistance<W>(guide, medium, beta, pool.rays<W>(at).d).draw(u.u, u.v), t);
    }
    // A little farther than the collision, so that no rounding hides a hit before it.
    const F end = max(t - state.origin_distance, 0.0f) * (1 + 0x1p-18f);
    store(pool.tfar + at, select(ends, end, load<W>(pool.tfar + at)));
  }
}

}  // namespace primray
