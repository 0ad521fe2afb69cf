// Coverage of each pixel by surface: the surfaces that camera rays of the film's own samples hit first, and their shares.
//
// The rays are those of the image, with the same random numbers: through lens, filter and time. Shares are integers in the
// film's units, so that sums depend neither on their order nor on how samples are divided.
#pragma once

#include <cstdint>
#include <vector>

#include "film/film.hpp"

namespace primray {

// A surface as the core numbers it (see FirstHitPlanes), and its share of a pixel's samples, in units of 1 / Film::kCovered.
struct Covering {
  int32_t shape, surface, instance, outer;
  int64_t share;
};

// Sample ranges of a film, and the coverage of its pixels.
struct CoveragePlanes {
  uint32_t seed = 0;
  int screen_block = 0, first_link = 0;
  // Filled in bands of whole tiles.
  std::vector<uint32_t> first, end;             // samples of each replicate and tile, as in Film::next
  std::vector<std::vector<Covering>> by_pixel;  // rows from the top; empty: not requested
};

inline void add_covering(std::vector<Covering>& covering, const Covering& one) {
  for (Covering& other : covering)
    if (other.shape == one.shape && other.surface == one.surface && other.instance == one.instance &&
        other.outer == one.outer) {
      other.share += one.share;
      return;
    }
  covering.push_back(one);
}

}  // namespace primray
