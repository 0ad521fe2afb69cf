// Grids as Python hands them over.
#pragma once

#include "base/error.hpp"
#include "bindings/arrays.hpp"
#include "volume/grid_table.hpp"

namespace primray {

// Arrays of a grid, which the input refers to: of leaves (leaves, 512, channels) and of tiles (tiles, channels). Both are
// float32, or both are float16 as uint16.
struct GridArrays {
  InArray<int32_t> leaf_origins, tiles;
  InArray<uint16_t> halves, tile_halves;
  InArray<float> floats, tile_floats;
  GridInput input;

  GridArrays(InArray<int32_t> origins, nb::object values, InArray<int32_t> tile_places, nb::object tile_values, int channels)
      : leaf_origins(std::move(origins)), tiles(std::move(tile_places)) {
    if (channels != 1 && channels != 3) throw Error("internal", "a grid has one channel or three");
    input.channels = channels, input.leaf_origins = span_of(leaf_origins), input.tiles = span_of(tiles);
    input.is_half = nb::try_cast(values, halves, false) && nb::try_cast(tile_values, tile_halves, false);
    if (input.is_half) {
      input.halves = {span_of(halves), span_of(tile_halves)};
    } else {
      floats = nb::cast<InArray<float>>(values), tile_floats = nb::cast<InArray<float>>(tile_values);
      input.floats = {span_of(floats), span_of(tile_floats)};
    }
  }
};

}  // namespace primray
