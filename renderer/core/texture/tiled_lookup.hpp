// Texture lookup in lanes of images whose levels are read by tile (tiles.hpp): the same values as those of images held whole.
#pragma once

#include "texture/lookup.hpp"
#include "texture/tiles.hpp"

namespace primray {

// Reads texels by tile, for the lanes `wanted`; the others have any values.
template <int C, int W>
struct TiledTexels {
  const TextureImage& image;
  vbool<W> wanted;

  PRIMRAY_INLINE void quad(vint<W> level, vint<W>, const AxisTexels<W>& x, const AxisTexels<W>& y, Texels<C, W> (&r)[4]) const {
    using I = vint<W>;
    using Tiles = TextureTiles;
    constexpr int kLog2Texels = 2 * Tiles::kLog2Edge;
    const Tiles& tiles = *image.tiles;
    const I first = gather<W>(tiles.layout().first, level), across = gather<W>(tiles.layout().across, level);
    const I column = gather<W>(tiles.layout().column, level), inner(Tiles::kEdge - 1);
    const I across0 = x.i0 >> Tiles::kLog2Edge, across1 = x.i1 >> Tiles::kLog2Edge;
    const I up0 = first + (y.i0 >> Tiles::kLog2Edge) * across, up1 = first + (y.i1 >> Tiles::kLog2Edge) * across;
    const I in_x0 = (x.i0 & inner) + column, in_x1 = (x.i1 & inner) + column;
    const I in_y0 = (y.i0 & inner) << Tiles::kLog2Edge, in_y1 = (y.i1 & inner) << Tiles::kLog2Edge;
    const I tile[4] = {up0 + across0, up0 + across1, up1 + across0, up1 + across1};
    const I in_tile[4] = {in_y0 + in_x0, in_y0 + in_x1, in_y1 + in_x0, in_y1 + in_x1};

    // Copy texels between two looks at the states of their tiles
    const bool one = !any(wanted & (tile[0] != tile[3]));
    const int count = one ? 1 : 4;
    const I kept(Tiles::kResident | Tiles::kUsed);
    I before[4];
    vbool<W> good(true);
    for (int k = 0; k < count; ++k) {
      before[k] = gather<W>(tiles.states(), tile[k]);
      good &= (before[k] & (kept | I(Tiles::kBusy))) == kept;
    }
    __asm__ volatile("" ::: "memory");  // loads stay in this order, which x86 keeps
    for (int k = 0; k < 4; ++k) {
      const I at = ((tile[k] << kLog2Texels) + in_tile[k]) * I(C);
      r[k] =
          fetch<C>(image.format, static_cast<const float*>(tiles.texels()), static_cast<const uint16_t*>(tiles.texels()), at);
    }
    __asm__ volatile("" ::: "memory");
    for (int k = 0; k < count; ++k) good &= gather<W>(tiles.states(), tile[k]) == before[k];

    // Read the tiles that other lanes miss, in place
    for (uint32_t left = bits(wanted & !good); left != 0; left &= left - 1) {
      const int lane = __builtin_ctz(left);
      for (int k = 0; k < 4; ++k) put_texel(tile[k][lane], in_tile[k][lane], lane, r[k]);
    }
  }

  PRIMRAY_RARE void put_texel(int32_t tile, int32_t texel, int lane, Texels<C, W>& r) const {
    uint16_t small[C + 2] = {};
    float large[C] = {};
    const int32_t bytes = C * image.channel_bytes();
    image.tiles->copy(tile, texel * bytes, bytes, image.format == TexelFormat::kFloat ? static_cast<void*>(large) : small);
    const Texels<C, 1> one = fetch<C>(image.format, large, small, vint<1>(0));
    for (int c = 0; c < C; ++c) r.c[c].set(lane, one.c[c][0]);
  }
};

// Looks up an image that is read by tile, in the lanes `active`.
template <int C, int W>
PRIMRAY_INLINE Texels<C, W> lookup_tiled(const TextureImage& image, vbool<W> active, Wrap wrap_s, Wrap wrap_t, vfloat<W> s,
                                         vfloat<W> t, vfloat<W> level) {
  return filtered<C>(TiledTexels<C, W>{image, active}, wrap_s, wrap_t, s, t, level);
}

}  // namespace primray
