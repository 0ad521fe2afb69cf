// First-hit AOVs: what the camera sees first, pixel by pixel. Independent of the path loop: separate planes, and no samples of
// a render.
//
// Point samples are taken through the centre of the pixel and of the lens, so they are exact and free of noise; filtered ones
// are means over the pixel filter and the lens of kFilteredSamples stratified points, the same in every render. Surfaces with a
// presence below one half are looked through (filtered samples mix them by their presence); cutout holes are not hit in the
// first place. Mirrors and glass are surfaces like others. Lights that the camera sees are background, but emit.
//
// Volumes are no surfaces: point samples look through them. Filtered samples mix what is behind them by their transmittance,
// and coverage counts their collisions (first_hit_volumes.hpp).
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "film/film.hpp"
#include "scene/scene.hpp"

namespace primray {

// Coverage of each pixel by surface: the surfaces that camera rays of the film's own samples hit first, and their shares.
//
// The rays are those of the image, with the same random numbers: through lens, filter and time. Shares are integers in the
// film's units, so that sums depend neither on their order nor on how samples are divided.

// A surface as the core numbers it (see FirstHitPlanes), and its share of a pixel's samples, in units of 1 / Film::kCovered. A
// volume in a grid has `shape` -1, `surface` 0, and its row of VolumeTable::media for the instance; the fog has -1 and 1.
struct Covering {
  int32_t shape, surface, instance, outer;
  int64_t share;
};

// Sample ranges of a film, and the coverage of its pixels.
struct CoveragePlanes {
  uint32_t seed = 0;
  int screen_block = 0, first_link = 0;
  // Filled in bands of whole tiles.
  std::vector<uint32_t> first, end;             // samples of each replicate and tile, as in Film::next
  std::vector<std::vector<Covering>> by_pixel;  // rows from the top; empty: not requested
};

inline void add_covering(std::vector<Covering>& covering, const Covering& one) {
  for (Covering& other : covering)
    if (other.shape == one.shape && other.surface == one.surface && other.instance == one.instance &&
        other.outer == one.outer) {
      other.share += one.share;
      return;
    }
  covering.push_back(one);
}

constexpr int kFilteredSamples = 16;
constexpr int kOcclusionRays = 4;  // per filtered sample

// Requested primvar: the first of two names' values (see PrimvarTable) that a shape has; further components up to `width` are
// 0.
struct PrimvarPlane {
  int names[2] = {-1, -1};
  int width = 1;
  std::vector<float> values;
};

// How the values of a plane are sampled.
enum class FirstHitSampling {
  kPoint,      // one ray through the centres of pixel and lens
  kFiltered,   // mean over the pixel filter and the lens
  kGuide,      // likewise over the shutter interval, and behind smooth surfaces
  kOcclusion,  // filtered, with rays from each hit
};

// One entry per pixel, rows from the top; empty planes are not requested. Lengths are in scene units.
struct FirstHitPlanes {
  std::vector<float> depth, distance;    // along the camera's axis, and along the ray; infinite where nothing is hit
  std::vector<double> position;          // world space
  std::vector<float> camera_position;    // relative to the camera, in its axes
  std::vector<float> normal, geometric;  // unit length, world space, on the visible side
  std::vector<float> forward, backward;  // pixels, right and down: to the point's position at the end of the span, and at its
                                         // beginning
  std::vector<float> albedo, emission;   // filtered; R, G, B
  std::vector<float> volume_opacity;     // filtered: share of light that collides in volumes before the first surface; R, G, B
  std::vector<float> volume_depth;       // filtered: mean distance along the camera's axis of those collisions
  // Denoiser guides: filtered, also over the shutter interval, and of what is seen in mirrors and through clear glass
  // (first_hit_task.hpp); `guide_normal` is the mean of unit normals.
  std::vector<float> guide_albedo, guide_normal;
  // Ambient occlusion, filtered: the cosine-weighted share of directions above the true surface along which a ray hits nothing
  // within `occlusion_distance` (scene units); 1 where the camera sees nothing. All surfaces count as opaque except for cutout
  // holes.
  std::vector<float> occlusion;
  float occlusion_distance = 0;
  std::vector<int32_t> shape;            // row of the MeshTable, -2 - n for row n of the CurvedTable, -1: nothing
  std::vector<int32_t> surface;          // -1: nothing
  std::vector<int32_t> instance, outer;  // row of Scene::world_from_group, and that of an outer instance; -1: none
  std::vector<PrimvarPlane> primvars;
  CoveragePlanes coverage;
  bool presence_varies = true;  // what presence_varies() says of the scene
  uint32_t replicate = 0;  // of filtered samples: further replicates are as good and independent, and show the error of the
                           // first

