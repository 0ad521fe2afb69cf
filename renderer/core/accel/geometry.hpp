// Embree geometry of all kinds of shapes: triangles, cutouts, tubes and their ends, user geometry over records, and instances
// as user geometry.
#pragma once

#include "embree/embree.hpp"
#include "motion/motion_table.hpp"
#include "scene/curved/curve_table.hpp"
#include "scene/scene.hpp"

namespace primray {

// Cutouts: Embree calls a filter at each hit, which tests whether the surface is present there.

// Sets the filter of triangles; `cutouts` must outlive the geometry.
void set_cutout_filter(rtc::Geometry geometry, const CutoutGroup& cutouts);
// Sets the filter of tubes; `first` of `cutouts` is a segment of the scene, and `cutouts` must outlive the geometry.
void set_tube_filter(rtc::Geometry geometry, const CutoutGroup& cutouts);

// Sets the filter of shadow rays, in tubes of which some are fibres; with the holes of `cutouts`, if these have any.
void set_fibre_filter(rtc::Geometry geometry, const CutoutGroup& cutouts, bool holes);

// Whether a segment of the scene's curves is hair, and whether some of a group's are.
bool is_fibre(const Scene& scene, size_t segment);
bool has_fibres(const Scene& scene, const CurveRange& range);
// Whether some of a group's curves have a surface with holes.
bool has_holes(const Scene& scene, const CurveRange& range);
// Whether there is a hole at end `end` of the scene's tubes, in an instance of that context.
bool is_end_hole(const Scene& scene, int32_t end, const rtc::RayQueryContext& context);

// Bounding boxes of moving instances, at evenly spaced times between which Embree interpolates them linearly.

// Box around the image of `b`, wider by `more`, and slightly wider for the rounding of rays.
rtc::Bounds bounds_around(const daffine& m, const rtc::Bounds& b, double more);

// Number of time segments for Embree.
int bound_segments(const MotionTable& table, const MovingInstances& moving);
// Box at the beginning of segment `step` of `segments`, or at the end of the last, of instance `instance` whose group has the
// bounds `b`: wide enough for boxes interpolated between two steps to hold the instance at all times between.
rtc::Bounds moving_bounds(const MotionTable& table, const MovingInstances& moving, int segments, uint32_t instance,
                          uint32_t step, const rtc::Bounds& b);

// Tubes in Embree: its round Bezier curves, which give single rays and packets the same bits (its flat and oriented curves do
// not), and user geometry for their ends, which Embree leaves open.

// Returns the tubes at `steps` times if they move; not committed yet.
OwnedGeometry make_tubes(const Scene& scene, const Group& group, const CurveRange& range, int steps);
// Returns the ends of tubes; `record` must outlive it.
OwnedGeometry make_tube_ends(const TubeEnds* record);

// Embree scenes and triangle geometry over the flat arrays, which are shared, not copied.

// Returns a new Embree scene with such flags.
inline OwnedScene new_embree_scene(int flags = rtc::kRobust) {
  OwnedScene s(embree().rtcNewScene(embree_device()));
  embree().rtcSetSceneFlags(s.get(), rtc::SceneFlags(flags));
  embree().rtcSetSceneBuildQuality(s.get(), rtc::BuildQuality(2));
  return s;
}

// Geometry of the group's vertices, without indices yet: at `steps` times, where the last of them move.
inline OwnedGeometry over_positions(rtc::GeometryType type, const Scene& scene, const Group& group, int steps = 1) {
  const rtc::Api& e = embree();
  OwnedGeometry g(e.rtcNewGeometry(embree_device(), type));
  if (steps > 1) e.rtcSetGeometryTimeStepCount(g.get(), uint32_t(steps));
  for (int k = 0; k < steps; ++k)
    e.rtcSetSharedGeometryBuffer(g.get(), rtc::kVertexBuffer, uint32_t(k), rtc::kFloat3, scene.positions.data(),
                                 (size_t(group.vertex_base) + size_t(k) * group.moving_vertex_count) * 12, 12,
                                 group.vertex_count);
  return g;
}

// Geometry of `count` of the group's triangles from `first` on.
inline OwnedGeometry make_triangles(const Scene& scene, const Group& group, uint32_t first, uint32_t count, int steps = 1) {
  OwnedGeometry g = over_positions(rtc::kTriangle, scene, group, steps);
  embree().rtcSetSharedGeometryBuffer(g.get(), rtc::kIndexBuffer, 0, rtc::kUint3, scene.indices.data(),
                                      (size_t(group.triangle_base) + first) * 12, 12, count);
  return g;
}

// Number of time steps of the group's moving vertices; 1 if none move.
inline int vertex_steps(const Scene& scene, const Group& group) {
  return group.clock < 0 ? 1 : scene.motion.clocks[size_t(group.clock)].segments() + 1;
}

// Callbacks of user geometry over an array of records, one primitive per record.
struct UserFunctions {
  rtc::BoundsFunction bounds;
  rtc::IntersectFunction intersect;
  rtc::OccludedFunction occluded;
};

// `user` is passed to the functions, and must outlive the geometry; `steps`: times between which Embree interpolates boxes
// linearly.
inline OwnedGeometry make_user_geometry(const void* user, uint32_t count, const UserFunctions& functions, uint32_t steps = 1) {
  const rtc::Api& e = embree();
  OwnedGeometry g(e.rtcNewGeometry(embree_device(), rtc::kUser));
  e.rtcSetGeometryUserPrimitiveCount(g.get(), count);
  e.rtcSetGeometryUserData(g.get(), const_cast<void*>(user));
  if (steps > 1) e.rtcSetGeometryTimeStepCount(g.get(), steps);
  e.rtcSetGeometryBoundsFunction(g.get(), functions.bounds, nullptr);
  e.rtcSetGeometryIntersectFunction(g.get(), functions.intersect);
  e.rtcSetGeometryOccludedFunction(g.get(), functions.occluded);
  e.rtcCommitGeometry(g.get());
  return g;
}

// Instances as user geometry: of scenes that have instances themselves, since Embree (as built) supports one level of
// instances, and those that move, since Embree's own moving instances give single rays other bits than packets.
//
// Each instance is one primitive: it transforms the ray into the group's space and traces the group's own scene. There is no
// field left for a hit in a nested instance, so its numbers are packed and unpacked again by `ray/ray.hpp`, the same for single
// rays and packets; other hits look like Embree's own.

// Whether placement number `placement` of the scene must be user geometry.
bool needs_placed_geometry(const Scene& scene, size_t placement);
// Returns the user geometry of instances [first, end). The accel of the group must have been committed.
PlacedGroup make_placed(const Scene& scene, size_t placement, uint32_t first, uint32_t end);
OwnedGeometry make_placed_geometry(const PlacedGroup* record);

}  // namespace primray
