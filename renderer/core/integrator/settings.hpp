// What a user may ask of the integrator; never a compile-time feature.
#pragma once

#include <cstdint>

namespace primray {

struct IntegratorSettings {
  int samples = 64;            // per pixel, over all replicates
  int max_depth = 1 << 20;     // surface scatterings; roulette ends paths long before
  int threads = 1;
  uint32_t seed = 0;
};

// Independent randomised halves of every pixel's samples, so that the variance of the mean can be measured.
constexpr int kReplicates = 2;
// Samples of one replicate that one task takes of a tile: sums are grouped by it, so it is part of what decides bits.
constexpr int kBlock = 16;
constexpr int kTile = 16;  // pixels across
// Scatterings before roulette may end a path.
constexpr int kRouletteStart = 4;

}  // namespace primray
