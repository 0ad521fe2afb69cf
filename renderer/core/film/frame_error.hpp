// Error of a film's image, from its two replicates: relMSE, the mean over pixels and colours of (I - R)^2 / (R^2 + 0.01) with I
// the image and R the reference, MSE, and the uncertainty of both.
//
// With a and b the replicates' means, d = (a - b) / 2 is distributed like the image's error, so d^2 estimates (I - R)^2 without
// bias. The weight 1 / (R^2 + 0.01) is the difficulty: computed from I it is small wherever a rare bright sample made both I
// and d large, and a fifth of the error is missed. See frame_error.cpp for the method used instead.
#pragma once

#include <array>
#include <vector>

#include "film/film.hpp"

namespace primray {

constexpr double kDarkest = 0.01;  // relMSE's denominator is R^2 + this

struct FrameError {
  int64_t values = 0;  // pixels times colours that count
  // Sums over them: of relMSE with the weight from each pixel alone, from similar pixels, and the geometric mean of both.
  double relative_alone = 0, relative_alike = 0, relative = 0;
  double relative_plain = 0;     // like `relative`, but with weights at the best guess of R instead of averaged over its range
  double relative_variance = 0;  // of (the true sum - `relative`), given the weights
  double squared = 0, squared_variance = 0;
  std::vector<double> tiles;  // share of `relative` in each tile of the rows that were evaluated
  std::vector<float> pixels;  // the same of each pixel, if asked for
};

// Weights of a mix of lights: for each light path expression of the film, what is added of its light to the image.
using MixWeights = std::vector<std::array<double, Film::kColors>>;

// Colours are multiplied by `exposure`. About `most_pixels` are evaluated at most, in rows of tiles spread evenly over the
// image. Rows are distributed over `threads`; the result does not depend on their number. `mix`: the error is that of the image
// with that light added; its differences of replicates add up with their signs, so that all covariances are included.
// `by_pixel`: also the pixels' shares, which take 4 bytes each.
FrameError frame_error(const Film& film, double exposure, int64_t most_pixels, int threads, const MixWeights& mix = {},
                       bool by_pixel = false);

}  // namespace primray
