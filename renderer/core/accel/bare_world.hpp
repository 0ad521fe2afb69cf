// A moving scene as one would build it with Embree alone, for comparison: time steps of vertices, and Embree's own moving
// instances.
#pragma once

#include <deque>
#include <vector>

#include "scene/scene.hpp"

namespace primray {

class BareWorld {
 public:
  // Builds from a scene of triangles and their instances, whose motion samples are evenly spaced. Throws Error("internal", ...)
  // for any other.
  explicit BareWorld(const Scene& scene);
  rtc::Scene get() const { return world_.get(); }

 private:
  OwnedScene make(const Scene& scene, const Group& group);
  OwnedGeometry instances(const Scene& scene, const Group& group, uint32_t placement);
  void set_steps(rtc::Geometry geometry, const MotionTable& table, const MovingInstances& moving);

  std::deque<OwnedScene> prototypes_;
  std::deque<std::vector<float>> turning_;  // as Embree reads quaternions, one for each time of a placement
  OwnedScene world_;
};

}  // namespace primray
