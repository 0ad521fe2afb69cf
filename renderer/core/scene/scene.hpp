// The scene as the core renders it: flat float arrays, relative to the camera and scaled, joined by indices. Knows no USD.
//
// This folder: scene.hpp and the tables beside it are the data, which build/ fills from double-precision input; camera.hpp
// generates camera rays. accel/ builds Embree scenes of it, surface/ evaluates what varies over shapes, light/ and bsdf/ read
// their tables, integrator/ traces paths through it. A `Group` is geometry with its own Embree scene: group 0 is everything
// placed once, in world space; the others are prototypes in their own space, placed by instances. A prototype may consist of
// instances, and has no shapes then: Embree supports one level of instances, so such a prototype is placed by
// accel/geometry.
#pragma once

#include <compare>
#include <cstdint>
#include <deque>
#include <memory>
#include <utility>
#include <vector>

#include "bsdf/surface.hpp"
#include "bsdf/surface_inputs.hpp"
#include "bvh/few_triangles.hpp"
#include "bvh/pairs.hpp"
#include "bvh/triangle_bvh.hpp"
#include "embree/embree.hpp"
#include "light/light.hpp"
#include "math/matrix.hpp"
#include "motion/motion_table.hpp"
#include "pattern/tape.hpp"
#include "ray/ray.hpp"
#include "scene/camera.hpp"
#include "scene/curved/curve_table.hpp"
#include "scene/curved/curved_shapes.hpp"
#include "scene/emitter_table.hpp"
#include "scene/fog.hpp"
#include "scene/light_outline_table.hpp"
#include "texture/texture.hpp"
#include "volume/volume_table.hpp"

namespace primray {

// Records that user geometry and filters keep beside their Embree geometry, which holds pointers to these.

struct Scene;

// Data for the filters of a group's cutout triangles.
struct CutoutGroup {
  const Scene* scene;
  uint32_t group;
  uint32_t first;  // first triangle of the geometry, counted in the group
};

// Ends of a group's tubes, static or moving.
struct TubeEnds {
  const Scene* scene;
  uint32_t group;
  uint32_t first, count;  // range of CurveTable::ends
  int steps;              // number of times at which control points are given
};

// A placement that is user geometry. Must outlive it.
struct PlacedGroup {
  const Scene* scene;
  uint32_t first_instance, count;  // rows of Scene::world_from_group
  bool grouped;                    // it places placements
  uint32_t inner_base;             // the first of those
  rtc::Scene accel;                // scene of the group that it places
  rtc::Bounds bounds;              // bounds of that group, in its own space
  const MovingInstances* moving;   // null: none moves
  int bound_segments;              // number of time segments for Embree
  const MotionClock* warp;         // the group's motion samples, if Embree's times are not rays' times; otherwise null
};

// Participating media inside closed surfaces: which surfaces bound them, what is inside, and which of them contain the camera.

// Maximum number of nested objects around a point; beyond, the outermost are dropped.
constexpr int kMaxNestedMedia = 4;

// Homogeneous medium inside a closed shape, per unit of the core's lengths; `emission` is radiance per length.
struct Volume {
  vec3 extinction, scattering, emission;
  float phase;  // see medium/phase_function.hpp
  CameraVisibility camera;
};
// A volume that contains a point: the shape, and the instance that places it (-1: none).
struct VolumeObject {
  int32_t volume, instance, outer;
  auto operator<=>(const VolumeObject&) const = default;
};

struct Interiors {
  bool followed = false;               // paths track the stack of media that they are in
  bool lit = false;                    // some light is inside a medium
  float per_length = 1;                // world units per unit of the core's lengths
  std::vector<int32_t> bounds_medium;  // by surface: 1 or 0
  std::vector<float> priorities;   // by surface: where objects overlap the one of higher priority prevails; empty: all equal
  std::vector<int32_t> object_of;  // by surface: representative of the surfaces that bound the same object; empty: each bounds
                                   // its own
  int32_t camera[kMaxNestedMedia] = {-1, -1, -1, -1};  // surfaces of the objects that contain the camera, the innermost first
  float camera_index2 = 1;                             // square of the index of refraction around the camera
  // Media of closed shapes without an interface (medium/volume_sets.hpp): the volume that each surface bounds, or -1; empty if
  // there is none.
  std::vector<int32_t> volume_of;
  std::vector<Volume> volumes;
  std::vector<VolumeObject> camera_volumes;  // around the camera, in order
  // Surfaces with an interface whose interior is another medium than the one of their lobes; and emission by surface, empty if
  // no such medium emits.
  std::vector<std::pair<int32_t, VolumeInput>> filled;
  std::vector<vec3> emission;
  bool emits = false;  // some medium emits
  bool walks = false;  // light walks below some opaque surface
  bool around_camera() const { return camera[0] >= 0; }
  Fog fog;  // outside of objects with an interface
  bool has_bounded() const { return !volumes.empty(); }
  bool has_added() const { return has_bounded() || fog.any(); }
};

// Object spaces of shapes within their groups, for surfaces whose patterns read them.
struct ObjectSpaces {
  // 12 floats each: columns x, y, z, origin. The first is the group's own space, for all shapes that do not read theirs.
  std::vector<float> group_from_object, object_from_group;
  // Index of the space by row of the MeshTable and the CurvedTable; may be shorter than these.
  std::vector<int32_t> of_mesh, of_curved;

