// What moves in a scene, by clock: instances, and the vertices of groups. Empty where nothing does.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "base/features.hpp"
#include "math/affine_lanes.hpp"
#include "motion/clock.hpp"
#include "motion/turning.hpp"

namespace primray {

// The instances of one placement, that move by one clock.
struct MovingInstances {
  int32_t first, count;  // rows of Scene::world_from_group, where they stand as they do in the middle of the span
  int32_t clock;
  bool turns;
  size_t base;          // in MotionTable::linear (12 floats a matrix) or ::turning, by instance and time
  daffine undo_center;  // of those that turn: undoes the recentring of what they place
};

struct MotionTable {
  std::vector<MotionClock> clocks;
  std::vector<float> linear;
  std::vector<Turning> turning;
  std::vector<MovingInstances> instances;  // by their first
  // Rays' times: the shutter's part of the span that the clocks are of.
  float opens = 0, length = 0;
  float frame = 0;  // the frame's time
  // A shutter that rolls opens later for each column and row of the frame; `opens` is of the first.
  bool rolls = false;
  float per_column = 0, per_row = 0;
  Fact<built::kMotion> any_instances = false, any_points = false;

  // The number of this clock, which may be there already.
  int32_t clock_of(const MotionClock& clock) {
    for (size_t i = 0; i < clocks.size(); ++i)
      if (clocks[i].times == clock.times) return int32_t(i);
    clocks.push_back(clock);
    return int32_t(clocks.size()) - 1;
  }
  // The moving instances among which `instance` is; null if it stands still.
  const MovingInstances* find(int32_t instance) const {
    const auto after = std::upper_bound(instances.begin(), instances.end(), instance,
                                        [](int32_t i, const MovingInstances& m) { return i < m.first; });
    if (after == instances.begin()) return nullptr;
    const MovingInstances& m = after[-1];
    return instance - m.first < m.count ? &m : nullptr;
  }
  // How instance `i` of `m` stands, counted among them.
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

// Replaces the matrices of those lanes of `m` whose `instance` moves.
template <int W>
PRIMRAY_RARE void move_instances(const MotionTable& table, vbool<W> m, vint<W> instance, vfloat<W> time, AffineLanes<W>& to) {
  alignas(64) float rows[12][W];
  const vvec3<W>* columns[4] = {&to.x, &to.y, &to.z, &to.o};
  for (int c = 0; c < 4; ++c)
    store(rows[3 * c], columns[c]->x), store(rows[3 * c + 1], columns[c]->y), store(rows[3 * c + 2], columns[c]->z);
  for (uint32_t b = bits(m); b; b &= b - 1) {
    const int i = __builtin_ctz(b);
    const MovingInstances* in = table.find(instance[i]);
    if (!in) continue;
    float now[12];
    put_columns(table.at(*in, uint32_t(instance[i] - in->first), time[i]), now);
    for (int c = 0; c < 12; ++c) rows[c][i] = now[c];
  }
  const auto column = [&](int c) { return vvec3<W>(load<W>(rows[c]), load<W>(rows[c + 1]), load<W>(rows[c + 2])); };
  to.x = column(0), to.y = column(3), to.z = column(6), to.o = column(9);
}

}  // namespace primray