  // Calls f(name, plane, numbers per pixel, sampling, value where nothing is hit) for each plane. This is the only list of
  // them; FirstHitTask fills them, and most are the AOV of that name (primray/aovs.py).
  template <class F>
  void for_each(const F& f) {
    list(*this, f);
  }
  // Returns whether a plane that is sampled like that is requested.
  bool wants(FirstHitSampling sampling) const {
    bool wanted = sampling == FirstHitSampling::kPoint && !primvars.empty();
    list(*this, [&](const char*, const auto& plane, size_t, FirstHitSampling own, double) {
      wanted |= own == sampling && !plane.empty();
    });
    return wanted;
  }

 private:
  template <class Planes, class F>
  static void list(Planes& p, const F& f) {
    using enum FirstHitSampling;
    constexpr double kFar = std::numeric_limits<double>::infinity();
    f("depth", p.depth, 1, kPoint, kFar);
    f("distance", p.distance, 1, kPoint, kFar);
    f("position", p.position, 3, kPoint, 0.0);
    f("camera_position", p.camera_position, 3, kPoint, 0.0);
    f("normal", p.normal, 3, kPoint, 0.0);
    f("geometric_normal", p.geometric, 3, kPoint, 0.0);
    f("motion_forward", p.forward, 2, kPoint, 0.0);
    f("motion_backward", p.backward, 2, kPoint, 0.0);
    f("albedo", p.albedo, 3, kFiltered, 0.0);
    f("emission", p.emission, 3, kFiltered, 0.0);
    f("volume_opacity", p.volume_opacity, 3, kFiltered, 0.0);
    f("volume_depth", p.volume_depth, 1, kFiltered, kFar);
    f("guide_albedo", p.guide_albedo, 3, kGuide, 0.0);
    f("guide_normal", p.guide_normal, 3, kGuide, 0.0);
    f("occlusion", p.occlusion, 1, kOcclusion, 1.0);
    f("prim", p.shape, 1, kPoint, -1.0);
    f("material", p.surface, 1, kPoint, -1.0);
    f("instance", p.instance, 1, kPoint, -1.0);
    f("outer", p.outer, 1, kPoint, -1.0);
  }
};

// Surfaces along rays through points of the film, each once, in the order in which the ray hits them first. Rays pass what they
// hit: half-present surfaces and cutout holes are none, as for other point samples.
struct Layer {
  int32_t shape, instance, outer;  // as in FirstHitPlanes
  float depth, distance;           // scene units
};
struct LayerPoints {
  std::vector<float> x, y;      // pixels of the frame, right and down from its upper left corner
  bool first_only = false;      // rays end at the first surface
  bool presence_varies = true;  // what presence_varies() says of the scene
  std::vector<uint32_t> count;  // layers by point
  // The layers of points, one task after the other.
  static constexpr size_t kTask = 4096;  // points
  std::vector<std::vector<Layer>> by_task;
};

// Whether the presence of some surface varies over it: if not, points and layers need no textures, but for normals.
bool presence_varies(const Scene& scene);

// Layers with their parts numbered: each part that some ray passes has one number, in the order of (shape, instance, outer).
struct NumberedLayers {
  std::vector<std::array<int32_t, 3>> parts;
  std::vector<int32_t> first;   // number of each point's first layer; -1: none
  std::vector<float> depth;     // its depth; infinite where there is none
  std::vector<uint32_t> begin;  // of each point's layers in `numbers`, and the end of the last one's
  std::vector<int32_t> numbers;
};
NumberedLayers numbered(const LayerPoints& points);

// Rays by thing, where each part belongs to the thing `places[part]` and each thing to `parents[thing]`, -1: to none. A ray
// that passes what a thing holds passes the thing.
struct RayCounts {
  std::vector<int64_t> passing, first;  // rays that pass a thing, and that hit it before all others
};
RayCounts rays_by_thing(const NumberedLayers& layers, std::span<const int32_t> places, std::span<const int32_t> parents);

// The same rays one by one: pairs of a thing and a ray that passes it, in the order of rays.
std::vector<std::array<int32_t, 2>> rays_passing_things(const NumberedLayers& layers, std::span<const int32_t> places,
                                                        std::span<const int32_t> parents);

// Finds the layers of all points on threads, W = `lanes` rays at a time; no bit depends on either. Points are seen at the
// frame's time, with a rolling shutter in the middle of their row's and column's exposure.
void find_layers(const Scene& scene, int lanes, int threads, LayerPoints& points);

// Fills the pixels of the film's rows [first_row, end_row) on threads, W = `lanes` rays at a time; no bit depends on either.
void find_first_hits(const Scene& scene, int lanes, int threads, int first_row, int end_row, FirstHitPlanes& planes);

}  // namespace primray