  bool any() const { return !group_from_object.empty(); }
  void put(size_t number, const daffine& m) {
    // A degenerate matrix has no inverse: the shape's space is then its group's.
    const daffine own = is_regular(m) ? m : kItself;
    const size_t at = 12 * number;
    if (group_from_object.size() < at + 12) group_from_object.resize(at + 12), object_from_group.resize(at + 12);
    put_columns(own, &group_from_object[at]), put_columns(inverse(own), &object_from_group[at]);
  }
  // Adds a space and returns its index.
  int32_t add(const daffine& m) {
    if (!any()) put(0, kItself);
    put(group_from_object.size() / 12, m);
    return int32_t(group_from_object.size() / 12) - 1;
  }

 private:
  static inline const daffine kItself{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, dvec3(0.0)};
};

// Primvars that surface inputs read by name: one flat array of values, and a table of the shapes that have them.

// Order as in scene_upload.
enum class PrimvarKind : int32_t { kConstant, kFace, kPoint, kCorner, kInstance };

struct PrimvarTable {
  std::vector<float> values;
  // Columns by primvar: interpolation, components per row (1 to 4), and the offset of its first row.
  std::vector<int32_t> kind, width, base;
  // Primvar by (owner, name), or -1. Names are those that some surface reads, numbered from 0.
  int names = 0;
  std::vector<int32_t> of_mesh, of_curved, of_placement;

  int32_t add(PrimvarKind k, int w, int32_t at) {
    kind.push_back(int32_t(k)), width.push_back(w), base.push_back(at);
    return int32_t(kind.size()) - 1;
  }
};

// Embree geometry ids in every group: triangles, cutout triangles, pairs of triangles (bvh/pairs.hpp), moving triangles and
// cutouts, those of curved shapes (scene/curved), tubes and their ends, static and moving ones, and after them the group's
// placements.
constexpr uint32_t kTriangleGeometry = 0, kCutoutGeometry = 2, kMovingGeometry = 4, kMovingCutoutGeometry = 5,
                   kCurveGeometry = 6, kCurveEndGeometry = 7, kMovingCurveGeometry = 8, kMovingCurveEndGeometry = 9,
                   kFirstPlacement = 1 << kGeometryBits;
static_assert(kPairGeometry < kFirstPlacement && kMovingCurveEndGeometry < kFirstPlacement &&
              CurvedKinds::kLastGeometry < kFirstPlacement);

enum class Attribute : int32_t { kNone = 0, kTriangle = 1, kVertex = 2, kCorner = 3 };

// Data shared by the triangles of one mesh with one surface; gathered by lane, hence one array per field.
struct MeshTable {
  std::vector<int32_t> surface, normals, colors;    // colours and normals: Attribute
  std::vector<int32_t> normal_base, color_base;     // offsets in floats into Scene::normals, ::colors
  std::vector<int32_t> triangle_base, vertex_base;  // this mesh's first triangle and vertex, by index over the scene
  std::vector<int32_t> link;                        // row of the lights' LinkTable; empty if there is none
  std::vector<int32_t> normal_stride;  // for moving vertices: distance from one time's normals to the next's, in floats; 0:
                                       // constant
};

struct Group {
  uint32_t triangle_base = 0, triangle_count = 0;
  uint32_t paired_count = 0;                           // number of leading triangles that Embree has as pairs
  uint32_t cutout_count = 0;                           // triangles after those, which have a filter
  uint32_t moving_count = 0, moving_cutout_count = 0;  // moving triangles after those, without and with a filter
  uint32_t vertex_base = 0, vertex_count = 0;          // at one time
  uint32_t moving_vertex_count = 0;                    // number of trailing vertices that move, stored again for each later
                                                       // motion sample
  int32_t clock = -1;                                  // motion samples of its vertices
  CurvedRanges curved;
  CurveGroup curves;
  uint32_t placement_base = 0, placement_count = 0;  // placements in it: in the world, or in a prototype without shapes
  OwnedScene accel;
  OwnedScene curve_accel;  // of the world: its curves, if it has any (accel/build.cpp)
  uint32_t still_count() const { return triangle_count + cutout_count; }
  uint32_t all_triangles() const { return still_count() + moving_count + moving_cutout_count; }
  bool empty() const { return all_triangles() + placement_count == 0 && !curved.any() && !curves.any(); }
};

struct Scene {
  Scene() = default;
  Scene(const Scene&) = delete;

