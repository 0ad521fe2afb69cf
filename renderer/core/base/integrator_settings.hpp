// What a user may ask of the integrator; never a compile-time feature.
#pragma once

#include <cstdint>
#include <limits>

namespace primray {

struct CausticGuide;
struct Guide;
struct GuideLog;
struct RouteTables;

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
  const RouteTables* routes = nullptr;     // light path expressions that the film asks for
  // Bound on the largest channel of what one sample brings over two scatterings and more; infinite: no bound. Pilots and guides
  // have none, so a clamp changes no path.
  float clamp_indirect = std::numeric_limits<float>::infinity();

  bool clamps() const { return clamp_indirect < std::numeric_limits<float>::infinity(); }
};

constexpr int kMostLightSamples = 4;
// Samples of one replicate that one task takes of a tile; no bit of the image depends on it.
constexpr int kBlock = 16;

}  // namespace primray
