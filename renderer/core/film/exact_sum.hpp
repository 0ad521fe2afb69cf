// Reproducible sums of floats, independent of order and grouping: the same bits for any partition of samples.
//
// A float is cut at fixed positions, every kBinBits binary digits; a sum keeps, as integers, the parts in the highest bin that
// any of its terms reaches and in the one below, and drops the rest. The part of a term that is kept depends only on the term
// and on the largest one. After Demmel and Nguyen 2015, "Parallel Reproducible Summation", with integers, so that nothing is
// ever carried.
//
// A term as large as the largest is kept entirely, others to at least 2^-40 of it. 2^23 terms fit.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "base/assert.hpp"

namespace primray {

constexpr int kBinBits = 40;
constexpr int kLowestBin = -4;  // holds 2^-160 to 2^-120; the largest float is in bin 3

// Bin of a magnitude that is finite and not denormal.
inline int bin_of(float magnitude) {
  const int exponent = int(std::bit_cast<uint32_t>(magnitude) >> 23 & 255) - 127;
  return (exponent - kLowestBin * kBinBits) / kBinBits + kLowestBin;
}

// 2^(40 bin), from one below the lowest to one above the highest.
inline double unit_of(int bin) {
  PRIMRAY_ASSERT(bin >= kLowestBin - 1 && bin <= kLowestBin + 9);
  constexpr double kUnits[] = {0x1p-200, 0x1p-160, 0x1p-120, 0x1p-80, 0x1p-40, 1, 0x1p40, 0x1p80, 0x1p120, 0x1p160, 0x1p200};
  return kUnits[bin - kLowestBin + 1];
}

// One sum: high * 2^(40 bin) + low * 2^(40 (bin - 1)).
struct ExactSum {
  int64_t high = 0, low = 0;
  int bin = kLowestBin;

  // Prepares for terms of higher bins: drops what would be two bins lower.
  void raise(int to) {
    if (to <= bin) return;
    low = to == bin + 1 ? high : 0;
    high = 0, bin = to;
  }
  void add(const ExactSum& other) {
    ExactSum o = other;
    o.raise(bin), raise(o.bin);
    high += o.high, low += o.low;
  }
  double value() const { return double(high) * unit_of(bin) + double(low) * unit_of(bin - 1); }
};

// Adds the part of `term` that a sum keeps; `scale` is unit_of(1 - bin) of the sum's bin.
inline void add_cut(float term, double scale, int64_t& high, int64_t& low) {
  constexpr double kBin = double(int64_t(1) << kBinBits);
  const double scaled = double(term) * scale;
  const int64_t top = int64_t(scaled * (1 / kBin));
  high += top, low += int64_t(scaled - double(top) * kBin);
}

// Sum of finite floats.
inline ExactSum exact_sum(const float* terms, int count) {
  uint32_t largest = 0;  // magnitudes are ordered like their bits
  for (int i = 0; i < count; ++i) largest = std::max(largest, std::bit_cast<uint32_t>(terms[i]) & 0x7fffffffu);
  ExactSum sum;
  sum.bin = bin_of(std::bit_cast<float>(largest));
  const double scale = unit_of(1 - sum.bin);
  for (int i = 0; i < count; ++i) add_cut(terms[i], scale, sum.high, sum.low);
  return sum;
}

}  // namespace primray
