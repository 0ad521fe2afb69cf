// Owen-scrambled Sobol points: a number in [0,1) is a function of (seed, pixel, replicate, index, dimension) and, in quick
// previews, of the number of samples; of nothing else.
//
// Every pair of dimensions takes the first two Sobol dimensions at an index shuffled for that pair, scrambled again: Burley
// 2020, "Practical Hash-based Owen Scrambling", with the hash of Laine and Karras 2011 as improved by Vegdahl 2021 ("Building a
// Better LK Hash"). Dimensions are numbered by bounce and purpose, whatever the scene contains: a feature that is off leaves
// its own unused. The main dimensions of a path (its film point, its directions) are stratified in four dimensions, two pairs
// at a time.
#pragma once

#include "math/lane_checks.hpp"

namespace primray {

// Purpose of a number; each bounce has kPurposes of them, the camera ray counts as bounce 0.
enum class Purpose : uint32_t { kFilm, kLens, kChain, kLobe, kLightPoint, kLightChoice, kRoulette, kEmitter, kCount };
// Purposes of the camera ray that reuse those of scattering at bounce 0, where nothing scatters.
constexpr Purpose kShutterTime = Purpose::kLobe, kColorChannel = Purpose::kRoulette;

// Bit reversal of x: with byte shuffles where available, six instructions instead of two dozen.
#if defined(__AVX2__)
// Reversed nibbles, as low and as high halves of a byte.
alignas(16) constexpr uint8_t kReversedLow[16] = {0x00, 0x80, 0x40, 0xc0, 0x20, 0xa0, 0x60, 0xe0,
                                                  0x10, 0x90, 0x50, 0xd0, 0x30, 0xb0, 0x70, 0xf0};
alignas(16) constexpr uint8_t kReversedHigh[16] = {0x00, 0x08, 0x04, 0x0c, 0x02, 0x0a, 0x06, 0x0e,
                                                   0x01, 0x09, 0x05, 0x0d, 0x03, 0x0b, 0x07, 0x0f};
alignas(16) constexpr uint8_t kByteOrder[16] = {3, 2, 1, 0, 7, 6, 5, 4, 11, 10, 9, 8, 15, 14, 13, 12};

PRIMRAY_INLINE __m128i load_bytes(const uint8_t* p) { return _mm_load_si128(reinterpret_cast<const __m128i*>(p)); }
PRIMRAY_INLINE vuint<8> reverse_bits_by_bytes(vuint<8> x) {
  const __m256i nibble = _mm256_set1_epi8(15), v = (__m256i)x.v;
  const __m256i low = _mm256_shuffle_epi8(_mm256_broadcastsi128_si256(load_bytes(kReversedLow)), _mm256_and_si256(v, nibble));
  const __m256i high = _mm256_shuffle_epi8(_mm256_broadcastsi128_si256(load_bytes(kReversedHigh)),
                                           _mm256_and_si256(_mm256_srli_epi16(v, 4), nibble));
  return (vuint<8>::Raw)_mm256_shuffle_epi8(_mm256_or_si256(low, high), _mm256_broadcastsi128_si256(load_bytes(kByteOrder)));
}
#endif
#if defined(__AVX512BW__)
PRIMRAY_INLINE vuint<16> reverse_bits_by_bytes(vuint<16> x) {
  const __m512i nibble = _mm512_set1_epi8(15), v = (__m512i)x.v;
  const __m512i low = _mm512_shuffle_epi8(_mm512_broadcast_i32x4(load_bytes(kReversedLow)), _mm512_and_si512(v, nibble));
  const __m512i high =
      _mm512_shuffle_epi8(_mm512_broadcast_i32x4(load_bytes(kReversedHigh)), _mm512_and_si512(_mm512_srli_epi16(v, 4), nibble));
  return (vuint<16>::Raw)_mm512_shuffle_epi8(_mm512_or_si512(low, high), _mm512_broadcast_i32x4(load_bytes(kByteOrder)));
}
#endif
template <int W>
PRIMRAY_INLINE vuint<W> reverse_bits(vuint<W> x) {
#if defined(__AVX512BW__)
  if constexpr (W == 16) return reverse_bits_by_bytes(x);
#endif
#if defined(__AVX2__)
  if constexpr (W == 8) return reverse_bits_by_bytes(x);
#endif
  x = ((x >> 1) & vuint<W>(0x55555555u)) | ((x & vuint<W>(0x55555555u)) << 1);
  x = ((x >> 2) & vuint<W>(0x33333333u)) | ((x & vuint<W>(0x33333333u)) << 2);
  x = ((x >> 4) & vuint<W>(0x0f0f0f0fu)) | ((x & vuint<W>(0x0f0f0f0fu)) << 4);
  x = ((x >> 8) & vuint<W>(0x00ff00ffu)) | ((x & vuint<W>(0x00ff00ffu)) << 8);
  return (x >> 16) | (x << 16);
}

// Permutation in which every bit depends on lower bits alone: Owen scrambling of numbers with their bits reversed.
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

// Second Sobol dimension with its bits reversed: Pascal's triangle modulo 2, in five butterfly steps.
template <int W>
PRIMRAY_INLINE vuint<W> sobol_second(vuint<W> x) {
  x = x ^ ((x >> 1) & vuint<W>(0x55555555u));
  x = x ^ ((x >> 2) & vuint<W>(0x33333333u));
  x = x ^ ((x >> 4) & vuint<W>(0x0f0f0f0fu));
  x = x ^ ((x >> 8) & vuint<W>(0x00ff00ffu));
  return x ^ ((x >> 16) & vuint<W>(0x0000ffffu));
}

// Multiplication by w^j, or w^-j, of digit j of x: digits of GF(4), two bits each, lowest first. With w^2 = w + 1, w (b w + a)
// = (a + b) w + b, and w^2 (b w + a) = a w + (a + b): each bit of the result is one of the digit's, or their sum.
template <int W>
PRIMRAY_INLINE vuint<W> scale_digits(vuint<W> x, uint32_t kept) {
  const vuint<W> swapped = ((x >> 1) & vuint<W>(0x55555555u)) | ((x & vuint<W>(0x55555555u)) << 1);
  return (x & vuint<W>(kept)) ^ (swapped & vuint<W>(0x3cf3cf3cu));
}
// Pascal's triangle over GF(4), its entry (i, j) times w^(j - i): the first two Sobol dimensions of an index and of its image
// under this map are together four, of which 4^m points are a (0, m, 4)-net in base 4 (Faure 1982, Niederreiter 1987), while
// each pair is one in base 2 (Ahmed et al. 2024, "SZ Sequences: Binary-Based (0, 2^q)-Sequences").
template <int W>
PRIMRAY_INLINE vuint<W> pascal_of_four(vuint<W> x) {
  x = scale_digits(x, 0xdb6db6dbu);
  x = x ^ ((x >> 2) & vuint<W>(0x33333333u));
  x = x ^ ((x >> 4) & vuint<W>(0x0f0f0f0fu));
  x = x ^ ((x >> 8) & vuint<W>(0x00ff00ffu));
  x = x ^ ((x >> 16) & vuint<W>(0x0000ffffu));
  return scale_digits(x, 0xe79e79e7u);
}

// Spreads the lower 16 bits to even positions.
template <int W>
PRIMRAY_INLINE vuint<W> every_other_bit(vuint<W> x) {
  x = x & vuint<W>(0x0000ffffu);
  x = (x ^ (x << 8)) & vuint<W>(0x00ff00ffu);
  x = (x ^ (x << 4)) & vuint<W>(0x0f0f0f0fu);
  x = (x ^ (x << 2)) & vuint<W>(0x33333333u);
  return (x ^ (x << 1)) & vuint<W>(0x55555555u);
}

template <int W>
struct Pair {
  vfloat<W> u, v;
};

template <int W>
struct Sampler {
  vuint<W> reversed_index;  // bits of the sample's index, lowest first
  vuint<W> seed;            // of (seed, pixel, replicate)

