// Sums of samples per pixel and replicate, in double, with their counts.
//
// A tile's block of samples is summed by itself, in sample order, and then added: blocks can be computed apart and merged to
// the same bits. Every pixel is written by one task at a time, so there are no locks.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "integrator/settings.hpp"

namespace primray {

struct Film {
  static constexpr int kChannels = 4;  // R, G, B, coverage
  int width = 0, height = 0;
  std::vector<double> sums;      // replicate, y, x, channel
  std::vector<uint32_t> counts;  // replicate, y, x
  std::atomic<int64_t> camera_rays{0}, scattered_rays{0}, shadow_rays{0}, invalid_samples{0}, samples{0};

  Film(int w, int h)
      : width(w), height(h), sums(size_t(kReplicates) * w * h * kChannels), counts(size_t(kReplicates) * w * h) {}
  size_t pixel(int replicate, int x, int y) const { return (size_t(replicate) * height + y) * width + x; }
};

}  // namespace primray
