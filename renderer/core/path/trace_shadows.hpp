// The shadow rays that a round of paths has queued: what arrives is added to the slots of their samples.
#pragma once

#include "guide/guide.hpp"
#include "path/ray_streams.hpp"
#include "path/shadow_rays.hpp"
#include "path/tile_task.hpp"

namespace primray {

// Adds `c` to the slots of lanes `m`; most paths bring nothing from most vertices.
template <int W>
PRIMRAY_INLINE void add_to_slots(Worker& w, const IntegratorSettings& settings, vbool<W> m, vint<W> slot, const vvec3<W>& c) {
  const vfloat<W> zero(0.0f);
  for (uint32_t b = bits(m & ((c.x != zero) | (c.y != zero) | (c.z != zero))); b; b &= b - 1) {
    const int i = __builtin_ctz(b), s = slot[i];
    w.r[s] += c.x[i], w.g[s] += c.y[i], w.b[s] += c.z[i];
    if (settings.log) settings.log->add_light(s, c.x[i] + c.y[i] + c.z[i]);
  }
}

template <int W>
class ShadowTracer {
 public:
  ShadowTracer(const Scene& scene, const IntegratorSettings& settings, RayRecorder* recorder, PathNeeds needs, Worker& worker)
      : scene_(scene), settings_(settings), recorder_(recorder), needs_(needs), w_(worker) {}

  void trace() {
    w_.shadow_rays += w_.shadows.count;
    scene_.many.any() && !scene_.has_thin ? trace_stream() : trace_lanes();
    if (scene_.lights.has_special()) trace_special();
  }

 private:
  using F = vfloat<W>;
  using I = vint<W>;
  using B = vbool<W>;
  using V = vvec3<W>;

  PRIMRAY_RARE void trace_stream() {
    const ShadowQueue& q = w_.shadows;
    alignas(64) int32_t blocked[ShadowQueue::kSize];
    occlude_stream<W>(scene_.many, recorder_, q, blocked);
    for (int at = 0; at < q.count; at += W) {
      const B open = (lane_numbers<W>() < I(q.count - at)) & (load<W>(blocked + at) == I(0));
      add(open, q, at, {load<W>(q.r + at), load<W>(q.g + at), load<W>(q.b + at)});
    }
  }

  void trace_lanes() {
    const ShadowQueue& q = w_.shadows;
    for (int at = 0; at < q.count; at += W) {
      const B active = lane_numbers<W>() < I(q.count - at);
      Rays<W> rays = q.rays<W>(at);
      if (needs_.time) rays.time = load<W>(q.time + at);
      V carried{load<W>(q.r + at), load<W>(q.g + at), load<W>(q.b + at)};
      B blocked;
      if (scene_.has_thin) {
        blocked = !pass_thin(scene_, recorder_, active, rays, carried);
      } else {
        const bool packet = w_.shadow_entry.packet(), measuring = w_.shadow_entry.measuring();
        if (recorder_) recorder_->record(true, packet, active, rays);
        const uint64_t start = measuring ? EntryChoice::now() : 0;
        blocked = occluded(scene_, packet, active, rays);
        if (measuring) w_.shadow_entry.record(EntryChoice::now() - start, std::min(W, q.count - at));
      }
      add(active & !blocked, q, at, carried);
    }
  }

  void trace_special() {
    const SpecialShadowQueue& q = *w_.special_shadows;
    w_.shadow_rays += q.rays.count;
    for (int at = 0; at < q.rays.count; at += W) {
      const B active = lane_numbers<W>() < I(q.rays.count - at);
      const V carried{load<W>(q.rays.r + at), load<W>(q.rays.g + at), load<W>(q.rays.b + at)};
      const I light = select(active, load<W>(q.light + at), I(q.light[at]));
      Rays<W> rays = q.rays.rays<W>(at);
      if (needs_.time) rays.time = load<W>(q.rays.time + at);
      const V left = pass_special(scene_, recorder_, active, rays, light);
      add(active, q.rays, at, carried * left);
    }
  }

  void add(B m, const ShadowQueue& q, int at, const V& c) { add_to_slots(w_, settings_, m, load<W>(q.slot + at), c); }

  const Scene& scene_;
  const IntegratorSettings& settings_;
  RayRecorder* recorder_;
  const PathNeeds needs_;
  Worker& w_;
};

}  // namespace primray
