// Motion of a scene, by set of motion samples (clock): instances, and the vertices of groups. Empty if nothing moves.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "base/features.hpp"
#include "math/matrix.hpp"
#include "motion/clock.hpp"
#include "motion/pose_segment.hpp"

namespace primray {

// Moving instances of one placement, with one clock.
struct MovingInstances {
  int32_t first, count;  // rows of Scene::world_from_group, which have their matrices in the middle of the span
  int32_t clock;
  bool turns;
  size_t base;          // in MotionTable::linear (12 floats per matrix) or ::turning, by instance and time
  daffine undo_center;  // of rotating ones: inverse of the recentring of what they place
};

struct MotionTable {
  std::vector<MotionClock> clocks;
  std::vector<float> linear;
  std::vector<PoseSegment> turning;
  std::vector<MovingInstances> instances;  // ordered by their first
  // Rays' times: the shutter's part of the span that the clocks cover.
  float opens = 0, length = 0;
  float frame = 0;  // time of the frame
  // With a rolling shutter each column and row of the frame opens later; `opens` belongs to the first.
  bool rolls = false;
  float per_column = 0, per_row = 0;
  Fact<built::kMotion> any_instances = false, any_points = false;

  // Returns the index of this clock, added unless it exists.
  int32_t clock_of(const MotionClock& clock) {
    for (size_t i = 0; i < clocks.size(); ++i)
      if (clocks[i].times == clock.times) return int32_t(i);
    clocks.push_back(clock);
    return int32_t(clocks.size()) - 1;
  }
  // Returns the moving instances that contain `instance`; null if it is static.
  const MovingInstances* find(int32_t instance) const {
    const auto after = std::upper_bound(instances.begin(), instances.end(), instance,
                                        [](int32_t i, const MovingInstances& m) { return i < m.first; });
    if (after == instances.begin()) return nullptr;
    const MovingInstances& m = after[-1];
    return instance - m.first < m.count ? &m : nullptr;
  }
  // Returns the matrix of instance `i` of `m`, counted among them, at a time.
  daffine at(const MovingInstances& m, uint32_t i, float time) const {
    const MotionClock& clock = clocks[size_t(m.clock)];
    const Moment now = clock.at(time);
    const size_t k = m.base + size_t(i) * clock.times.size() + size_t(now.segment);
    if (m.turns) return between(turning[k], turning[k + 1], now.within) * m.undo_center;
    const float* a = &linear[k * 12];
    const double t = now.within;
    double r[12];
    for (int c = 0; c < 12; ++c) r[c] = double(a[c]) + (double(a[12 + c]) - double(a[c])) * t;
    return affine_from_columns(r);
  }
};

// Replaces the matrices of those lanes of `m` whose `instance` moves by `of` their matrices at the lanes' times.
template <int W, class Of>
PRIMRAY_RARE void move_instances(const MotionTable& table, vbool<W> m, vint<W> instance, vfloat<W> time, AffineLanes<W>& to,
                                 const Of& of) {
  alignas(64) float rows[12][W];
  const vvec3<W>* columns[4] = {&to.x, &to.y, &to.z, &to.o};
  for (int c = 0; c < 4; ++c)
    store(rows[3 * c], columns[c]->x), store(rows[3 * c + 1], columns[c]->y), store(rows[3 * c + 2], columns[c]->z);
  for (uint32_t b = bits(m); b; b &= b - 1) {
    const int i = __builtin_ctz(b);
    const MovingInstances* in = table.find(instance[i]);
    if (!in) continue;
    float now[12];
    put_columns(of(table.at(*in, uint32_t(instance[i] - in->first), time[i])), now);
    for (int c = 0; c < 12; ++c) rows[c][i] = now[c];
  }
  const auto column = [&](int c) { return vvec3<W>(load<W>(rows[c]), load<W>(rows[c + 1]), load<W>(rows[c + 2])); };
  to.x = column(0), to.y = column(3), to.z = column(6), to.o = column(9);
}

template <int W>
PRIMRAY_INLINE void move_instances(const MotionTable& table, vbool<W> m, vint<W> instance, vfloat<W> time, AffineLanes<W>& to) {
  move_instances(table, m, instance, time, to, [](const daffine& matrix) { return matrix; });
}

// Moving vertices: their positions in the scene's arrays at the times of W rays.
//
// A group's moving vertices are the last of its vertices; all of these are stored again after them for each later time.

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
