// What geometry of ours with callbacks keeps beside its Embree geometry, which holds pointers to these.
#pragma once

#include "embree/embree.hpp"

namespace primray {

struct Scene;

// What the filters of a group's cut-out triangles need to know.
struct CutoutGroup {
  const Scene* scene;
  uint32_t group;
};

// One placement of a group of instances. Must outlive its geometry.
struct GroupedPlacement {
  const float* matrices;           // 12 floats an instance: columns x, y, z, origin
  uint32_t first_instance, count;  // numbers of its instances
  uint32_t inner_base;             // the first placement inside the group
  rtc::Scene accel;                // the group's
  rtc::Bounds bounds;              // the group's, in its own space
};

}  // namespace primray
