// Packets or single rays, by what measures best here: camera rays, scattered rays and shadow rays each choose for themselves.
//
// The bits of a hit do not depend on how its ray was traced (architecture: "A ray's bits do not depend on its packet"), so
// a choice by the clock leaves the image alone.
#pragma once

#include <x86intrin.h>

#include <cstdint>

namespace primray {

class EntryChoice {
 public:
  bool packet() const { return trials_ < kTrials ? (trials_ & 1) : packet_; }
  bool measuring() const { return trials_ < kTrials; }
  static uint64_t now() { return __rdtsc(); }
  // Cycles that `rays` rays took by the way that packet() named.
  void record(uint64_t cycles, int rays) {
    const int way = trials_ & 1;
    cycles_[way] += double(cycles), rays_[way] += rays;
    if (++trials_ == kTrials) packet_ = cycles_[1] * rays_[0] <= cycles_[0] * rays_[1];
  }

 private:
  static constexpr int kTrials = 256;  // chunks of W rays, taken by turns
  int trials_ = 0;
  bool packet_ = true;
  double cycles_[2] = {}, rays_[2] = {};
};

}  // namespace primray
