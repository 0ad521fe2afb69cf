// Volumes of a scene: media in grids, and where they are. Each medium may be placed many times. Overlapping media are
// independent: their extinctions add.
#pragma once

#include <span>

#include "math/box.hpp"
#include "math/matrix.hpp"
#include "volume/grid_table.hpp"

namespace primray {

// A medium as the builder receives it.
struct MediumInput {
  int grid = -1;                             // its values are the density
  vec3 extinction{0.0f, 0.0f, 0.0f};         // per unit of density and of the scene's lengths
  vec3 albedo{1.0f, 1.0f, 1.0f};             // single-scattering albedo
  int albedo_grid = -1;                      // its values are multiplied with the albedo, voxel by voxel; -1: none
  float anisotropy = 0;                      // mean cosine of the phase function
  std::span<const double> world_from_index;  // 12 numbers by instance: rows of a 3x4 matrix
};

struct VolumeTable {
  GridTable grids;
  std::vector<dvec3> first_voxels;  // by grid: the voxel at the origin of its coordinates, which are small numbers then

  struct Medium {
    int32_t grid, albedo_grid;
    int32_t albedo_shift[3];  // from voxels of `grid` to those of `albedo_grid`
    float extinction[3];      // per unit of density and of the core's lengths
    float albedo[3];
    float anisotropy;
  };
  std::vector<Medium> media;
  std::vector<int32_t> medium_of;      // by instance
  std::vector<float> index_from_core;  // 12 floats by instance: columns x, y, z, origin
  static_assert(sizeof(Medium) == 12 * sizeof(int32_t));

  // Hierarchy of the boxes of instances, in the core's space. Children of an inner node are adjacent.
  struct Node {
    float low[3], high[3];
    int32_t first, count;  // range of `order`; count 0: inner, and `first` is its first child
  };
  std::vector<Node> nodes;
  std::vector<int32_t> order;

  bool any() const { return !medium_of.empty(); }
  int64_t memory_bytes() const;
  // Adds a grid and returns its number.
  int add_grid(GridInput grid);
  // Adds a medium, for a scene that is recentred and scaled by `core_from_world`. Returns the instances that are left out
  // because their matrix is singular or not finite.
  std::vector<int64_t> add_medium(const MediumInput& input, const daffine& core_from_world, double scale);
  // Builds the hierarchy.
  void finish();

 private:
  std::vector<Box> boxes_;  // by instance
};

}  // namespace primray
