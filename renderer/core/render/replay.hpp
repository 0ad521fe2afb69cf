// Replay of a render's recorded rays for benchmarks: in order through Embree alone, the upper bound; and moving rays through
// the scene as it is traced and through a plain Embree scene.
#pragma once

#include "accel/bare_world.hpp"
#include "base/flush_denormals.hpp"
#include "integrator/rays/ray_recorder.hpp"
#include "ray/ray.hpp"
#include "scene/scene.hpp"

namespace primray {

// Traces a render's recorded rays again, in order, in Embree alone: the upper bound that the benchmark compares with.

// Seconds of one thread for all recorded calls, each traced in its mode; if the render did not use Embree, all as packets or
// all one by one, whichever is faster.
double replay(const Scene& scene, const RayRecorder& recorder, int lanes);

// Reads the rays of a recorded call from 9 W floats, as arguments of a kernel.
template <int W>
Rays<W> rays_of(const float* p) {
  const auto field = [&](int f) { return load<W>(p + f * W); };
  return {{field(0), field(1), field(2)}, {field(3), field(4), field(5)}, field(6), field(7), field(8)};
}

template <int W>
vbool<W> active_of(uint32_t mask) {
  vint<W> lanes;
  for (int i = 0; i < W; ++i) lanes.set(i, -int32_t(mask >> i & 1));
  return vbool<W>(lanes.v);
}

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
ReplaySeconds replay_interleaved(const Scene& scene, const BareWorld& world, const RayRecorder& recorder, const ReplayOf& of);

// Number of such rays, and of those that hit something in only one of both or at distances that differ by more than 1e-3.
struct ReplayAgreement {
  uint64_t rays = 0, apart = 0;
};
ReplayAgreement replay_agreement(const Scene& scene, const BareWorld& world, const RayRecorder& recorder, const ReplayOf& of);

}  // namespace primray
