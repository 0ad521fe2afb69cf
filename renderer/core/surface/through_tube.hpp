// Rays transmitted by hair: the fibre model handles the whole passage at the entry point, so such rays start behind the far
// wall of the tube; otherwise each would first hit that wall from within.
#pragma once

#include "surface/interaction.hpp"

namespace primray {

// Squared sine of the angle to a tube below which rays run along it.
constexpr float kAlongTube = 1e-4f;
// Margin behind the far wall, as a share of the distance to it, and in offsets.
constexpr float kPastWall = 1e-3f, kPastOffsets = 16;

// Distance from the near wall of round tubes along `d` to behind the far wall, as if the tubes were straight; 0 in lanes that
// pass through no such tube. Rays that are still inside, in a bend, hit that wall and continue straight.
template <int W>
PRIMRAY_RARE vfloat<W> way_through_tube(vbool<W> m, const Interaction<W>& it, const vvec3<W>& d) {
  using F = vfloat<W>;
  m &= it.on_curve & (it.radius > F(0.0f));
  const vvec3<W> flat = d - it.tangent * dot(d, it.tangent);
  const F in = -dot(flat, it.ng), across2 = dot(flat, flat);
  m &= (in > F(0.0f)) & (across2 > F(kAlongTube));
  const F way = 2.0f * it.radius * in / max(across2, kAlongTube);
  return select(m, way * (1.0f + kPastWall) + it.offset * kPastOffsets, F(0.0f));
}

}  // namespace primray
