// Recording of every traced ray (packet or single, nearest hit or occlusion) for the benchmark that replays them.
#pragma once

#include <cstdint>
#include <vector>

#include "accel/trace.hpp"

namespace primray {

struct RayRecorder {
  struct Call {
    bool shadow, packet;
    uint32_t active;
    size_t first;  // offset into `rays`: 9 W floats (origin, direction, tnear, tfar, time, each for W lanes)
    int lanes;
  };
  std::vector<Call> calls;
  std::vector<float> rays;

  template <int W>
  void record(bool shadow, bool packet, vbool<W> active, const Rays<W>& r) {
    calls.push_back({shadow, packet, bits(active), rays.size(), W});
    rays.resize(rays.size() + 9 * W);
    float* p = rays.data() + calls.back().first;
    for (const vfloat<W>* f : {&r.o.x, &r.o.y, &r.o.z, &r.d.x, &r.d.y, &r.d.z, &r.tnear, &r.tfar, &r.time})
      store(p, *f), p += W;
  }
};

}  // namespace primray
