// What covers each pixel, and by how much: which surfaces the camera rays of a film's own samples meet first.
//
// The same rays as the picture's, by the same numbers: through lens, filter and time. Shares are whole numbers of the film's
// units, so that sums do not depend on their order, nor on how samples are divided.
#pragma once

#include <cstdint>
#include <vector>

#include "film/film.hpp"

namespace primray {

// A surface as the core numbers it (see FirstHitPlanes), and what it covers of a pixel's samples, in units of
// 1 / Film::kCovered.
struct Covering {
  int32_t shape, surface, instance, outer;
  int64_t share;
};

// How the samples of a film were drawn, and what covers its pixels.
struct CoveragePlanes {
  uint32_t seed = 0;
  int screen_block = 0, first_link = 0;
  // Filled by bands of whole tiles.
  std::vector<uint32_t> first, end;             // samples of each replicate and tile, as Film::next has them
  std::vector<std::vector<Covering>> by_pixel;  // rows from the top; empty: not wanted
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
