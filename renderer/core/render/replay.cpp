// Replay of recorded rays, for benchmarks.

#include <time.h>
#include <algorithm>
#include <chrono>
#include <cmath>

#include "accel/bare_world.hpp"
#include "accel/build.hpp"
#include "accel/query.hpp"
#include "base/error.hpp"
#include "render/replay.hpp"

namespace primray {

namespace {

enum class Entry { kAsRecorded, kPacket, kSingle };

template <int W>
double replay_lanes(const Scene& scene, rtc::Scene world, const RayRecorder& recorder, Entry entry) {
  float sink = 0;
  const auto start = std::chrono::steady_clock::now();
  for (const RayRecorder::Call& call : recorder.calls) {
    const Rays<W> r = rays_of<W>(&recorder.rays[call.first]);
    const vbool<W> active = active_of<W>(call.active);
    const bool packet = entry == Entry::kAsRecorded ? call.packet : entry == Entry::kPacket;
    if (scene.curve_accel()) {
      sink += call.shadow ? float(bits(occluded(scene, packet, active, r))) : intersect(scene, packet, active, r).t[0];
    } else if (call.shadow) {
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
    if (lanes == 1) return replay_lanes<1>(scene, world.get(), recorder, entry);
    if (lanes == 4) return replay_lanes<4>(scene, world.get(), recorder, entry);
    if (lanes == 8) return replay_lanes<8>(scene, world.get(), recorder, entry);
    if (lanes == 16) return replay_lanes<16>(scene, world.get(), recorder, entry);
    return -1.0;
  };
  return world.apart() ? std::min(seconds(Entry::kPacket), seconds(Entry::kSingle)) : seconds(Entry::kAsRecorded);
}

namespace {

// CPU time of this thread, whatever else the machine does.
double cpu_seconds() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

template <int W>
void ask_scene(const Scene& scene, const RayRecorder::Call& call, const float* p, bool packet) {
  const vbool<W> active = active_of<W>(call.active);
  if (call.shadow) {
    keep(occluded(scene, packet, active, rays_of<W>(p)));
  } else {
    keep(intersect(scene, packet, active, rays_of<W>(p)));
  }
}

constexpr size_t kTurn = 1024;  // calls

// Replays calls [first, end); returns their CPU seconds.
template <class Ask>
double seconds_of(const RayRecorder& recorder, const ReplayOf& of, size_t first, size_t end, const Ask& ask) {
  const double start = cpu_seconds();
  for (size_t i = first; i < end; ++i) {
    const RayRecorder::Call& call = recorder.calls[i];
    if (call.shadow != of.shadow) continue;
    ask(call, &recorder.rays[call.first],
        of.entry == ReplayEntry::kAsRecorded ? call.packet : of.entry == ReplayEntry::kPacket);
  }
  return cpu_seconds() - start;
}

// Calls f.operator()<W>() for the recording's W.
template <class F>
void with_lanes(int lanes, const F& f) {
  if (lanes == 1) return f.template operator()<1>();
  if (lanes == 4) return f.template operator()<4>();
#if PRIMRAY_MAX_LANES >= 8
  if (lanes == 8) return f.template operator()<8>();
#endif
#if PRIMRAY_MAX_LANES >= 16
  if (lanes == 16) return f.template operator()<16>();
#endif
  throw Error("internal", "this build has no kernel for this number of lanes");
}

// Whether one ray of a call hits the same in both.
template <int W>
bool same(const Scene& scene, const BareWorld& world, const RayRecorder::Call& call, const float* p, int lane) {
  const float theirs = bare_distance<W>(world, call.shadow, p, lane);
  const vbool<W> active = active_of<W>(1u << lane);
  if (call.shadow) return bits(occluded(scene, false, active, rays_of<W>(p))) == (theirs < 0 ? 1u << lane : 0);
  const float ours = intersect(scene, false, active, rays_of<W>(p)).t[lane];
  return ours == theirs || std::fabs(ours - theirs) < 1e-3f * std::fabs(ours);
}

}  // namespace

ReplaySeconds replay_interleaved(const Scene& scene, const BareWorld& world, const RayRecorder& recorder, const ReplayOf& of) {
  const FlushDenormals flush;
  ReplaySeconds found;
  with_lanes(of.lanes, [&]<int W>() {
    const auto ours = [&](const RayRecorder::Call& call, const float* p, bool packet) { ask_scene<W>(scene, call, p, packet); };
    const auto bare = [&](const RayRecorder::Call& call, const float* p, bool packet) {
      ask_bare<W>(world, call.shadow, call.active, p, packet);
    };
    const size_t count = recorder.calls.size();
    for (size_t first = 0; first < count; first += kTurn) {
      const size_t end = std::min(first + kTurn, count);
      const bool odd = first / kTurn & 1;
      if (odd) found.bare += seconds_of(recorder, of, first, end, bare);
      found.scene += seconds_of(recorder, of, first, end, ours);
      if (!odd) found.bare += seconds_of(recorder, of, first, end, bare);
    }
  });
  return found;
}

ReplayAgreement replay_agreement(const Scene& scene, const BareWorld& world, const RayRecorder& recorder, const ReplayOf& of) {
  const FlushDenormals flush;
  ReplayAgreement found;
  with_lanes(of.lanes, [&]<int W>() {
    seconds_of(recorder, of, 0, recorder.calls.size(), [&](const RayRecorder::Call& call, const float* p, bool) {
      for (uint32_t m = call.active; m; m &= m - 1, ++found.rays) {
        const int lane = __builtin_ctz(m);
        found.apart += !same<W>(scene, world, call, p, lane);
      }
    });
  });
  return found;
}

}  // namespace primray
