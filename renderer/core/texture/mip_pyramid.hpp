// From pixels to the kept levels of a TextureImage: each level half of the one before, box-filtered with exact areas.
#pragma once

#include <span>

#include "texture/image.hpp"

namespace primray {

// `pixels`: (height, width, channels) linear floats, finite, first row at the top. Every channel is averaged by itself, alpha
// among them: UsdUVTexture's outputs are independent of one another (colours are straight, and may be read without alpha).
// Levels from `first_level` (0: all of the image) to the one of a single texel; or that one level alone.
TextureImage make_image(std::span<const float> pixels, int width, int height, int channels, int first_level, bool one_level);

// Number of the level that is a single texel.
int last_level_of(int width, int height);

}  // namespace primray
