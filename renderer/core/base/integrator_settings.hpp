// What a user may ask of the integrator; never a compile-time feature.
#pragma once

#include <cstdint>

namespace primray {

struct CausticGuide;
struct Guide;
struct GuideLog;

struct IntegratorSettings {
  int max_depth = 1 << 20;  // surface scatterings; roulette ends paths long before
  int threads = 1;
  uint32_t seed = 0;
  int splits = 0;         // 1, 2, 4 or 8 paths that go on from the first surface that is no mirror; 0: to be chosen
  int light_samples = 1;  // 1, 2 or 4 samples of lights there
  // So many samples of each replicate and pixel are points of one sequence over the screen, whose errors look finer; a power of
  // two. 0: pixels have sequences of their own, which any number of samples may follow.
  int screen_block = 0;
  const Guide* guide = nullptr;            // what scattered rays are drawn by, beside the BSDF
  GuideLog* log = nullptr;                 // of paths that learn a guide
  const CausticGuide* caustics = nullptr;  // what scattered rays are drawn by towards metal and glass
};

constexpr int kMostLightSamples = 4;
// Samples of one replicate that one task takes of a tile; no bit of the image depends on it.
constexpr int kBlock = 16;
// Roulette: from this scattering on a path survives with probability min(1, kRouletteKeep * its largest throughput). On the
// Cornell box (relMSE, rays a sample, 64 samples): keep 1 from 4 on 0.00180, 5.2; 2 from 3: 0.00162, 5.1; 4 from 2: 0.00139,
// 5.9; 8 from 3: 0.00134, 6.5; none: 0.00132, 7.6. Of paths split in four, 2 costs the Cornell box as much as 4, and a terrain
// under a sky, where the last rays are cheap, half as much again.
constexpr int kRouletteStart = 2;
constexpr float kRouletteKeep = 4;
// From here on not even a lossless path survives for certain: one that is caught for good between mirrors or by total
// reflection would otherwise never end. What it brings is weighed accordingly. With a share a of light left by each scattering
// the weights' squares add up as long as a^2 is below what is kept: 0.98 left a closed room of albedo 0.998 6 % too dark in any
// render.
constexpr int kRouletteDeep = 1024;
constexpr float kRouletteDeepKeep = 0.999f;

}  // namespace primray
