// One task: some samples of both replicates for one tile. Paths of W lanes at a time, in a pool kept full.
//
// A round takes every path of the pool one vertex further: refill with camera rays, trace, shade (which leaves the survivors
// packed in the other pool and shadow rays in a queue), trace the shadow rays. What a path adds to its slot comes in the same
// order whatever W is, so W does not show in the image.
#pragma once

#include <memory>

#include "bsdf/bsdf.hpp"
#include "film/film.hpp"
#include "integrator/entry_choice.hpp"
#include "integrator/interaction.hpp"
#include "integrator/pool.hpp"
#include "integrator/settings.hpp"
#include "light/selection.hpp"
#include "sampler/sampler.hpp"
#include "scene/evaluate_inputs.hpp"

namespace primray {

// Samples [first, first + count) of each replicate, kBlock at most, for one tile: the pixels (x0 + i stride_x, y0 + j stride_y)
// before (x1, y1), which stand in the film from (film_x, film_y) on, side by side.
struct TileBlock {
  int x0, y0, x1, y1;
  int film_x, film_y;
  int stride_x = 1, stride_y = 1;
  int first[kReplicates] = {}, count[kReplicates] = {};
};

// One thread's memory and measurements; lives as long as the thread.
struct Worker {
  // Paths of this round, and those that the round leaves for the next.
  PathPool pools[2];
  PathPool* pool = &pools[0];
  PathPool* next = &pools[1];
  ShadowQueue shadows;
  std::unique_ptr<SpecialShadowQueue> special_shadows;  // of scenes with special lights
  static constexpr int kSlots = kTile * kTile * kBlock * kReplicates;
  alignas(64) float r[kSlots], g[kSlots], b[kSlots], a[kSlots];
  uint8_t pixel_x[kTile * kTile], pixel_y[kTile * kTile];
  EntryChoice camera_entry, scattered_entry, shadow_entry;
  int64_t camera_rays = 0, scattered_rays = 0, shadow_rays = 0;
  int64_t busy_lanes = 0, shaded_lanes = 0;  // occupancy of the shading steps
};

// Records every ray in the order it was traced, for the benchmark that replays them through Embree alone.
struct RayRecorder;

template <int W>
void render_tile_block(const Scene& scene, const IntegratorSettings& settings, const TileBlock& block, Worker& worker,
                       Film& film, RayRecorder* recorder);

extern template void render_tile_block<1>(const Scene&, const IntegratorSettings&, const TileBlock&, Worker&, Film&,
                                          RayRecorder*);
extern template void render_tile_block<4>(const Scene&, const IntegratorSettings&, const TileBlock&, Worker&, Film&,
                                          RayRecorder*);
extern template void render_tile_block<8>(const Scene&, const IntegratorSettings&, const TileBlock&, Worker&, Film&,
                                          RayRecorder*);
extern template void render_tile_block<16>(const Scene&, const IntegratorSettings&, const TileBlock&, Worker&, Film&,
                                           RayRecorder*);

}  // namespace primray
