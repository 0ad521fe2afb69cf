// Replay of a moving render's recorded rays through the scene as it is traced and through a plain Embree scene, for the
// benchmark of moving rays.
#pragma once

#include "accel/bare_world.hpp"
#include "path/rays/ray_recorder.hpp"
#include "scene/scene.hpp"

namespace primray {

// Packets or single rays: as the render chose for each call, or always the same.
enum class ReplayEntry { kAsRecorded, kPacket, kSingle };

struct ReplayOf {
  bool shadow;  // occlusion rays, or rays that query the nearest hit
  ReplayEntry entry;
  int lanes;
};

// CPU seconds of one thread for all such rays: as the kernels query them, and by plain Embree calls, on rays in Embree's
// layout. Both alternate every few thousand rays, so that disturbances affect both.
struct ReplaySeconds {
  double scene = 0, bare = 0;
};
ReplaySeconds replay_by_turns(const Scene& scene, const BareWorld& world, const RayRecorder& recorder, const ReplayOf& of);

// Number of such rays, and of those that hit something in only one of both or at distances that differ by more than 1e-3.
struct ReplayAgreement {
  uint64_t rays = 0, apart = 0;
};
ReplayAgreement replay_agreement(const Scene& scene, const BareWorld& world, const RayRecorder& recorder, const ReplayOf& of);

}  // namespace primray
