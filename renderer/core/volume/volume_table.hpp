// Volumes of a scene: media and emission in grids, and where they are. Each may be placed many times. Overlapping volumes are
// independent: their extinctions and emissions add.
#pragma once

#include <span>

#include "bsdf/surface.hpp"
#include "math/box.hpp"
#include "math/matrix.hpp"
#include "motion/motion_table.hpp"
#include "volume/grid_table.hpp"

namespace primray {

// Instances of a volume as the builder receives them.
struct VolumeInstances {
  std::span<const double> world_from_index;  // 12 numbers by time and instance: rows of a 3x4 matrix
  std::span<const float> times;              // from 0 to 1; empty: they do not move, and there is one time
  bool turns = false;                        // between times rotations turn, and the rest is linear; else all is linear
};

// A medium as the builder receives it.
struct MediumInput {
  int grid = -1;                      // its values are the density
  vec3 extinction{0.0f, 0.0f, 0.0f};  // per unit of density and of the scene's lengths
  vec3 albedo{1.0f, 1.0f, 1.0f};      // single-scattering albedo
  int albedo_grid = -1;               // its values are multiplied with the albedo, voxel by voxel; -1: none
  float phase = 0;                    // see medium/phase_function.hpp
  CameraVisibility camera = CameraVisibility::kSeen;
  VolumeInstances instances;
};

// Emission of a volume as the builder receives it.
struct VolumeEmissionInput {
  int grid = -1;                    // of one channel or three
  vec3 emission{1.0f, 1.0f, 1.0f};  // radiance per unit of the grid's values and of the scene's lengths; not times extinction
  CameraVisibility camera = CameraVisibility::kSeen;
  VolumeInstances instances;
};

// Up to this number of instances, each is tested by every ray; beyond, the hierarchy is traversed ray by ray.
constexpr size_t kFewVolumes = 8;

// Path of one instance.
struct VolumePath {
  std::vector<daffine> core_from_index;  // by time
  daffine index_from_grid;               // of the grid's coordinates
  const MotionClock* clock = nullptr;    // null: it does not move, and has one matrix
  bool turns = false;
};

// Instances of media, or of emission.
struct VolumePlacements {
  std::vector<int32_t> of;             // by instance: the row of its medium or emission
  std::vector<int32_t> grid;           // by instance
  std::vector<float> index_from_core;  // 12 floats by instance: columns x, y, z, origin; of moving ones: in the span's middle
  std::vector<Box> boxes;              // by instance, in the core's space, around its path
  MotionTable motion;                  // core_from_grid of moving instances, each by itself
  CameraVisibilityTable camera;        // by instance

  // Hierarchy of the boxes. Children of an inner node are adjacent.
  struct Node {
    float low[3], high[3];
    int32_t first, count;  // range of `order`; count 0: inner, and `first` is its first child
  };
  std::vector<Node> nodes;
  std::vector<int32_t> order;

  bool any() const { return !of.empty(); }
  size_t size() const { return of.size(); }
  // Adds an instance, and returns its core_from_grid, in the middle of the span.
  daffine add(int32_t row, int32_t grid_number, const GridTable::Row& bounds, const VolumePath& path, CameraVisibility seen);
  // Builds the hierarchy.
  void finish();
};

struct VolumeTable {
  GridTable grids;
  std::vector<dvec3> first_voxels;  // by grid: the voxel at the origin of its coordinates, which are small numbers then

  struct Medium {
    int32_t grid, albedo_grid;
    int32_t albedo_shift[3];  // from voxels of `grid` to those of `albedo_grid`
    float extinction[3];      // per unit of density and of the core's lengths
    float albedo[3];
    float phase;
  };
  std::vector<Medium> media;
  VolumePlacements in_media;

  // Emission, of which points are sampled by the greatest value of the cell that they are in, times its volume.
  struct Emission {
    int32_t grid, first_cell, cells;  // range of `cells`
    float radiance[3];                // per unit of value and of the core's lengths
  };
  struct Cell {
    int32_t low[3], side;  // in voxels
    float most;            // greatest value
  };
  std::vector<Emission> emissions;
  std::vector<Cell> cells;
  std::vector<float> cell_cdf;  // by cell: sum of those up to it, in parts of the emission's; the last one's is 1
  VolumePlacements in_emissions;
  // By instance of emission: events per unit of value on a ray, whatever the length of its part in the box
  // (tracking_emission.hpp); density of points that light sampling finds, by volume in the core's space (of moving instances:
  // in the grid's) and relative to that; least length of a part that its events are spread over; the light's row, or -1; and
  // where it is: 12 floats.
  std::vector<float> events_per_value, relative_density, least_part;
  std::vector<int32_t> light_of;
  std::vector<float> core_from_grid;
  std::vector<int32_t> instance_of_light;  // by light's row; -1: no volume

  bool any() const { return in_media.any() || in_emissions.any(); }
  bool any_moves() const {
    return in_media.motion.any_instances || in_emissions.motion.any_instances || (built::kMotion && grids.any_blurred);
  }
  int64_t memory_bytes() const;
  // Adds a grid and returns its number.
  int add_grid(GridInput grid);
  // Adds a blurred grid, of which and of its velocities these are the numbers, and returns its number.
  int add_blurred_grid(int grid, int velocity, double frame);
  // Add a medium or emission, for a scene that is recentred and scaled by `core_from_world`. They return the instances that are
  // left out because their matrix is singular or not finite, at any time.
  std::vector<int64_t> add_medium(const MediumInput& input, const daffine& core_from_world, double scale);
  std::vector<int64_t> add_emission(const VolumeEmissionInput& input, const daffine& core_from_world, double scale);
  void finish() { in_media.finish(), in_emissions.finish(); }
  // Integral over its space of the radiance that an instance emits per length, in the core's lengths.
  dvec3 emitted_intensity(size_t instance) const;

 private:
  void list_cells(Emission& emission);
};

}  // namespace primray
