// The numbers of a hit in an instance that stands in another instance, packed into the fields that Embree has for one.
#pragma once

#include "math/lanes.hpp"

namespace primray {

// geom_id: the geometry in its lowest bits, above them the placement inside the group. inst_id: the highest bit, and the outer
// instance. inst_prim_id: the instance within the inner placement, as Embree gives it.
constexpr int kGeometryBits = 4;
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

}  // namespace primray
