// What a pass of the integrator is given: settings, and the guides, logs and light path expressions that it reads or fills.
#pragma once

#include <atomic>
#include <cstdint>
#include <limits>

namespace primray {

struct CausticGuide;
struct Guide;
struct GuideLog;
struct LpeAutomaton;
struct PathLog;

// Asks whoever learns something before a render to end.
struct Cancellation {
  std::atomic<bool> asked{false};
};

struct IntegratorSettings {
  int max_depth = 1 << 20;  // surface scattering events; Russian roulette ends paths long before
  int threads = 1;
  uint32_t seed = 0;
  int splits = 0;         // 1, 2, 4 or 8 paths from the first surface that is neither mirror nor smooth glass; 0: to be chosen
  int light_samples = 1;  // 1, 2 or 4 light samples there
  // Number of samples of each replicate and pixel that are points of one sequence over the screen, which makes the noise look
  // finer; a power of two. 0: pixels have independent sequences, of any length.
  int screen_block = 0;
  const Guide* guide = nullptr;            // guide for scattered rays, beside the BSDF
  GuideLog* guide_log = nullptr;           // records of paths that learn a guide
  const CausticGuide* caustics = nullptr;  // guide of scattered rays towards metal and glass
  const LpeAutomaton* lpe = nullptr;       // light path expressions of the film
  // Upper limit of the largest channel of a sample's indirect light (two scattering events and more); infinite: none. Pilots
  // and guides have no limit, so a clamp changes no path.
  float clamp_indirect = std::numeric_limits<float>::infinity();
  PathLog* path_log = nullptr;  // events of all paths, with one lane
  // Set while something is learnt before a render: the learning ends soon, and its result is not to be used.
  const std::atomic<bool>* cancel = nullptr;

  bool clamps() const { return clamp_indirect < std::numeric_limits<float>::infinity(); }
  bool is_cancelled() const { return cancel && cancel->load(std::memory_order_relaxed); }
};

constexpr int kMostLightSamples = 4;
// Samples of one replicate that a task takes of a tile; no bit of the image depends on it.
constexpr int kBlock = 16;

}  // namespace primray
