// What geometry of ours with callbacks keeps beside its Embree geometry, which holds pointers to these.
#pragma once

#include "embree/embree.hpp"

namespace primray {

struct MotionClock;
struct MovingInstances;
struct Scene;

// What the filters of a group's cut-out triangles need to know.
struct CutoutGroup {
  const Scene* scene;
  uint32_t group;
  uint32_t first;  // of the group's triangles, that of the geometry
};

// What closes the tubes of a group, its still ones or those that move.
struct TubeEnds {
  const Scene* scene;
  uint32_t group;
  uint32_t first, count;  // of CurveTable::ends
  int steps;              // times at which control points are known
};

// A placement that is user geometry. Must outlive it.
struct PlacedGroup {
  const Scene* scene;
  uint32_t first_instance, count;  // rows of Scene::world_from_group
  bool grouped;                    // what it places are placements
  uint32_t inner_base;             // the first of those
  rtc::Scene accel;                // of the group that it places
  rtc::Bounds bounds;              // of that group, in its own space
  const MovingInstances* moving;   // null: all stand still
  int bound_segments;              // that Embree is told of
  const MotionClock* warp;         // the group's own, where Embree's times are not rays' times; else null
};

}  // namespace primray
