// What the camera sees first, pixel by pixel: the outputs beside the picture (AOVs). Apart from the path loop, which knows
// nothing of it: planes of its own, and no samples of a render.
//
// Point samples are taken through the pixel's centre and the lens' centre, so they are exact and without noise; filtered ones
// are means over the pixel's filter and the lens of kFilteredSamples stratified points, the same in every render. Surfaces
// that are there by less than half are looked through (filtered samples mix them by their presence); holes of cut-outs are no
// hits in the first place. Mirrors and glass are surfaces like others. Lights that the camera sees are background, but emit.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "aov/coverage.hpp"
#include "scene/scene.hpp"

namespace primray {

constexpr int kFilteredSamples = 16;
constexpr int kOcclusionRays = 4;  // of each filtered sample

// A primvar as it is wanted: of two names' values (see PrimvarTable) the first that a shape has; the rest of `width` are 0.
struct PrimvarPlane {
  int names[2] = {-1, -1};
  int width = 1;
  std::vector<float> values;
};

// One entry a pixel, rows from the top; those that are empty are not wanted. Lengths are in scene units.
struct FirstHitPlanes {
  std::vector<float> depth, distance;    // along the camera's axis, and the ray; infinite where nothing is
  std::vector<double> position;          // world
  std::vector<float> camera_position;    // relative to the camera, in its axes
  std::vector<float> normal, geometric;  // unit length, world, on the side that is seen
  std::vector<float> forward, backward;  // pixels, right and down: to where the point is at the end of the span, the beginning
  std::vector<float> albedo, emission;   // filtered; R, G, B
  // As a denoiser is guided: filtered, over the shutter's time too, and of what is seen in mirrors and through clear glass
  // (smooth_surfaces.hpp); `guide_normal` is the mean of unit normals.
  std::vector<float> guide_albedo, guide_normal;
  // Filtered: of the directions above the true surface, weighted by their cosine, the share along which a ray meets nothing
  // within `occlusion_distance` (scene units); 1 where nothing is. Whatever a ray may meet is whole to it but for holes.
  std::vector<float> occlusion;
  float occlusion_distance = 0;
  std::vector<int32_t> shape;            // row of the MeshTable, -2 - n for row n of the CurvedTable, -1: nothing
  std::vector<int32_t> surface;          // -1: nothing
  std::vector<int32_t> instance, outer;  // row of Scene::world_from_group, and that of an outer instance; -1: none
  std::vector<PrimvarPlane> primvars;
  CoveragePlanes coverage;
  uint32_t replicate = 0;  // of filtered samples: further ones are as good and independent, and tell the first one's error

  bool wants_points() const {
    return !(depth.empty() && distance.empty() && position.empty() && camera_position.empty() && normal.empty() &&
             geometric.empty() && forward.empty() && backward.empty() && shape.empty() && surface.empty() && instance.empty() &&
             primvars.empty());
  }
  bool wants_filtered() const { return !(albedo.empty() && emission.empty()); }
  bool wants_occlusion() const { return !occlusion.empty(); }
  bool wants_guides() const { return !(guide_albedo.empty() && guide_normal.empty()); }
};

// Fills the pixels of the film's rows [first_row, end_row) on threads, W = `lanes` rays at a time; no bit depends on either.
void find_first_hits(const Scene& scene, int lanes, int threads, int first_row, int end_row, FirstHitPlanes& planes);

}  // namespace primray
