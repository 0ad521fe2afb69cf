// Light that hair lets through has gone through the fibre where it came in: rays that carry it look from the far wall of the
// tube on, or each would first meet that wall from within.
#pragma once

#include "surface/interaction.hpp"

namespace primray {

// Rays whose squared sine to a tube is less go along it.
constexpr float kAlongTube = 1e-4f;
// What is beyond the far wall, of the way to it, and in offsets.
constexpr float kPastWall = 1e-3f, kPastOffsets = 16;

// From the near wall of round tubes along `d` to behind the far one, as if they were straight there; 0 for lanes that go
// through no such tube. Rays that are inside all the same, in a bend, meet that wall and go on straight.
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
