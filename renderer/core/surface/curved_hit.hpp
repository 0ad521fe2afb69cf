// Hits on curved shapes: which shape, and the point on it; on tubes also the curve and the position along it.
#pragma once

#include "base/flush_denormals.hpp"
#include "surface/hit_group.hpp"

namespace primray {

// Position of a hit among the curves of its set, by segment: primvars over curves are interpolated by it.
template <int W>
struct CurvePlace {
  vbool<W> is{false}, is_end{false};
  bool any_is = false;
  vint<W> row{0}, segment{0}, end{0};  // row of the CurvedTable; segment and end indices over the scene
  vfloat<W> u{0.0f}, longer{0.0f};     // parameter along the segment, and along the part of it that Embree has, [0, 1]

  CurvePlace() = default;
  PRIMRAY_INLINE CurvePlace(const Scene& scene, const HitGroup<W>& in, vbool<W> active, const Hits<W>& h) {
    if (scene.curves.any) find(scene, in, active, h);
  }

 private:
  PRIMRAY_RARE void find(const Scene& scene, const HitGroup<W>& in, vbool<W> active, const Hits<W>& h) {
    using I = vint<W>;
    const I zero(0);
    const vbool<W> still = in.is(active, kCurveGeometry), moving = in.is(active, kMovingCurveGeometry);
    const vbool<W> end_still = in.is(active, kCurveEndGeometry), end_moving = in.is(active, kMovingCurveEndGeometry);
    is_end = end_still | end_moving, is = still | moving | is_end, any_is = primray::any(is);
    if (!any_is) return;
    const auto base = [&](auto field) { return in.base(scene, field); };
    segment = select(still, base([](const Group& g) { return g.curves.still.segment; }) + h.prim, zero);
    segment = select(moving, base([](const Group& g) { return g.curves.moving.segment; }) + h.prim, segment);
    longer = select(still | moving, h.u, 0.0f);
    if (primray::any(is_end)) {
      end = select(end_still, base([](const Group& g) { return g.curves.still.end; }) + h.prim, zero);
      end = select(end_moving, base([](const Group& g) { return g.curves.moving.end; }) + h.prim, end);
      const int32_t* ends = reinterpret_cast<const int32_t*>(scene.curves.ends.data());
      const I at = end * I(kCurveEndFields);
      segment = select(is_end, gather<W>(ends, at), segment);
      const I kind = gather<W>(ends + 1, at);
      longer = select(is_end & (kind == I(int32_t(CurveEndKind::kEnd))), 1.0f, longer);
      longer = select(is_end & (kind == I(int32_t(CurveEndKind::kJoint))), kBeyond, longer);
    }
    u = clamp(longer * (1.0f + 2 * kBeyond) - kBeyond, 0.0f, 1.0f);
    row = select(is, gather<W>(scene.curves.row.data(), gather<W>(scene.curves.run.data(), segment)), zero);
  }
};

// Control points with the radius as w, interpolated in time where they move.
template <int W>
PRIMRAY_INLINE FourLanes<float, W> gather_control(const CurveTable& table, vint<W> point, const VertexMotion<W>& motion) {
  const auto at = [&](vint<W> p) { return gather_four<W>(table.points.data(), p * vint<W>(4)); };
  if (!motion.any) return at(point);
  const FourLanes<float, W> a = at(point + select(motion.moves, motion.segment * motion.stride, vint<W>(0)));
  const FourLanes<float, W> b = at(point + select(motion.moves, (motion.segment + vint<W>(1)) * motion.stride, vint<W>(0)));
  const auto mix = [&](vfloat<W> x, vfloat<W> y) {
    return select(motion.moves, x * (1.0f - motion.within) + y * motion.within, x);
  };
  return {mix(a.x, b.x), mix(a.y, b.y), mix(a.z, b.z), mix(a.w, b.w)};
}

// Point on a tube, in the group's space.
template <int W>
struct CurvePoint {
  vvec3<W> p, normal;  // on the tube; outwards, of any length
  vvec3<W> spread;     // magnitude of what was rounded in computing p, by axis
  vvec3<W> along;      // dP/du of the curve, not 0
  vfloat<W> radius;    // 0 on ends

