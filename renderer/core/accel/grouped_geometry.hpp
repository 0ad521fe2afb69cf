// Instances of a scene that has instances itself: Embree (as built) follows one level of instances, this is the one above.
//
// A user geometry, one primitive an instance: it moves the ray into the group's space and traces the group's own scene. What it
// finds has no field left for both instances, so a hit's numbers are packed (`pack`) and taken apart again by
// `interaction.hpp`, the same for single rays and packets.
#pragma once

#include "accel/embree.hpp"
#include "math/lanes.hpp"

namespace primray {

// One placement of a group of instances. Must outlive its geometry.
struct GroupedPlacement {
  const float* matrices;           // 12 floats an instance: columns x, y, z, origin
  uint32_t first_instance, count;  // numbers of its instances
  uint32_t inner_base;             // the first placement inside the group
  rtc::Scene accel;                // the group's
  rtc::Bounds bounds;              // the group's, in its own space
};

// geom_id: the geometry in its lowest bits, above them the placement inside the group. inst_id: the highest bit, and the outer
// instance. inst_prim_id: the instance within the inner placement, as Embree gives it.
constexpr int kGeometryBits = 2;
constexpr uint32_t kGroupedBit = 0x80000000u;

template <int W>
struct GroupedHit {
  vbool<W> grouped;  // the rest is for these lanes
  vint<W> geom, placement, outer;
  GroupedHit(vbool<W> instanced, vint<W> geom_id, vint<W> inst_id)
      : grouped(instanced & (inst_id < vint<W>(-1))),
        geom(geom_id & vint<W>((1 << kGeometryBits) - 1)),
        placement(geom_id >> kGeometryBits),
        outer(inst_id & vint<W>(0x7fffffff)) {}
};

// The record's accel must have been committed.
GroupedPlacement make_grouped(const float* matrices, uint32_t first_instance, uint32_t count, uint32_t inner_base,
                              rtc::Scene accel);
OwnedGeometry make_grouped_geometry(const GroupedPlacement* record);

}  // namespace primray
