// See replay.hpp.
#include "render/replay.hpp"

#include <xmmintrin.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "accel/build.hpp"

namespace primray {
namespace {

enum class Entry { kAsRecorded, kPacket, kSingle };

template <int W>
double replay_lanes(rtc::Scene world, const RayRecorder& recorder, Entry entry) {
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
    const bool packet = entry == Entry::kAsRecorded ? call.packet : entry == Entry::kPacket;
    if (call.shadow) {
      sink += float(bits(packet ? occluded_packet(world, active, r) : occluded_single(world, active, r)));
    } else {
      sink += (packet ? intersect_packet(world, active, r) : intersect_single(world, active, r)).t[0];
    }
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  // A sum that is used, so that no call can be left out.
  return seconds + 0 * double(sink < 0);
}

}  // namespace

double replay(const Scene& scene, const RayRecorder& recorder, int lanes) {
  const EmbreeWorld world(scene);
  const unsigned mode = _mm_getcsr();
  _mm_setcsr(mode | 0x8040);
  const auto seconds = [&](Entry entry) {
    if (lanes == 1) return replay_lanes<1>(world.get(), recorder, entry);
    if (lanes == 4) return replay_lanes<4>(world.get(), recorder, entry);
    if (lanes == 8) return replay_lanes<8>(world.get(), recorder, entry);
    if (lanes == 16) return replay_lanes<16>(world.get(), recorder, entry);
    return -1.0;
  };
  const double s = world.apart() ? std::min(seconds(Entry::kPacket), seconds(Entry::kSingle)) : seconds(Entry::kAsRecorded);
  _mm_setcsr(mode);
  return s;
}

}  // namespace primray
