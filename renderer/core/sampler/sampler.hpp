// Owen-scrambled Sobol points: a number in [0,1) is a function of (seed, pixel, replicate, index, dimension) and nothing else.
//
// Every pair of dimensions takes the first two Sobol dimensions at an index shuffled for that pair, scrambled again: Burley 2020, "Practical
// Hash-based Owen Scrambling", with the hash of Laine and Karras 2011 as improved by Vegdahl 2021 ("Building a Better LK
// Hash"). Dimensions are numbered by bounce and purpose, whatever the scene holds: a feature that is off leaves its own unused.
#pragma once

#include "math/lanes.hpp"

namespace primray {

// What a number is for; each bounce owns kPurposes of them, the camera ray counts as bounce 0.
enum class Purpose : uint32_t { kFilm, kLens, kDirection, kLobe, kLightPoint, kLightChoice, kRoulette, kCount };

template <int W>
PRIMRAY_INLINE vuint<W> reverse_bits(vuint<W> x) {
  x = ((x >> 1) & vuint<W>(0x55555555u)) | ((x & vuint<W>(0x55555555u)) << 1);
  x = ((x >> 2) & vuint<W>(0x33333333u)) | ((x & vuint<W>(0x33333333u)) << 2);
  x = ((x >> 4) & vuint<W>(0x0f0f0f0fu)) | ((x & vuint<W>(0x0f0f0f0fu)) << 4);
  x = ((x >> 8) & vuint<W>(0x00ff00ffu)) | ((x & vuint<W>(0x00ff00ffu)) << 8);
  return (x >> 16) | (x << 16);
}

// A permutation in which every bit depends on lower bits alone: Owen scrambling of numbers with their bits reversed.
template <int W>
PRIMRAY_INLINE vuint<W> laine_karras(vuint<W> x, vuint<W> seed) {
  x = x ^ (x * vuint<W>(0x3d20adeau));
  x += seed;
  x *= (seed >> 16) | vuint<W>(1u);
  x = x ^ (x * vuint<W>(0x05526c56u));
  x = x ^ (x * vuint<W>(0x53a22864u));
  return x;
}

// Wellons' "lowbias32" (2018): a mixer for seeds.
template <int W>
PRIMRAY_INLINE vuint<W> mix(vuint<W> x) {
  x = x ^ (x >> 16);
  x *= vuint<W>(0x7feb352du);
  x = x ^ (x >> 15);
  x *= vuint<W>(0x846ca68bu);
  return x ^ (x >> 16);
}

// The second Sobol dimension with its bits reversed: Pascal's triangle modulo 2, in five butterfly steps.
template <int W>
PRIMRAY_INLINE vuint<W> sobol_second(vuint<W> x) {
  x = x ^ ((x >> 1) & vuint<W>(0x55555555u));
  x = x ^ ((x >> 2) & vuint<W>(0x33333333u));
  x = x ^ ((x >> 4) & vuint<W>(0x0f0f0f0fu));
  x = x ^ ((x >> 8) & vuint<W>(0x00ff00ffu));
  return x ^ ((x >> 16) & vuint<W>(0x0000ffffu));
}

template <int W>
struct Pair {
  vfloat<W> u, v;
};

template <int W>
struct Sampler {
  vuint<W> reversed_index;  // bits of the sample's number, lowest first
  vuint<W> seed;            // of (seed, pixel, replicate)

  static PRIMRAY_INLINE vuint<W> pixel_seed(uint32_t seed, vint<W> x, vint<W> y, vuint<W> replicate) {
    return mix(mix(mix(mix(vuint<W>(seed)) + bit_cast<vuint<W>>(x)) ^ (bit_cast<vuint<W>>(y) << 1)) + replicate);
  }

  PRIMRAY_INLINE vuint<W> dimension_seed(vint<W> bounce, Purpose purpose) const {
    const vuint<W> dimension = bit_cast<vuint<W>>(bounce) * vuint<W>(uint32_t(Purpose::kCount)) + vuint<W>(uint32_t(purpose));
    return mix(seed ^ (dimension * vuint<W>(0x9e3779b9u)));
  }
  PRIMRAY_INLINE Pair<W> pair(vint<W> bounce, Purpose purpose) const {
    const vuint<W> s = dimension_seed(bounce, purpose);
    const vuint<W> index = reverse_bits(laine_karras(reversed_index, s));
    const vuint<W> a = laine_karras(index, s * vuint<W>(0x85ebca6bu)), b = laine_karras(sobol_second(index), s * vuint<W>(0xc2b2ae35u));
    return {unit_float(reverse_bits(a)), unit_float(reverse_bits(b))};
  }
  PRIMRAY_INLINE vfloat<W> single(vint<W> bounce, Purpose purpose) const {
    const vuint<W> s = dimension_seed(bounce, purpose);
    const vuint<W> index = reverse_bits(laine_karras(reversed_index, s));
    return unit_float(reverse_bits(laine_karras(index, s * vuint<W>(0x85ebca6bu))));
  }
};

}  // namespace primray
