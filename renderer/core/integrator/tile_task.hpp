// Render task: some samples of both replicates for one tile, rendered by W lanes at a time from a pool that is kept full.
// Contributions are added to each sample slot in the same order for every W, so W does not change the image.
#pragma once

#include <cmath>
#include <memory>

#include "base/integrator_settings.hpp"
#include "bsdf/bsdf.hpp"
#include "film/film.hpp"
#include "integrator/along_state.hpp"
#include "integrator/deep_layers.hpp"
#include "integrator/lpe_states.hpp"
#include "integrator/media.hpp"
#include "integrator/rays/packet_choice.hpp"
#include "integrator/rays/path_pool.hpp"
#include "integrator/volume_state.hpp"
#include "light/sampler/selection.hpp"
#include "sampler/sampler.hpp"
#include "surface/evaluate_inputs.hpp"
#include "surface/interaction.hpp"

namespace primray {

// Alpha of a sample while its path is traced: 1 once the camera ray hits something, minus the part that escapes straight
// through it.

// A camera ray that has passed only gaps (cutouts, or surfaces hidden from the camera) sees the background as if through a
// hole. Until it hits something, kGapMark is added to its sample's coverage to mark it.
constexpr float kThroughGaps = 3, kGapMark = 4;

inline float finished_coverage(float a) { return a >= kThroughGaps ? a - kGapMark : a; }

// Samples [first, first + count) of each replicate, at most kBlock, of one tile: pixels (x0 + i stride_x, y0 + j stride_y)
// before (x1, y1), stored in the film contiguously from (film_x, film_y).
struct TileBlock {
  int x0, y0, x1, y1;
  int film_x, film_y;
  int stride_x = 1, stride_y = 1;
  int first[kReplicates] = {}, count[kReplicates] = {};
};

// Memory and measurements of one thread; lives as long as the thread.
struct Worker {
  // Paths of this round, and those that continue in the next.
  PathPool pools[2];
  PathPool* pool = &pools[0];
  PathPool* next = &pools[1];
  ShadowQueue shadows;
  std::unique_ptr<SpecialShadowQueue> special_shadows;  // in scenes with special lights
  std::unique_ptr<MediumStateStore> medium_states;      // in scenes with participating media
  std::unique_ptr<VolumeState> volumes;                 // in scenes with volumes
  std::unique_ptr<AlongState> along;                    // where lights are sampled along camera rays
  std::unique_ptr<LpeStore> lpe;                        // for light path expressions
  std::unique_ptr<DeepLayers> deep;                     // for deep pictures
  static constexpr int kSlots = kTile * kTile * kBlock * kReplicates;
  // With a clamp, indirect light is summed separately, kSlots further on (integrator/add_to_film.hpp).
  static constexpr int kSums = 2 * kSlots;
  static_assert(kSums == kSumMask + 1);
  alignas(64) float r[kSums], g[kSums], b[kSums], a[kSlots];
  std::vector<float> caustics;  // by channel, then by sample; where caustics are left out of the image
  std::vector<vec3> weights;    // of samples, for lenses that absorb part of their light
  uint8_t pixel_x[kTile * kTile], pixel_y[kTile * kTile];
  std::span<const LightOutlines::Part> outlines[kTile * kTile];
  PacketChoice camera_entry, scattered_entry, shadow_entry;
  int64_t camera_rays = 0, scattered_rays = 0, shadow_rays = 0;
  int64_t busy_lanes = 0, shaded_lanes = 0;  // occupancy of the shading steps
  UnseenWalks unseen_walks;                  // of camera rays
  // Whether camera rays met hair first, by pixel in the order in which the task samples them; for pilots.
  bool shows_fibres[kTile * kTile] = {};
};

// Lists the block's pixels in Morton order, so that neighbours in a packet are neighbours on the film; returns their number.
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

// Records every ray in the order in which it was traced, for the benchmark that replays them in Embree alone.
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
