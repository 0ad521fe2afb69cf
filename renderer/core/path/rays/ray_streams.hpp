// Stream traversal: traces all rays of a pool or of a shadow queue at once with the interleaved traversal
// (bvh/interleaved.hpp).
#pragma once

#include "bvh/interleaved.hpp"
#include "path/rays/pool.hpp"
#include "path/rays/ray_recorder.hpp"

namespace primray {

template <int W, class Rays>
void record_stream(RayRecorder& recorder, bool shadow, const Rays& rays) {
  for (int at = 0; at < rays.count; at += W)
    recorder.record(shadow, true, lane_numbers<W>() < vint<W>(rays.count - at), rays.template rays<W>(at));
}

// Traces the pool's rays and stores the hits in the pool.
template <int W>
void trace_stream(const TriangleBvh& bvh, RayRecorder* recorder, PathPool& pool) {
  if (recorder) record_stream<W>(*recorder, false, pool);
  intersect_interleaved(bvh, uint32_t(pool.count), pool.ray_columns(), pool.hit_columns());
}

// Traces the queue's shadow rays; `blocked` is set to 1 or 0 for each.
template <int W>
void occlude_stream(const TriangleBvh& bvh, RayRecorder* recorder, const ShadowQueue& queue, int32_t* blocked) {
  if (recorder) record_stream<W>(*recorder, true, queue);
  occluded_interleaved(bvh, uint32_t(queue.count), queue.ray_columns(), blocked);
}

}  // namespace primray