  static PRIMRAY_INLINE vuint<W> pixel_seed(uint32_t seed, vint<W> x, vint<W> y, vuint<W> replicate) {
    return mix(mix(mix(mix(vuint<W>(seed)) + bit_cast<vuint<W>>(x)) ^ (bit_cast<vuint<W>>(y) << 1)) + replicate);
  }
  // Sampler of sample `index` of a pixel. With a `screen_block`, a power of two above all indices, one sequence traverses the
  // screen in Morton order and gives that many points to each pixel: any square of 2^k x 2^k pixels at multiples of 2^k has a
  // net, so errors of neighbours compensate each other (Ahmed and Wonka 2020, "Screen-Space Blue-Noise Diffusion of Monte Carlo
  // Sampling Error via Hierarchical Ordering of Pixels"). 0: every pixel has an independent sequence.
  static PRIMRAY_INLINE Sampler of(uint32_t seed, vint<W> x, vint<W> y, vuint<W> replicate, vuint<W> index, int screen_block) {
    if (screen_block == 0) return {reverse_bits(index), pixel_seed(seed, x, y, replicate)};
    const vuint<W> place = every_other_bit(bit_cast<vuint<W>>(x)) | (every_other_bit(bit_cast<vuint<W>>(y)) << 1);
    const vint<W> none(0);
    return {reverse_bits(place * vuint<W>(uint32_t(screen_block)) + index), pixel_seed(seed, none, none, replicate)};
  }

