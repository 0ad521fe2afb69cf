// Sums of floats that depend neither on their order nor on how they were grouped: the same bits for any partition of samples.
//
// A float is cut at fixed places, every kBinBits binary digits; a sum keeps, as integers, the parts in the highest place that
// any of its terms reaches and in the one below, and drops the rest. What is kept of a term depends on it and on the largest
// one alone. After Demmel and Nguyen 2015, "Parallel Reproducible Summation", with integers, so that nothing is ever carried.
//
// A term as large as the largest is kept whole, others to 2^-40 of it at least. 2^23 terms fit.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

namespace primray {

constexpr int kBinBits = 40;
constexpr int kLowestBin = -4;  // holds 2^-160 to 2^-120; the largest float lies in bin 3

// The bin of a magnitude that is finite and not denormal.
inline int bin_of(float magnitude) {
  const int exponent = int(std::bit_cast<uint32_t>(magnitude) >> 23 & 255) - 127;
  return (exponent - kLowestBin * kBinBits) / kBinBits + kLowestBin;
}

// 2^(40 bin), from one below the lowest to one above the highest.
inline double unit_of(int bin) {
  constexpr double kUnits[] = {0x1p-200, 0x1p-160, 0x1p-120, 0x1p-80, 0x1p-40, 1, 0x1p40, 0x1p80, 0x1p120, 0x1p160, 0x1p200};
  return kUnits[bin - kLowestBin + 1];
}

// One sum: high * 2^(40 bin) + low * 2^(40 (bin - 1)).
struct ExactSum {
  int64_t high = 0, low = 0;
  int bin = kLowestBin;

  // Terms of higher bins come: what would stand two bins lower is dropped.
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

// Adds what a sum keeps of `term`; `scale` is unit_of(1 - bin) of the sum's bin.
inline void add_cut(float term, double scale, int64_t& high, int64_t& low) {
  constexpr double kBin = double(int64_t(1) << kBinBits);
  const double scaled = double(term) * scale;
  const int64_t top = int64_t(scaled * (1 / kBin));
  high += top, low += int64_t(scaled - double(top) * kBin);
}

// Of floats that are finite.
inline ExactSum exact_sum(const float* terms, int count) {
  uint32_t largest = 0;  // magnitudes are ordered as their bits are
  for (int i = 0; i < count; ++i) largest = std::max(largest, std::bit_cast<uint32_t>(terms[i]) & 0x7fffffffu);
  ExactSum sum;
  sum.bin = bin_of(std::bit_cast<float>(largest));
  const double scale = unit_of(1 - sum.bin);
  for (int i = 0; i < count; ++i) add_cut(terms[i], scale, sum.high, sum.low);
  return sum;
}

}  // namespace primray