  // Hits on tubes carry Embree's normal, whose part across the tangent tells the position around the tube; hits on ends carry
  // the position on their disc or ball.
  PRIMRAY_RARE CurvePoint(const Scene& scene, const HitGroup<W>& in, const CurvePlace<W>& place, const Hits<W>& h) {
    using F = vfloat<W>;
    using I = vint<W>;
    using V = vvec3<W>;
    const I zero(0);
    VertexMotion<W> motion;
    const vbool<W> moves = in.is(place.is, kMovingCurveGeometry) | in.is(place.is, kMovingCurveEndGeometry);
    if (any(moves))
      motion.set(scene.motion, moves, in.base(scene, &Group::clock),
                 in.base(scene, [](const Group& g) { return g.curves.moving_points; }), h.time);
    const I base = select(place.is, in.base(scene, [](const Group& g) { return g.curves.point_base; }), zero);
    const I first = base + gather<W>(scene.curves.first_point.data(), place.segment);
    V c[4];
    F r[4];
    for (int k = 0; k < 4; ++k) {
      const FourLanes<float, W> q = gather_control(scene.curves, select(place.is, first + I(k), zero), motion);
      c[k] = {q.x, q.y, q.z}, r[k] = q.w;
    }
    const V e1 = c[1] - c[0], e2 = c[2] - c[0], e3 = c[3] - c[0];
    const F u = place.longer, v = 1.0f - u;
    const F b1 = 3.0f * u * v * v, b2 = 3.0f * u * u * v, b3 = u * u * u;
    const V centre = c[0] + (e1 * b1 + e2 * b2 + e3 * b3);
    radius = r[0] + ((r[1] - r[0]) * b1 + (r[2] - r[0]) * b2 + (r[3] - r[0]) * b3);
    along = (e1 * (v * v) + (e2 - e1) * (2.0f * u * v) + (e3 - e2) * (u * u)) * 3.0f;
    const V bend = ((e2 - e1 * 2.0f) * v + (e3 - e2 * 2.0f + e1) * u) * 6.0f;
    const F narrowing = ((r[1] - r[0]) * (v * v) + (r[2] - r[1]) * (2.0f * u * v) + (r[3] - r[2]) * (u * u)) * 3.0f;
    const F size = max(max_component(abs(e1)), max(max_component(abs(e2)), max_component(abs(e3))));
    // Where control points coincide, the curve takes its direction from those that do not.
    const vbool<W> is_fixed = max_component(abs(along)) <= size * 1e-6f;
    along = select(is_fixed, select(u < F(0.5f), e2, e3 - e1), along);
    along = select(max_component(abs(along)) <= size * 1e-6f, e3, along);
    along = select(max_component(abs(along)) > F(0.0f), along, V(F(1.0f), F(0.0f), F(0.0f)));

    // The surface is C + r R with R across C', so its derivative along the curve is C' (1 - r R.C'' / |C'|^2) + r' R.
    const F along2 = max(dot(along, along), 1e-36f);
    const V ng = select(place.is_end, V(F(0.0f), F(0.0f), F(1.0f)), h.ng);
    const V about = ng * (1.0f / max(max_component(abs(ng)), kLeastNormal));
    const V across = direction_of(about - along * (dot(about, along) / along2));
    normal = across * max(along2 - radius * dot(across, bend), along2 * 0.05f) - along * narrowing;
    p = centre + select(place.is_end, h.ng, across) * radius;
    if (any(place.is_end)) set_end(scene, place, h, base, motion, normal, along);

    // Embree's roots are off by some parts in 2^24 of a segment's size.
    spread = abs(c[0]) + V(radius + 2.0f * size);
    radius = select(place.is_end, 0.0f, radius);
  }

 private:
  PRIMRAY_RARE static void set_end(const Scene& scene, const CurvePlace<W>& place, const Hits<W>& h, vint<W> base,
                                   const VertexMotion<W>& motion, vvec3<W>& normal, vvec3<W>& along) {
    using F = vfloat<W>;
    using I = vint<W>;
    const int32_t* ends = reinterpret_cast<const int32_t*>(scene.curves.ends.data());
    const I record = place.end * I(kCurveEndFields), zero(0);
    const auto control = [&](int field) {
      return gather_control(scene.curves, select(place.is_end, base + gather<W>(ends + field, record), zero), motion);
    };
    const FourLanes<float, W> at = control(2), before = control(3), after = control(4);
    const vvec3<W> centre{at.x, at.y, at.z};
    const vvec3<W> outwards = centre * 2.0f - vvec3<W>(before.x + after.x, before.y + after.y, before.z + after.z);
    const vbool<W> joint = place.is_end & (gather<W>(ends + 1, record) == I(int32_t(CurveEndKind::kJoint)));
    normal = select(place.is_end, select(joint, h.ng, outwards), normal);
    const vvec3<W> left = along - h.ng * dot(along, h.ng);
    along = select(joint & (max_component(abs(left)) > F(0.0f)), left, along);
  }
};

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
