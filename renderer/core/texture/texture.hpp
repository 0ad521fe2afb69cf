// Textures: one image, or a set of UDIM tiles, of which surfaces read one channel or three.
//
// This folder: texture.hpp is the data and its formats; mip_pyramid.cpp creates it from pixels; lookup.hpp reads it in lanes.
// tiles.hpp holds images by tile, of the files of tile_file.hpp, and tiled_lookup.hpp reads those. An image has its kept mip
// levels in one array, a texel's channels side by side, the lowest row first. Two bytes per channel where that loses nothing
// significant, otherwise four: kUnorm16 where every value is a multiple of 1/65535 (all that 8 and 16 bits without a transfer
// curve can hold: read back exactly), kHalf where values fit its range (11 significant bits), otherwise kFloat.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "math/lanes.hpp"

namespace primray {

class TextureTiles;

// Formats of texels.
enum class TexelFormat : int32_t { kUnorm16, kHalf, kFloat };

// One image of a texture, with its kept mip levels.
struct TextureImage {
  static constexpr int kMaxLevels = 24;
  int width = 0, height = 0, channels = 1;  // of the finest level of all; 1 or 3 channels
  TexelFormat format = TexelFormat::kFloat;
  int first_level = 0, last_level = 0;  // those that are kept
  // By level, for those kept; the offset of its first texel in channels.
  int32_t level_width[kMaxLevels] = {}, level_height[kMaxLevels] = {}, level_offset[kMaxLevels] = {};
  std::vector<uint16_t> small;                    // kUnorm16, kHalf; padded by one, which gathers may read
  std::vector<float> large;                       // kFloat
  float mean[3] = {}, low[3] = {}, high[3] = {};  // of the finest level of all
  // Set where texels are read by tile: there are none in `small` and `large`, and no offsets of levels.
  std::shared_ptr<TextureTiles> tiles;

  int channel_bytes() const { return format == TexelFormat::kFloat ? int(sizeof(float)) : int(sizeof(uint16_t)); }
  // Bytes of texels that are held whole.
  int64_t memory_bytes() const { return int64_t(small.size() * sizeof(uint16_t) + large.size() * sizeof(float)); }
  // Bytes of the kept levels from this one on, wherever they are.
  int64_t bytes_from(int level) const {
    int64_t texels = 0;
    for (; level <= last_level; ++level) texels += int64_t(level_width[level]) * level_height[level];
    return (texels * channels + 1) * channel_bytes();
  }
};

// Converts 16 bits in the low half of each lane, as IEEE 754 binary16; denormals without denormal arithmetic. No infinities, no
// NaN.
template <int W>
PRIMRAY_INLINE vfloat<W> float_from_half(vint<W> h) {
  const vint<W> magnitude = (h & vint<W>(0x7fff)) << 13;
  const vbool<W> denormal = magnitude < vint<W>(1 << 23);
  const vfloat<W> f = bit_cast<vfloat<W>>(magnitude + select(denormal, vint<W>(113 << 23), vint<W>(112 << 23)));
  const vfloat<W> a = select(denormal, f - 0x1p-14f, f);
  return bit_cast<vfloat<W>>(bit_cast<vint<W>>(a) | ((h & vint<W>(0x8000)) << 16));
}

// 1001 to 1100, ten across: the tile that holds (s, t) is 1001 + floor(s) + 10 floor(t).
constexpr int kFirstTile = 1001, kTileColumns = 10, kTileRows = 10;

struct Texture {
  int channels = 1;          // 1, or 3 for "rgb"
  bool udim = false;         // its tiles do not filter into each other: each clamps at its border
  bool finest_only = false;  // read by cutouts, which know no footprint
  std::vector<TextureImage> images;
  std::array<int32_t, kTileColumns * kTileRows> tiles{};  // index into images, or -1
  // Smallest footprint that any ray can have on it, as an area in (s, t): see build/texture_levels.cpp. Infinite: no geometry
  // uses it.
  float least_footprint = 0;

  Texture() { tiles.fill(-1); }
};

}  // namespace primray
