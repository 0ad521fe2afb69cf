// Sums of floats that depend neither on their order nor on how they were grouped: the same bits for any partition of samples.
//
// A float is cut at fixed places, every kBinBits binary digits; a sum keeps, as integers, the parts in the highest place that
// any of its terms reaches and in the one below, and drops the rest. What is kept of a term depends on it and on the largest
// one alone. After Demmel and Nguyen 2015, "Parallel Reproducible Summation", with integers, so that nothing is ever carried.
//
// A term as large as the largest is kept whole, others to 2^-40 of it at least. 2^23 terms fit.
#pragma once

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
  double value() const { return std::ldexp(double(high), kBinBits * bin) + std::ldexp(double(low), kBinBits * (bin - 1)); }
};

// Of floats that are finite.
inline ExactSum exact_sum(const float* terms, int count) {
  float largest = 0;
  for (int i = 0; i < count; ++i) largest = std::fmax(largest, std::fabs(terms[i]));
  ExactSum sum;
  sum.bin = bin_of(largest);
  const double unit = std::ldexp(1.0, -kBinBits * (sum.bin - 1));
  constexpr double kBin = double(int64_t(1) << kBinBits);
  double high = 0, low = 0;  // whole numbers, exact: below 2^53 for 8192 terms
  for (int i = 0; i < count; ++i) {
    const double scaled = std::trunc(double(terms[i]) * unit), top = std::trunc(scaled * (1 / kBin));
    high += top, low += scaled - top * kBin;
  }
  sum.high = int64_t(high), sum.low = int64_t(low);
  return sum;
}

}  // namespace primray
