// Hits on curved shapes: which shape, and the point on it.
#pragma once

#include "surface/curve_hit.hpp"
#include "surface/hit_group.hpp"

namespace primray {

// Row of the CurvedTable of the shapes that lanes `active` hit; 0 in other lanes.
template <int W>
PRIMRAY_INLINE vint<W> curved_row(const Scene& scene, const HitGroup<W>& in, vbool<W> active, const Hits<W>& h) {
  vint<W> row(0);
  for_curved_kinds([&]<class K>(K) {
    if (!scene.curved.has<K>()) return;
    const vint<W> first = in.base(scene, [](const Group& g) { return g.curved.template of<K>().first_row; });
    row = select(in.is(active, K::kGeometry), first + h.prim, row);
  });
  return row;
}

template <int W>
struct CurvedHit {
  vbool<W> is{false};
  bool any_is = false;
  vint<W> row{0};
  CurvePlace<W> curve;  // of lanes on curves
  vvec3<W> along;       // only if curve.any_is: dP/du of these lanes, in the group's space
  vfloat<W> radius;     // only if curve.any_is
  CurvedPoint<W> at{vvec3<W>(vfloat<W>(0.0f)), vvec3<W>(vfloat<W>(0.0f)), vvec3<W>(vfloat<W>(0.0f))};  // valid if the shape is
                                                                                                       // of that kind

  PRIMRAY_INLINE CurvedHit(const Scene& scene, const HitGroup<W>& in, vbool<W> active, const Hits<W>& h) {
    for_curved_kinds([&]<class K>(K) {
      if (!scene.curved.has<K>()) return;
      const vbool<W> m = in.is(active, K::kGeometry);
      if (!any(m)) return;
      const vint<W> first = in.base(scene, [](const Group& g) { return g.curved.template of<K>().first; });
      const vint<W> first_row = in.base(scene, [](const Group& g) { return g.curved.template of<K>().first_row; });
      const vint<W> zero(0);
      const CurvedPoint<W> found = K::at(scene.curved.records<K>(), select(m, first + h.prim, zero), h);
      is |= m, any_is = true;
      row = select(m, first_row + h.prim, row);
      at.p = select(m, found.p, at.p), at.normal = select(m, found.normal, at.normal);
      at.spread = select(m, found.spread, at.spread);
    });
    if (!scene.curves.any) return;
    curve = CurvePlace<W>(scene, in, active, h);
    if (!curve.any_is) return;
    const CurvePoint<W> found(scene, in, curve, h);
    is |= curve.is, any_is = true;
    row = select(curve.is, curve.row, row), along = found.along, radius = found.radius;
    at.p = select(curve.is, found.p, at.p), at.normal = select(curve.is, found.normal, at.normal);
    at.spread = select(curve.is, found.spread, at.spread);
  }
};

}  // namespace primray
