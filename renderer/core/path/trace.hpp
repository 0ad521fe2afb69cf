// Second stage of a round: intersects the pool's rays with the scene.
#pragma once

#include <algorithm>

#include "accel/query.hpp"
#include "path/rays/ray_streams.hpp"
#include "path/round.hpp"

namespace primray {

template <int W>
void trace(Round& round) {
  Worker& w = round.worker;
  PathPool& pool = *w.pool;
  if (round.scene.triangle_bvh.any()) return trace_stream<W>(round.scene.triangle_bvh, round.recorder, pool);
  for (int at = 0; at < pool.count; at += W) {
    const vbool<W> active = lane_numbers<W>() < vint<W>(pool.count - at);
    Rays<W> rays = pool.rays<W>(at);
    if (round.needs.time) rays.time = load<W>(pool.time + at);
    EntryChoice& entry = at >= round.first_camera ? w.camera_entry : w.scattered_entry;
    const bool packet = entry.packet();
    if (round.recorder) round.recorder->record(false, packet, active, rays);
    const uint64_t start = entry.measuring() ? EntryChoice::now() : 0;
    const Hits<W> hits = intersect(round.scene, packet, active, rays);
    if (entry.measuring()) entry.record(EntryChoice::now() - start, std::min(W, pool.count - at));
    pool.set_hits(at, hits);
  }
}

}  // namespace primray
