// Packets or single rays, by what measures best here: camera rays, scattered rays and shadow rays each choose for themselves.
//
// A hit has the same bits as a packet's and as a single ray's (tests/kernels/test_intersection.py), so a choice by the clock
// leaves the image alone.
#pragma once

#include <x86intrin.h>

#include <algorithm>
#include <cstdint>

namespace primray {

class EntryChoice {
 public:
  // Of the next chunk of rays.
  bool packet() {
    if (++chunk_ == due_) trials_ = 0;
    return measuring() ? (trials_ & 1) : packet_;
  }
  bool measuring() const { return trials_ < kTrials; }
  static uint64_t now() { return __rdtsc(); }
  // Cycles that `rays` rays took by the way that packet() named.
  void record(uint64_t cycles, int rays) {
    cost_[trials_ & 1][trials_ / 2] = float(cycles) / float(rays);
    if (++trials_ < kTrials) return;
    packet_ = trimmed(cost_[1]) <= trimmed(cost_[0]);
    // Again soon, as memory was cold and the first tile may be unlike the others; later one in 256 chunks is a trial.
    due_ = chunk_ + std::clamp<int64_t>(chunk_, kTrials, 256 * kTrials);
  }

 private:
  static constexpr int kTrials = 64;  // chunks of W rays, taken by turns
  // The sum without the highest eighth: the operating system may have taken the processor away for longer than all else took.
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
