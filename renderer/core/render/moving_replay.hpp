// A moving render's recorded rays, through the scene as it is traced and through an Embree world made for nothing else: what
// the benchmark of moving rays compares.
#pragma once

#include "accel/bare_world.hpp"
#include "path/rays/ray_recorder.hpp"
#include "scene/scene.hpp"

namespace primray {

// Packets or single rays: as the render chose for each call, or all one way.
enum class ReplayEntry { kAsRecorded, kPacket, kSingle };

struct ReplayOf {
  bool shadow;  // rays that ask whether they are blocked, or those that ask for the nearest hit
  ReplayEntry entry;
  int lanes;
};

// CPU seconds of one thread for all such rays: as the kernels ask, and by calls of Embree alone, on rays laid out as it wants.
// They take turns every few thousand rays, so that what else the machine does falls on both.
struct ReplaySeconds {
  double scene = 0, bare = 0;
};
ReplaySeconds replay_by_turns(const Scene& scene, const BareWorld& world, const RayRecorder& recorder, const ReplayOf& of);

// How many such rays there are, and how many meet something in one of both alone or at distances more than 1e-3 of themselves
// apart.
struct ReplayAgreement {
  uint64_t rays = 0, apart = 0;
};
ReplayAgreement replay_agreement(const Scene& scene, const BareWorld& world, const RayRecorder& recorder, const ReplayOf& of);

}  // namespace primray
