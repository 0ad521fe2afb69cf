// Encoding of hits in nested instances: the ids of both levels, packed into the fields that Embree has for one.
#pragma once

#include "math/lanes.hpp"

namespace primray {

// geom_id: the geometry in its lowest bits, above them the placement inside the group. inst_id: the highest bit, and the outer
// instance. inst_prim_id: the instance within the inner placement, as Embree returns it.
constexpr int kGeometryBits = 4;
constexpr uint32_t kGroupedBit = 0x80000000u;

template <int W>
struct GroupedHit {
  vbool<W> grouped;  // lanes with a nested instance, for which the rest is valid
  vint<W> geom, placement, outer;
  GroupedHit(vbool<W> instanced, vint<W> geom_id, vint<W> inst_id)
      : grouped(instanced & (inst_id < vint<W>(-1))),
        geom(geom_id & vint<W>((1 << kGeometryBits) - 1)),
        placement(geom_id >> kGeometryBits),
        outer(inst_id & vint<W>(0x7fffffff)) {}
};

}  // namespace primray
