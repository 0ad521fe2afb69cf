// First stage of a round, which generates camera rays for the next sample slots, as many as fit into the path pool.
#pragma once

#include <algorithm>

#include "integrator/round.hpp"

namespace primray {

// Sample values for a camera ray through a lens with flaws (vignetting, chromatic aberration).
template <int W>
struct FlawedSample {
  vint<W> x, y, slot;
  Pair<W> film, lens;
  vfloat<W> time;
};

// Generates a camera ray and stores the lens's weight by sample slot rather than in the path's throughput, so that neither
// coverage nor Russian roulette depends on the lens.
template <int W>
PRIMRAY_RARE CameraRay<W> flawed_ray_of(const Round& round, const PathLanes<W>& p, const FlawedSample<W>& s) {
  const Camera& camera = round.scene.camera;
  const vfloat<W> channel = camera.flaws.is_chromatic ? p.sampler.single(vint<W>(0), kColorChannel) : vfloat<W>(0.0f);
  vvec3<W> weight;
  const CameraRay<W> ray = camera.flawed_ray<W>(s.x, s.y, s.film, s.lens, s.time, channel, weight);
  for (int i = 0; i < W; ++i) round.worker.weights[size_t(s.slot[i])] = {weight.x[i], weight.y[i], weight.z[i]};
  return ray;
}

// Multiplies the sample sums [first, first + slots) by the weights of the lens.
inline void apply_lens_weights(Worker& w, int first, int slots) {
  for (int i = 0; i < slots; ++i) {
    const vec3& weight = w.weights[size_t(i)];
    const int sum = first + i;
    w.r[sum] *= weight.x, w.g[sum] *= weight.y, w.b[sum] *= weight.z;
    if (w.lpe) w.lpe->weigh(sum, {weight.x, weight.y, weight.z});
  }
}

// Generates W camera paths for the slots from `round.next_slot` on; surplus lanes repeat the last slot.
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
  const F time = round.needs.time ? time_of(round, p.sampler.single(I(0), kShutterTime), px, py) : F(0.0f);
  CameraRay<W> ray;
  if (scene.camera.flawed)
    ray = flawed_ray_of(round, p, {px, py, load<W>(slot), film, lens, time});
  else
    ray = scene.camera.ray<W>(px, py, film.u, film.v, lens.u, lens.v, time);
  p.ray = {ray.o, ray.d, ray.tnear, ray.tfar, time};
  p.beta = V(F(1.0f)), p.diffuse_share = p.normal = V(F(0.0f)), p.link = I(kUnlinkedRow);
  p.lpe_diffuse = p.lpe_other = I(0);
  p.bsdf_pdf = p.travelled = p.first_received = F(0.0f);
  const bool whole = round.has_parts() || round.settings.light_samples > 1;
  p.splits = F(whole ? kUnbranched : 1.0f);
  p.cone_width = F(scene.camera.cone_width()), p.cone_spread = F(scene.camera.cone_spread());
  p.slot = load<W>(slot), p.depth = p.vertex = I(0);
  if (PathLog* const log = path_log<W>(round))
    log->add("camera", p)
        .put("replicate", double(replicate[0]))
        .put("index", double(index[0]))
        .put("film", dvec3{double(film.u[0]), double(film.v[0]), 0.0})
        .put("lens", dvec3{double(lens.u[0]), double(lens.v[0]), 0.0})
        .put("time", time)
        .put("origin", log->point(ray.o))
        .put("direction", ray.d);
  return p;
}

template <int W>
PRIMRAY_RARE void put_camera_media(Round& round, int at, const Compaction<W>& c) {
  MediumState<W> state;
  for (int k = 0; k < kMaxNestedMedia; ++k) state.stack.surfaces[k] = vint<W>(round.scene.interiors.camera[k]);
  state.volumes = vint<W>(round.worker.medium_states->sets.of_camera());
  round.worker.medium_states->pool->put(at, c, state);
}

template <int W>
void refill(Round& round, int slots) {
  PathPool& pool = *round.worker.pool;
  round.first_camera = pool.count;
  // Every path that is whole may branch and split, so leave room for its parts.
  const int splits = round.settings.splits, most = splits + (round.branches ? 1 : 0);
  float* const end = pool.splits + pool.count;
  const int unbranched = most > 1 ? int(std::count(pool.splits, end, kUnbranched)) : 0;
  const int branched = round.branches ? int(std::count_if(pool.splits, end, [](float s) { return s < kUnbranched; })) : 0;
  const int first = pool.count - unbranched, others = first + branched * (splits - 1);
  while (round.next_slot < slots && others + most * (pool.count - first + W) <= kPool) {
    const int n = std::min(W, slots - round.next_slot);
    const PathLanes<W> paths = camera_paths<W>(round, slots);
    vbool<W> starts = lane_numbers<W>() < vint<W>(n);
    // Samples outside the lens's image circle stay black.
    if (round.scene.camera.distortion) starts &= paths.ray.tfar >= vfloat<W>(0.0f);
    if (PathLog* const log = path_log<W>(round); log && !any(starts)) log->end(paths, "outside the lens's image circle");
    const Compaction<W> c(starts);
    if (round.follows_media()) put_camera_media(round, pool.count, c);
    pool.append(c, paths, round.needs);
    round.next_slot += n;
  }
  round.worker.camera_rays += pool.count - round.first_camera;
  round.worker.scattered_rays += round.first_camera;
}

}  // namespace primray
