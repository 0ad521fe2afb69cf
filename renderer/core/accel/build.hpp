// Builds Embree scenes for the groups of a Scene: prototypes first, then the top-level scene (the world), which has the
// placements and all geometry that is not instanced. A world of triangles alone is traced without Embree (accel/query.hpp).
#pragma once

#include "accel/trace.hpp"
#include "scene/scene.hpp"

namespace primray {

// Fills groups[].accel, or few_triangles or triangle_bvh in place of the world's. Positions, indices, records and matrices are
// shared with Embree, so the Scene must not move or grow afterwards.
void build_accel(Scene& scene);

// The world in Embree, built for comparisons even where the scene has it in another structure.
class EmbreeWorld {
 public:
  explicit EmbreeWorld(const Scene& scene);
  rtc::Scene get() const { return scene_; }
  bool apart() const { return own_.get() != nullptr; }

  // Converts hits to the scene's numbering of geometry.
  template <int W>
  Hits<W> in_scene(Hits<W> h) const {
    if (!apart()) return h;
    const vint<W> triangle{int32_t(kTriangleGeometry)};
    h.prim = select(h.geom == triangle, h.prim + vint<W>(int32_t(paired_)), h.prim);
    h.geom = select(h.geom == vint<W>(int32_t(kPairGeometry)), triangle, h.geom);
    return h;
  }

 private:
  OwnedScene own_;
  rtc::Scene scene_;
  uint32_t paired_ = 0;
};

}  // namespace primray
