// Texture: one image, or a set of UDIM tiles, of which surfaces read one channel or three.
#pragma once

#include <array>

#include "texture/image.hpp"

namespace primray {

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
