// Wavefront path tracing loop. Included only by lanes_<W>.cpp, one translation unit per lane count.
#pragma once

#include <algorithm>

#include "integrator/add_to_film.hpp"
#include "integrator/along_rays.hpp"
#include "integrator/camera_rays.hpp"
#include "integrator/cross_media.hpp"
#include "integrator/cross_volumes.hpp"
#include "integrator/outline_rays.hpp"
#include "integrator/place_in_depth.hpp"
#include "integrator/shade.hpp"
#include "integrator/trace.hpp"
#include "integrator/volume_emission.hpp"

namespace primray {

inline void clear_slots(Worker& w, int slots, bool clamps) {
  for (float* sums : {w.r, w.g, w.b, w.a}) std::fill_n(sums, slots, 0.0f);
  if (w.lpe) w.lpe->clear(0, slots);
  if (!clamps) return;
  for (float* sums : {w.r, w.g, w.b}) std::fill_n(sums + Worker::kSlots, slots, 0.0f);
  if (w.lpe) w.lpe->clear(Worker::kSlots, slots);
}

template <int W>
void clear_queues(Round& round) {
  Worker& w = round.worker;
  if (PathLog* const log = path_log<W>(round)) log->clear_queues();
  w.next->count = 0;
  w.shadows.count = 0;
  if (round.has_special()) w.special_shadows->rays.count = 0;
}

// Finds where paths collide in volumes, and what these emit up to there.
template <int W>
PRIMRAY_RARE void cross_volumes(Round& round) {
  collide_in_volumes<W>(round);
  if (round.scene.volumes->in_emissions.any()) gather_volume_emission<W>(round);
}

// Runs rounds until no path is left.
template <int W>
void run_rounds(Round& round, int slots) {
  while (true) {
    if (round.settings.guide_log) ++round.settings.guide_log->round;
    refill<W>(round, slots);
    if (round.worker.pool->count == 0) break;
    if (round.follows_media()) end_rays<W>(round);
    trace<W>(round);
    clear_queues<W>(round);
    if (round.samples_along_rays()) sample_along_rays<W>(round);
    if (round.has_volumes()) cross_volumes<W>(round);
    if (round.follows_media()) cross_media<W>(round);
    if (round.has_volumes()) shade_volumes<W>(round);
    shade<W>(round);
    trace_shadows<W>(round);
  }
}

// Logs the values of the samples [0, slots), after what the image leaves out was removed.
inline void log_samples(PathLog& log, const Round& round, int slots) {
  const Worker& w = round.worker;
  for (int s = 0; s < slots; ++s) {
    PathLog::Event& sample = log.add("sample", s, 0, 0, 0);
    sample.put("value", dvec3{double(w.r[s]), double(w.g[s]), double(w.b[s])});
    sample.put("alpha", double(finished_coverage(w.a[s])));
    if (round.scene.camera.flawed) sample.put("lens_weight", dvec3(w.weights[size_t(s)]));
    if (const int i = Worker::kSlots + s; round.settings.clamps())
      sample.put("clamped", dvec3{double(w.r[i]), double(w.g[i]), double(w.b[i])});
    if (const size_t i = size_t(s); round.leaves_out_caustics())
      sample.put("caustics", dvec3{double(w.caustics[i]), double(w.caustics[Worker::kSlots + i]),
                                   double(w.caustics[2 * Worker::kSlots + i])});
  }
  log.first_sample += slots;
}

// Prepares the worker for the layers of a block's samples.
PRIMRAY_RARE void begin_layers(Round& round, const DeepFilm& film, int slots) {
  std::unique_ptr<DeepLayers>& deep = round.worker.deep;
  if (!deep) deep = std::make_unique<DeepLayers>(film, Worker::kSlots);
  deep->clear(slots);
  round.deep = deep.get();
}

template <int W>
void render_tile_block(const Scene& scene, const IntegratorSettings& settings, const TileBlock& block, Worker& worker,
                       Film& film, RayRecorder* recorder) {
  Round round(scene, settings, block, worker, recorder);
  round.pixels = list_pixels(block, worker);
  round.outlined = scene.outlines.any() && look_up_outlines(round);
  const int slots = round.pixels * round.samples;
  clear_slots(worker, slots, settings.clamps());
  if (film.deep) begin_layers(round, *film.deep, slots);
  worker.pool->count = 0;
  if (round.outlined) trace_outlines<W>(round);
  run_rounds<W>(round, slots);
  if (scene.camera.flawed) apply_lens_weights(worker, 0, slots);
  if (scene.camera.flawed && settings.clamps()) apply_lens_weights(worker, Worker::kSlots, slots);
  if (round.leaves_out_caustics()) leave_out_caustics(worker, slots, settings.clamps());
  if (settings.clamps()) clamp_indirect(worker, slots, settings.clamp_indirect);
  if (PathLog* const log = path_log<W>(round)) log_samples(*log, round, slots);
  add_to_film(block, worker, round.pixels, round.samples, film);
}

}  // namespace primray
