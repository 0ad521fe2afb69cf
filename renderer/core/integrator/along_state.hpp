// Segments of rays along which lights are sampled (integrator/along_rays.hpp), and their share of the light.
#pragma once

#include "integrator/rays/path_pool.hpp"
#include "light/sampler/segment_choice.hpp"

namespace primray {

// By path of the pool, as it is when the rays have been traced.
struct AlongState {
  // The segment within media, its mean extinction, and what lights could send there in all; 0: it is not sampled.
  alignas(64) float from[kPadded], to[kPadded], extinction[kPadded], total[kPadded];
  // The light and the distance that are chosen, the density of both, and the transmittance up to there.
  alignas(64) float t[kPadded], density[kPadded], left[3][kPadded];
  alignas(64) int32_t light[kPadded];
  std::vector<float> sums;  // of the packet of rays that chooses lights (LightAlong)

  explicit AlongState(const PivotTable& pivots) : sums(16 * pivots.pivots.size()) {}

  // Density of distances by extinction, as both techniques take it to be.
  template <int W>
  static PRIMRAY_INLINE vfloat<W> by_extinction(vfloat<W> from, vfloat<W> t, vfloat<W> extinction) {
    return extinction * exp2(-1.44269504f * (extinction * max(t - from, 0.0f)));
  }
  // Share of the vertices at distance `t` along rays `o`, `d`, in the light that `light` sends there; they choose it with
  // `probability`. `path`: of the pool.
  template <int W>
  PRIMRAY_RARE vfloat<W> share_of_vertices(const PivotTable& pivots, const vvec3<W>& o, const vvec3<W>& d, vfloat<W> t,
                                           vint<W> path, vint<W> which, vfloat<W> probability) const {
    const vfloat<W> begin = gather<W>(from, path), sum = gather<W>(total, path), one(1.0f);
    const Segment<W> segment{o, d, begin, gather<W>(to, path)};
    const vfloat<W> own = by_extinction(begin, t, gather<W>(extinction, path)) * probability;
    const vfloat<W> other = density_along(pivots, segment, sum, which, t);
    return select(sum > vfloat<W>(0.0f), own / max(own + other, 1e-30f), one);
  }
};

}  // namespace primray
