// Replay of replay.hpp.
#include "render/replay.hpp"

#include <algorithm>
#include <chrono>

#include "accel/build.hpp"
#include "render/recorded_call.hpp"

namespace primray {
namespace {

enum class Entry { kAsRecorded, kPacket, kSingle };

template <int W>
double replay_lanes(rtc::Scene world, const RayRecorder& recorder, Entry entry) {
  float sink = 0;
  const auto start = std::chrono::steady_clock::now();
  for (const RayRecorder::Call& call : recorder.calls) {
    const Rays<W> r = rays_of<W>(&recorder.rays[call.first]);
    const vbool<W> active = active_of<W>(call.active);
    const bool packet = entry == Entry::kAsRecorded ? call.packet : entry == Entry::kPacket;
    if (call.shadow) {
      sink += float(bits(packet ? occluded_packet(world, active, r) : occluded_single(world, active, r)));
    } else {
      sink += (packet ? intersect_packet(world, active, r) : intersect_single(world, active, r)).t[0];
    }
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  // Uses the sum, so that no call can be optimized away.
  return seconds + 0 * double(sink < 0);
}

}  // namespace

double replay(const Scene& scene, const RayRecorder& recorder, int lanes) {
  const EmbreeWorld world(scene);
  const FlushDenormals flush;
  const auto seconds = [&](Entry entry) {
    if (lanes == 1) return replay_lanes<1>(world.get(), recorder, entry);
    if (lanes == 4) return replay_lanes<4>(world.get(), recorder, entry);
    if (lanes == 8) return replay_lanes<8>(world.get(), recorder, entry);
    if (lanes == 16) return replay_lanes<16>(world.get(), recorder, entry);
    return -1.0;
  };
  return world.apart() ? std::min(seconds(Entry::kPacket), seconds(Entry::kSingle)) : seconds(Entry::kAsRecorded);
}

}  // namespace primray
