// A moving world as one would build it with Embree alone, for what is compared with that: time steps of vertices, and Embree's
// own instances that move.
#pragma once

#include <deque>
#include <vector>

#include "scene/scene.hpp"

namespace primray {

class BareWorld {
 public:
  // Of a scene of triangles, and instances of such, whose clocks are even. Error("internal", ...) for any other.
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
