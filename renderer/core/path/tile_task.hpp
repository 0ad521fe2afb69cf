// One task: some samples of both replicates for one tile. Paths of W lanes at a time, in a pool kept full.
// What a path adds to its slot comes in the same order whatever W is, so W does not show in the image.
#pragma once

#include <cmath>
#include <memory>

#include "base/integrator_settings.hpp"
#include "bsdf/bsdf.hpp"
#include "film/film.hpp"
#include "light/selection/selection.hpp"
#include "path/interiors/inside_columns.hpp"
#include "path/rays/entry_choice.hpp"
#include "path/rays/pool.hpp"
#include "path/routes/route_store.hpp"
#include "sampler/sampler.hpp"
#include "surface/evaluate_inputs.hpp"
#include "surface/interaction.hpp"

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
  std::unique_ptr<InsideStore> inside;                  // of scenes whose bodies are followed
  std::unique_ptr<RouteStore> routes;                   // for light path expressions
  static constexpr int kSlots = kTile * kTile * kBlock * kReplicates;
  // With a clamp, light of two scatterings and more is summed kSlots further on (path/removed_light.hpp).
  static constexpr int kSums = 2 * kSlots;
  alignas(64) float r[kSums], g[kSums], b[kSums], a[kSlots];
  std::vector<float> caustics;  // of samples, channel by channel, where these are left out of the picture
  std::vector<vec3> weights;    // of samples, behind a lens that takes some of their light
  uint8_t pixel_x[kTile * kTile], pixel_y[kTile * kTile];
  std::span<const LightOutlines::Part> outlines[kTile * kTile];
  EntryChoice camera_entry, scattered_entry, shadow_entry;
  int64_t camera_rays = 0, scattered_rays = 0, shadow_rays = 0;
  int64_t busy_lanes = 0, shaded_lanes = 0;  // occupancy of the shading steps
};

// Lists the block's pixels in Morton order, so that neighbours in a packet are neighbours on the film; their number.
inline int list_pixels(const TileBlock& block, Worker& worker) {
  int pixels = 0;
  for (int m = 0; m < kTile * kTile; ++m) {
    int x = 0, y = 0;
    for (int b = 0; (1 << b) < kTile; ++b) x |= (m >> (2 * b) & 1) << b, y |= (m >> (2 * b + 1) & 1) << b;
    if (block.x0 + x * block.stride_x < block.x1 && block.y0 + y * block.stride_y < block.y1)
      worker.pixel_x[pixels] = uint8_t(x), worker.pixel_y[pixels] = uint8_t(y), ++pixels;
  }
  return pixels;
}

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
