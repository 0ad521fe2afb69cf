// Moving vertices: their positions in the scene's arrays at the times of W rays.
//
// A group's moving vertices are the last of its vertices; all of these are stored again after them for each later time.
#pragma once

#include "motion/motion_table.hpp"

namespace primray {

template <int W>
struct VertexMotion {
  bool any = false;  // if false nothing else is set: hits on static geometry do not pay for it
  vbool<W> moves;
  vint<W> segment, stride;  // vertices between one time and the next
  vfloat<W> within;
  vvec3<W> sizes;  // magnitudes of a triangle's first corner at both times

  // Sets lanes `m`, each with a clock and a stride.
  PRIMRAY_RARE void set(const MotionTable& table, vbool<W> m, vint<W> clock, vint<W> step, vfloat<W> time) {
    any = true, moves = m, stride = step, segment = vint<W>(0), within = vfloat<W>(0.0f), sizes = vvec3<W>(within);
    for (uint32_t b = bits(m); b; b &= b - 1) {
      const int i = __builtin_ctz(b);
      const Moment now = table.clocks[size_t(clock[i])].at(time[i]);
      segment.set(i, now.segment), within.set(i, now.within);
    }
  }
  // Interpolates between read(0) and read(1), of `segment` and the next one.
  template <class Read>
  PRIMRAY_INLINE vvec3<W> between(const Read& read) const {
    const vvec3<W> a = read(0);
    if (!any) return a;
    return select(moves, a * (1.0f - within) + read(1) * within, a);
  }
};

}  // namespace primray
