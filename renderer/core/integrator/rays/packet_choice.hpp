// Choice between packet and single-ray traversal by measured time; camera, scattered and shadow rays choose separately.
//
// Hits have the same bits either way (tests/kernels/test_intersection.py), so a choice by the clock does not change the image.
#pragma once

#include <x86intrin.h>

#include <algorithm>
#include <cstdint>

namespace primray {

class PacketChoice {
 public:
  // Whether the next chunk of rays is traced as packets.
  bool packet() {
    if (++chunk_ == due_) trials_ = 0;
    return measuring() ? (trials_ & 1) : packet_;
  }
  bool measuring() const { return trials_ < kTrials; }
  static uint64_t now() { return __rdtsc(); }
  // Records the cycles that `rays` rays took in the mode that packet() returned.
  void record(uint64_t cycles, int rays) {
    cost_[trials_ & 1][trials_ / 2] = float(cycles) / float(rays);
    if (++trials_ < kTrials) return;
    packet_ = trimmed(cost_[1]) <= trimmed(cost_[0]);
    // Measures again soon, since caches were cold and the first tile may be atypical; later one chunk in 256 is a trial.
    due_ = chunk_ + std::clamp<int64_t>(chunk_, kTrials, 256 * kTrials);
  }

 private:
  static constexpr int kTrials = 64;  // chunks of W rays, alternating between both modes
  // Sum of the costs without the highest eighth, during which the thread may have been descheduled.
  static float trimmed(float (&cost)[kTrials / 2]) {
    constexpr int kKept = kTrials / 2 - kTrials / 16;
    std::sort(cost, cost + kTrials / 2);
    float sum = 0;
    for (int i = 0; i < kKept; ++i) sum += cost[i];
    return sum;
  }

  int trials_ = 0;
  int64_t chunk_ = 0, due_ = -1;
  bool packet_ = true;
  float cost_[2][kTrials / 2] = {};
};

}  // namespace primray
