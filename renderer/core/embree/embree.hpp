// Embree, loaded once: its entry points, its device, and owners for its scenes.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "embree/embree_abi.hpp"

namespace primray {

// Limits Embree's memory over all scenes of the process: builds that would exceed `bytes` end with Error("out-of-memory").
void limit_embree_memory(int64_t bytes);

// Opens the library at `path` and a device pinned to this module's ISA class. Throws Error("embree", ...) if it is missing, not
// 4.4.0 or of another build. Later calls do nothing.
void load_embree(const std::string& path);

// Both require load_embree().
const rtc::Api& embree();
rtc::Device embree_device();

// Current and peak bytes of Embree, over all scenes of the process.
struct EmbreeMemory {
  int64_t now, peak;
};
EmbreeMemory embree_memory();

// Throws Error("embree" or "out-of-memory") for an error on this thread since the last call.
void check_embree();

struct ReleaseScene {
  void operator()(rtc::Scene s) const { embree().rtcReleaseScene(s); }
};
struct ReleaseGeometry {
  void operator()(rtc::Geometry g) const { embree().rtcReleaseGeometry(g); }
};
using OwnedScene = std::unique_ptr<rtc::SceneHandle, ReleaseScene>;
using OwnedGeometry = std::unique_ptr<rtc::GeometryHandle, ReleaseGeometry>;

}  // namespace primray
