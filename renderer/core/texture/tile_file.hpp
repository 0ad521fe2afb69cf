// Files of tiles, which hold the levels of a TextureImage as lookups read them: a header of 4096 bytes, then the tiles in the
// order of TextureTiles::Layout, not compressed. They are read where they were written: numbers have this machine's byte order.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "texture/texture.hpp"
#include "texture/tiles.hpp"

namespace primray {

// Writes levels `first_level` to the last of an image to an open file, of pixels as make_image() takes them. `key` (at most 128
// bytes) says what they were made of. Throws Error where the file cannot be written, as on a full disk.
void write_tile_file(int file, const std::string& key, std::span<const float> pixels, int width, int height, int channels,
                     int first_level);

// Reads size, channels, format and kept levels of the file's image, without texels. Throws Error where the file is another one.
TextureImage tile_file_header(const std::string& path, const std::string& key);

// Opens the file of `key` for an image of which rays read `first_level` and coarser ones, or `first_level` alone (`one_level`).
// Levels are read by tile within the budget of `memory`, or, without it, held whole. Throws Error where the file is another
// one, is damaged, or has not those levels.
TextureImage open_tile_file(const std::string& path, const std::string& key, std::shared_ptr<TileMemory> memory,
                            int first_level, bool one_level);

}  // namespace primray