  PRIMRAY_INLINE vuint<W> dimension_seed(vint<W> bounce, Purpose purpose) const {
    PRIMRAY_ASSERT(purpose < Purpose::kCount);
    const vuint<W> dimension = bit_cast<vuint<W>>(bounce) * vuint<W>(uint32_t(Purpose::kCount)) + vuint<W>(uint32_t(purpose));
    return mix(seed ^ (dimension * vuint<W>(0x9e3779b9u)));
  }
  PRIMRAY_INLINE Pair<W> pair(vint<W> bounce, Purpose purpose) const {
    const vuint<W> s = dimension_seed(bounce, purpose);
    return scrambled(reverse_bits(laine_karras(reversed_index, s)), s);
  }
  // Links of a chain of pairs, numbered from 0: links 2k and 2k + 1 are four dimensions of one point.
  PRIMRAY_INLINE Pair<W> link(vint<W> number) const {
    const vuint<W> s = dimension_seed(number >> 1, Purpose::kChain);
    const vuint<W> index = reverse_bits(laine_karras(reversed_index, s));
    const vbool<W> second = (number & vint<W>(1)) != vint<W>(0);
    return scrambled(select(second, pascal_of_four(index), index), select(second, (s ^ (s >> 15)) * vuint<W>(0x2c1b3c6du), s));
  }
  // All 32 bits of a number.
  PRIMRAY_INLINE vuint<W> bits_of(vint<W> bounce, Purpose purpose) const {
    const vuint<W> s = dimension_seed(bounce, purpose);
    const vuint<W> index = reverse_bits(laine_karras(reversed_index, s));
    return reverse_bits(laine_karras(index, s * vuint<W>(0x85ebca6bu)));
  }
  // The shuffled index read as a fraction: one number in each interval, all at the same offset within it, which does not matter
  // for a choice among few outcomes.
  PRIMRAY_INLINE vfloat<W> single(vint<W> bounce, Purpose purpose) const {
    return unit_float(laine_karras(reversed_index, dimension_seed(bounce, purpose)));
  }

 private:
  static PRIMRAY_INLINE Pair<W> scrambled(vuint<W> index, vuint<W> s) {
    const vuint<W> a = laine_karras(index, s * vuint<W>(0x85ebca6bu)),
                   b = laine_karras(sobol_second(index), s * vuint<W>(0xc2b2ae35u));
    return {unit_float(reverse_bits(a)), unit_float(reverse_bits(b))};
  }
};

}  // namespace primray
