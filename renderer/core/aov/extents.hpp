// Extents of parts of a scene: on the film, in depth, and in axes of their own.
//
// A part is a row of meshes or curved shapes in the world, or in one instance. Triangles are bounded by their vertices, and by
// points along their edges where the lens or the rolling shutter bends these; spheres by their outlines; curves by discs
// across them. What is behind a pinhole's near plane is cut off.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "math/matrix.hpp"
#include "scene/scene.hpp"

namespace primray {

struct ScenePart {
  int32_t shape;            // as in FirstHitPlanes
  int32_t instance, outer;  // rows of Scene::world_from_group; -1: none
  int32_t axes;             // the axes that it is measured in
};

struct Extent {
  static constexpr double kNone = std::numeric_limits<double>::infinity();
  double film[4] = {kNone, kNone, -kNone, -kNone};  // pixels of the frame: left, top, right, bottom
  double nearest = kNone;                           // along the camera's axis, scene units; of what is in front of it
  dvec3 low{kNone, kNone, kNone}, high{-kNone, -kNone, -kNone};
  int64_t unseen = 0;  // points that the camera does not see in any direction
};

// Returns the parts of each group: (group, shape).
std::vector<std::pair<int32_t, int32_t>> shapes_of_groups(const Scene& scene);

// Returns the extent of each part at the frame's time; on the film at the time of its row and column, with a rolling shutter.
// `axes`: from the world, in scene units.
std::vector<Extent> find_extents(const Scene& scene, int threads, const std::vector<ScenePart>& parts,
                                 const std::vector<daffine>& axes);

// Triangles of a part at the frame's time: those of meshes; spheres as grids of kSphereRings rings; curves as tubes of
// kTubeSides sides, without caps.
struct PartSurface {
  static constexpr uint32_t kSphereRings = 32, kTubeSides = 8;
  std::vector<dvec3> points;      // world, scene units
  std::vector<uint32_t> corners;  // three points a triangle, counterclockwise from outside
};
PartSurface find_surface(const Scene& scene, const ScenePart& part);

// Where the camera sees points of the world, which stay where they are; `seen` is false for those that it sees nowhere.
struct ProjectedPoint {
  bool seen;
  double x, y;   // pixels of the frame
  double depth;  // along the camera's axis at the frame's time, scene units
};
std::vector<ProjectedPoint> project_points(const Scene& scene, const std::vector<dvec3>& world);

}  // namespace primray
