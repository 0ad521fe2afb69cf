// See replay.hpp.
#include "integrator/replay.hpp"

#include <xmmintrin.h>

#include <chrono>
#include <utility>

namespace primray {
namespace {

template <int W>
double replay_lanes(const Scene& scene, const RayRecorder& recorder) {
  float sink = 0;
  const auto start = std::chrono::steady_clock::now();
  for (const RayRecorder::Call& call : recorder.calls) {
    const float* p = &recorder.rays[call.first];
    const auto next = [&] { return load<W>(std::exchange(p, p + W)); };
    Rays<W> r;
    r.o.x = next(), r.o.y = next(), r.o.z = next(), r.d.x = next(), r.d.y = next(), r.d.z = next(), r.tnear = next(),
    r.tfar = next(), r.time = next();
    vint<W> lanes;
    for (int i = 0; i < W; ++i) lanes.set(i, -int32_t(call.active >> i & 1));
    const vbool<W> active(lanes.v);
    if (call.shadow) {
      sink += float(bits(call.packet ? occluded_packet(scene.accel(), active, r) : occluded_single(scene.accel(), active, r)));
    } else {
      sink += (call.packet ? intersect_packet(scene.accel(), active, r) : intersect_single(scene.accel(), active, r)).t[0];
    }
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  // A sum that is used, so that no call can be left out.
  return seconds + 0 * double(sink < 0);
}

}  // namespace

double replay(const Scene& scene, const RayRecorder& recorder, int lanes) {
  const unsigned mode = _mm_getcsr();
  _mm_setcsr(mode | 0x8040);
  double s = -1;
  if (lanes == 1) s = replay_lanes<1>(scene, recorder);
  if (lanes == 4) s = replay_lanes<4>(scene, recorder);
  if (lanes == 8) s = replay_lanes<8>(scene, recorder);
  if (lanes == 16) s = replay_lanes<16>(scene, recorder);
  _mm_setcsr(mode);
  return s;
}

}  // namespace primray
