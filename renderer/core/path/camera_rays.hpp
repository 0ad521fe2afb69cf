// The first stage of a round: camera rays for the slots that come next, as many as the pool has room for.
#pragma once

#include <algorithm>

#include "path/round.hpp"

namespace primray {

// W camera paths, of the slots from `round.next_slot` on; past the last slot, that again.
template <int W>
PRIMRAY_INLINE PathLanes<W> camera_paths(const Round& round, int slots) {
  using F = vfloat<W>;
  using I = vint<W>;
  using V = vvec3<W>;
  const Scene& scene = round.scene;
  alignas(64) int32_t x[W], y[W], slot[W];
  alignas(64) uint32_t index[W], replicate[W];
  for (int i = 0; i < W; ++i) {
    const int s = std::min(round.next_slot + i, slots - 1), pixel = s / round.samples, k = s - pixel * round.samples;
    x[i] = round.pixel_x(pixel), y[i] = round.pixel_y(pixel), slot[i] = s;
    index[i] = round.index(k), replicate[i] = uint32_t(round.replicate(k));
  }
  const I px = load<W>(x), py = load<W>(y);
  PathLanes<W> p;
  p.sampler = Sampler<W>::of(round.settings.seed, px, py, load<W>(replicate), load<W>(index), round.settings.screen_block);
  const Pair<W> film = p.sampler.link(I(round.first_link()));
  Pair<W> lens{F(0.5f), F(0.5f)};
  if (scene.camera.has_lens()) lens = p.sampler.pair(I(0), Purpose::kLens);
  const F time = round.needs.time ? time_of(round, p.sampler.single(I(0), kShutterTime)) : F(0.0f);
  const CameraRay<W> ray = scene.camera.ray<W>(px, py, film.u, film.v, lens.u, lens.v, time);
  p.ray = {ray.o, ray.d, ray.tnear, ray.tfar, time};
  p.beta = V(F(1.0f)), p.diffuse_share = p.normal = V(F(0.0f)), p.link = I(kUnlinkedRow);
  p.bsdf_pdf = p.travelled = p.first_received = F(0.0f), p.splits = F(1.0f);
  p.cone_width = F(scene.camera.cone_width()), p.cone_spread = F(scene.camera.cone_spread());
  p.slot = load<W>(slot), p.depth = p.vertex = I(0);
  return p;
}

template <int W>
void refill(Round& round, int slots) {
  PathPool& pool = *round.worker.pool;
  round.first_camera = pool.count;
  const int splits = round.settings.splits;
  // Room for every camera path to split.
  while (round.next_slot < slots && pool.count + (splits - 1) * (pool.count - round.first_camera) + splits * W <= kPool) {
    const int n = std::min(W, slots - round.next_slot);
    pool.append(Compaction<W>(lane_numbers<W>() < vint<W>(n)), camera_paths<W>(round, slots), round.needs);
    round.next_slot += n;
  }
  round.worker.camera_rays += pool.count - round.first_camera;
  round.worker.scattered_rays += round.first_camera;
}

}  // namespace primray
