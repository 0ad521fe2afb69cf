// Construction of a TextureImage's kept levels from pixels: each level is half of the one before, box-filtered with exact
// areas.
#pragma once

#include <functional>
#include <span>

#include "texture/texture.hpp"

namespace primray {

// `pixels`: (height, width, channels) linear floats, finite, first row at the top. Every channel is averaged separately,
// including alpha: UsdUVTexture's outputs are independent of one another (colours are straight, and may be read without alpha).
// Creates levels from `first_level` (0: all of the image) to that of a single texel; or that one level alone.
TextureImage make_image(std::span<const float> pixels, int width, int height, int channels, int first_level, bool one_level);

// Sets mean, range, and the smallest format that holds the values, for as many channels as the image has.
void measure(std::span<const float> pixels, TextureImage& image);

// Makes levels 0 to `last`, each of the one before, and calls see(level, texels, width, height); the first row is at the top.
void for_levels(std::span<const float> pixels, int width, int height, int channels, int last,
                const std::function<void(int, std::span<const float>, int, int)>& see);

// Stores values as kHalf, or as kUnorm16.
void store_halves(std::span<const float> from, uint16_t* to);
void store_unorms(std::span<const float> from, uint16_t* to);

// Number of the level that is a single texel.
int last_level_of(int width, int height);

}  // namespace primray
