// Records that user geometry and filters keep beside their Embree geometry, which holds pointers to these.
#pragma once

#include "embree/embree.hpp"

namespace primray {

struct MotionClock;
struct MovingInstances;
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

}  // namespace primray
