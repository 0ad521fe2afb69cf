// How wrong a film's picture is, from its two replicates: relMSE, mean over pixels and colours of (I - R)^2 / (R^2 + 0.01)
// with I the picture and R the truth, MSE, and how well both are known.
//
// With a and b the replicates' means, d = (a - b) / 2 is distributed as the picture's error is, so d^2 estimates (I - R)^2
// without bias. The weight 1 / (R^2 + 0.01) is the difficulty: taken from I it is small wherever a rare bright sample made
// both I and d large, and a fifth of the error goes missing. See frame_error.cpp for what is done instead.
#pragma once

#include <vector>

#include "film/film.hpp"

namespace primray {

constexpr double kDarkest = 0.01;  // relMSE's denominator is R^2 + this

struct FrameError {
  int64_t values = 0;  // pixels times colours that count
  // Sums over them: of relMSE with the weight drawn from each pixel alone, from those like it, and between the two.
  double relative_alone = 0, relative_alike = 0, relative = 0;
  double relative_plain = 0;     // as `relative`, but with weights at the best guess of R instead of over what R may be
  double relative_variance = 0;  // of (the true sum - `relative`), given the weights
  double squared = 0, squared_variance = 0;
  std::vector<double> tiles;  // the part of `relative` in each tile of the rows that were looked at
};

// Colours are multiplied by `exposure`. At most about `most_pixels` are looked at, in rows of tiles spread evenly over the
// picture. Rows are shared among `threads`; the result does not depend on their number.
FrameError frame_error(const Film& film, double exposure, int64_t most_pixels, int threads);

}  // namespace primray
