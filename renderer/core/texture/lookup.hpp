// Texture lookup in lanes: bilinear within a level, linear between two. (0, 0) is the image's lower left corner.
//
// Texel centres give exactly the stored value. Filtering at the border follows the wrap: the other side (repeat), or the border
// itself. Black is sharp: like clamp inside [0, 1], zero outside. (A border of black texels, as in graphics hardware, would
// darken the edge of every texture that just fills its surface, the more the coarser the level.)
#pragma once

#include "math/lane_checks.hpp"
#include "texture/texture.hpp"

namespace primray {

// Order of shading.Wrap in scene_upload.
enum class Wrap : int32_t { kBlack, kClamp, kRepeat, kMirror };

// Channels of W texels.
template <int C, int W>
struct Texels {
  vfloat<W> c[C];
};

// base[index] in the low half of each lane, base[index + 1] in the high half.
template <int W>
PRIMRAY_INLINE vint<W> gather_pairs(const uint16_t* base, vint<W> index) {
#if PRIMRAY_GATHER_16
  if constexpr (W == 16) return (typename vint<W>::Raw)_mm512_i32gather_epi32((__m512i)index.v, base, 2);
#endif
#if PRIMRAY_GATHER_8
  if constexpr (W == 8) return (typename vint<W>::Raw)_mm256_i32gather_epi32((const int*)base, (__m256i)index.v, 2);
#endif
  vint<W> r;
  for (int i = 0; i < W; ++i) {
    int32_t pair;
    std::memcpy(&pair, base + index[i], sizeof pair);
    r.set(i, pair);
  }
  return r;
}

// Texels of a format whose first channel is at `at`, in floats or in pairs of bytes.
template <int C, int W>
PRIMRAY_INLINE Texels<C, W> fetch(TexelFormat format, const float* large, const uint16_t* base, vint<W> at) {
  Texels<C, W> r;
  if (format == TexelFormat::kFloat) {
    for (int c = 0; c < C; ++c) r.c[c] = gather<W>(large + c, at);
    return r;
  }
  const vint<W> low(0xffff);
  vint<W> code[C];
  if constexpr (C == 3) {
    const TwoLanes<int32_t, W> words = gather_words<W, int(sizeof(uint16_t))>(base, at);
    code[0] = words.x & low, code[1] = (words.x >> 16) & low, code[2] = words.y & low;
  } else {
    const vint<W> pair = gather_pairs<W>(base, at);
    for (int c = 0; c < C; ++c) code[c] = (pair >> (16 * c)) & low;
  }
  const bool half = format == TexelFormat::kHalf;
  for (int c = 0; c < C; ++c) r.c[c] = half ? float_from_half(code[c]) : to_float(code[c]) / vfloat<W>(65535.0f);
  return r;
}

// Wraps a coordinate into [0, 1]; `inside` stays true in the lanes that show the image there.
template <int W>
PRIMRAY_INLINE vfloat<W> wrap_coordinate(Wrap wrap, vfloat<W> s, vbool<W>& inside) {
  using F = vfloat<W>;
  if (wrap == Wrap::kBlack) inside &= (s >= F(0.0f)) & (s <= F(1.0f));
  if (wrap == Wrap::kBlack || wrap == Wrap::kClamp) return clamp(s, 0.0f, 1.0f);
  // Beyond 2^23 a float has no fraction; NaN becomes a number here.
  const F x = clamp(s, -0x1p23f, 0x1p23f);
  if (wrap == Wrap::kRepeat) return x - to_float(floor_to_int(x));
  const F two = x - 2.0f * to_float(floor_to_int(x * 0.5f));
  return select(two > F(1.0f), 2.0f - two, two);
}

// The two texels of one axis on either side of a coordinate in [0, 1], and the weight of the second.
template <int W>
struct AxisTexels {
  vint<W> i0, i1;
  vfloat<W> f;
  PRIMRAY_INLINE AxisTexels(Wrap wrap, vfloat<W> s, vint<W> size) {
    const vfloat<W> x = s * to_float(size) - 0.5f;
    const vint<W> i = floor_to_int(x), zero(0), last = size - vint<W>(1);
    f = x - to_float(i);
    i0 = select(i < zero, wrap == Wrap::kRepeat ? last : zero, i);
    i1 = select(i >= last, wrap == Wrap::kRepeat ? zero : last, i + vint<W>(1));
  }
};

// Reads texels of an image that is held whole.
template <int C, int W>
struct WholeTexels {
  const TextureImage& image;