  // Triangles of all groups; indices count from their group's first vertex.
  std::vector<float> positions;  // x, y, z; padded by one float at the end, which Embree may read
  std::vector<uint32_t> indices;
  std::vector<int32_t> triangle_mesh;
  std::vector<float> normals, colors;
  MeshTable meshes;

  CurvedTable curved;
  CurveTable curves;

  std::vector<Group> groups;

  // Instances, all placements one after the other.
  std::vector<float> world_from_group;      // 12 floats per instance: columns x, y, z, origin (for one in a prototype: to the
                                            // prototype's space)
  std::vector<int32_t> placement_group;     // by placement
  std::vector<int32_t> placement_instance;  // first instance, by placement
  std::deque<PlacedGroup> placed;           // placements that are user geometry; Embree holds pointers to them
  std::deque<CutoutGroup> cutouts;          // of groups with cutouts; Embree holds pointers to them
  std::deque<TubeEnds> tube_ends;           // Embree holds pointers to them

  SurfaceTable surfaces;
  // Index of the varying inputs of each surface, or -1.
  std::vector<int32_t> surface_inputs_of;
  std::vector<SurfaceInputs> surface_inputs;
  std::vector<Tape> tapes;
  ObjectSpaces object_spaces;
  std::vector<Texture> textures;
  PrimvarTable primvars;
  LightTable lights;
  EmitterTable emitters;
  GeometryLights geometry_lights;
  Camera camera;
  std::unique_ptr<Distortion> distortion;  // the camera's
  LightOutlines outlines;
  Interiors interiors;
  CameraVisibilityTable camera_visibility;
  MotionTable motion;
  std::unique_ptr<VolumeTable> volumes;  // null: none

  // world = origin + p / scale, in scene units.
  dvec3 origin{0.0, 0.0, 0.0};
  double scale = 1.0;

  // Facts of the scene that save work where they are false.
  Fact<built::kInstances> has_instances = false;    // otherwise no hit has an instance
  Fact<built::kInstances> has_grouped = false;      // some instances are nested
  Fact<built::kAttributes> has_attributes = false;  // smooth normals or varying colours
  Fact<built::kTextures> has_inputs = false;        // some surface has varying inputs
  Fact<built::kCutouts> has_cutouts = false;        // some triangles have a filter
  Fact<built::kEmission> has_emission = false;
  bool rays_find_light = false;              // domes, area lights or emission that a scattered ray could hit
  bool only_domes_found = false;             // ... only domes among these, for which an occlusion test suffices
  bool only_hierarchy_lights_found = false;  // ... or only lights in LightTable::hierarchy
  bool has_pairs = false;                    // some groups begin with triangles in pairs
  Fact<built::kThin> has_thin = false;       // something lets light pass straight
  bool shadows_need_hits = false;            // ... other than fibres, whose walls let out what is within them
  bool has_smooth_glass = false;
  int sort_shift = -1;  // of the numbers of surfaces, by which hits are sorted; -1: they are not sorted

  // All geometry, if it consists of triangles alone: few, or many. The world has no Embree scene then (accel/query.hpp).
  FewTriangles few_triangles;
  TriangleBvh triangle_bvh;

  rtc::Scene accel() const { return groups[0].accel.get(); }
  rtc::Scene curve_accel() const { return groups[0].curve_accel.get(); }
  // Whether rays have times.
  bool moves() const {
    return camera.moves || motion.any_instances || motion.any_points || lights.any_moves() || (volumes && volumes->any_moves());
  }
  // Whether it has something that this build lacks (base/features.hpp).
  bool needs_left_out() const;
  int64_t memory_bytes() const;
  int64_t texture_bytes() const;
};

}  // namespace primray