  PRIMRAY_INLINE Texels<C, W> fetch(vint<W> at) const {
    PRIMRAY_ASSERT(
        are_rows(at + vint<W>(C - 1), image.format == TexelFormat::kFloat ? image.large.size() : image.small.size()));
    return primray::fetch<C>(image.format, image.large.data(), image.small.data(), at);
  }
  // Texels (x0, y0), (x1, y0), (x0, y1) and (x1, y1) of the lanes' levels.
  PRIMRAY_INLINE void quad(vint<W> level, vint<W> width, const AxisTexels<W>& x, const AxisTexels<W>& y,
                           Texels<C, W> (&r)[4]) const {
    const vint<W> offset = gather<W>(image.level_offset, level);
    const auto at = [&](vint<W> row, vint<W> column) { return fetch(offset + (row * width + column) * vint<W>(C)); };
    r[0] = at(y.i0, x.i0), r[1] = at(y.i0, x.i1), r[2] = at(y.i1, x.i0), r[3] = at(y.i1, x.i1);
  }
};

template <int C, int W, class Source>
PRIMRAY_INLINE Texels<C, W> bilinear(const Source& source, Wrap wrap_s, Wrap wrap_t, vfloat<W> s, vfloat<W> t, vint<W> level) {
  const TextureImage& image = source.image;
  const vint<W> width = gather<W>(image.level_width, level), height = gather<W>(image.level_height, level);
  const AxisTexels<W> x(wrap_s, s, width), y(wrap_t, t, height);
  Texels<C, W> q[4], r;
  source.quad(level, width, x, y, q);
  for (int k = 0; k < C; ++k) {
    const vfloat<W> lower = q[0].c[k] + (q[1].c[k] - q[0].c[k]) * x.f, upper = q[2].c[k] + (q[3].c[k] - q[2].c[k]) * x.f;
    r.c[k] = lower + (upper - lower) * y.f;
  }
  return r;
}

// The image of a source at (s, t), averaged over about 2^level of its finest texels in each direction, or at the finest level
// that is kept.
template <int C, int W, class Source>
PRIMRAY_INLINE Texels<C, W> filtered(const Source& source, Wrap wrap_s, Wrap wrap_t, vfloat<W> s, vfloat<W> t,
                                     vfloat<W> level) {
  const TextureImage& image = source.image;
  vbool<W> inside(true);
  s = wrap_coordinate(wrap_s, s, inside), t = wrap_coordinate(wrap_t, t, inside);
  level = clamp(level, float(image.first_level), float(image.last_level));
  const vint<W> fine = truncate(level);
  const vfloat<W> between = level - to_float(fine);
  Texels<C, W> r = bilinear<C>(source, wrap_s, wrap_t, s, t, fine);
  if (any(between > vfloat<W>(0.0f))) {
    const Texels<C, W> coarse = bilinear<C>(source, wrap_s, wrap_t, s, t, min(fine + vint<W>(1), vint<W>(image.last_level)));
    for (int k = 0; k < C; ++k) r.c[k] = select(between > vfloat<W>(0.0f), r.c[k] + (coarse.c[k] - r.c[k]) * between, r.c[k]);
  }
  for (int k = 0; k < C; ++k) r.c[k] = select(inside, r.c[k], 0.0f);
  return r;
}

// Looks up an image that is held whole.
template <int C, int W>
PRIMRAY_INLINE Texels<C, W> lookup(const TextureImage& image, Wrap wrap_s, Wrap wrap_t, vfloat<W> s, vfloat<W> t,
                                   vfloat<W> level) {
  return filtered<C>(WholeTexels<C, W>{image}, wrap_s, wrap_t, s, t, level);
}

// log2 of a positive number, the fraction linear between powers of two: at most 0.086 too small, which is invisible in levels.
template <int W>
PRIMRAY_INLINE vfloat<W> coarse_log2(vfloat<W> x) {
  return to_float(bit_cast<vint<W>>(x)) * 0x1p-23f - 127.0f;
}

}  // namespace primray
