// Scenes of few triangles: a packet of rays is tested against runs of triangles whose boxes it hits, which for a room with some
// blocks takes a third of the time of a hierarchy.
//
// As in Embree's robust mode, a ray is inside a triangle if it passes all three edges on the same side (Pluecker 1865). Edges
// are directed from the lesser of their points to the greater, so triangles that share one agree to the bit on which side the
// ray passes, even across meshes: no ray finds a gap. Everything is relative to the ray's origin, so geometry near it is as
// precise as its coordinates are.
#pragma once

#include <cstdint>
#include <vector>

#include "ray/ray.hpp"

namespace primray {

struct FewTriangles {
  static constexpr uint32_t kMost = 1024, kMostInRun = 16;

  // Point at which the next `edges` edges begin.
  struct Point {
    float at[3];
    uint32_t edges;
  };
  struct Edge {
    float along[3];
  };
  struct Triangle {
    float normal[3];    // cross product of its edges
    float point[3];     // a corner
    int32_t edge[3];    // opposite corners 0, 1, 2; counted in the run
    int32_t turned[3];  // the sign bit if it runs the other way along that edge
    int32_t number;     // in the group
  };
  struct Run {
    float low[3], high[3];
    uint32_t points, edges, triangles;  // counts; those of the runs before precede them
  };
  std::vector<Point> points;
  std::vector<Edge> edges;
  std::vector<Triangle> triangles;
  std::vector<Run> runs;
  bool any() const { return !runs.empty(); }
};

// Gathers a group's `count` triangles, if they are few enough; otherwise none.
FewTriangles gather_few(const float* positions, const uint32_t* indices, uint32_t count);

// Distance outside an edge within which a ray still hits, relative to the sum of the triangle's three sides: as in Embree, so
// that edges which only touch, without sharing points, leave no gap either.
constexpr float kEdgeTolerance = 0x1p-23f;

template <int W>
class FewLanes {
 public:
  PRIMRAY_INLINE FewLanes(const FewTriangles& few, const Rays<W>& rays)
      : few_(few), o_(rays.o), d_(rays.d), tnear_(rays.tnear) {}

  // Calls `on_hit(triangle, lanes, t, sides)` for every triangle that some lanes pass through, at t; `far()` is the current
  // distance limit, and `left()` the lanes that are still tested.
  template <class Far, class Left, class OnHit>
  PRIMRAY_INLINE void visit(const Far& far, const Left& left, const OnHit& on_hit) const {
    alignas(64) float side[3 * FewTriangles::kMostInRun][W];
    // Copies that nothing can alias stay in registers.
    const vvec3<W> o = o_, d = d_, per_d{inverse(d.x), inverse(d.y), inverse(d.z)};
    const FewTriangles::Point* point = few_.points.data();
    const FewTriangles::Edge* edge = few_.edges.data();
    const FewTriangles::Triangle* triangle = few_.triangles.data();
    for (const FewTriangles::Run& run : few_.runs) {
      const FewTriangles::Triangle* const triangles_end = triangle + run.triangles;
      // A ray is tested in boxes that it enters itself, whatever the others do: no bit depends on the lane count.
      const vbool<W> here = left() & passes(run, o, per_d, far());
      if (!any(here)) {
        point += run.points, edge += run.edges, triangle = triangles_end;
        continue;
      }
      float (*to)[W] = side;
      for (const FewTriangles::Point* const end = point + run.points; point < end; ++point) {
        const vvec3<W> a = constant(point->at) - o;
        const vvec3<W> moment{difference(a.y, d.z, a.z, d.y), difference(a.z, d.x, a.x, d.z), difference(a.x, d.y, a.y, d.x)};
        for (uint32_t i = 0; i < point->edges; ++i) store(*to++, sum_of(moment, edge++->along));
      }
      for (; triangle < triangles_end; ++triangle) {
        vfloat<W> by[3];
        for (int k = 0; k < 3; ++k)
          by[k] = bit_cast<vfloat<W>>(bit_cast<vint<W>>(load<W>(side[triangle->edge[k]])) ^ vint<W>(triangle->turned[k]));
        const vfloat<W> det = sum_of(d, triangle->normal), slack = abs(det) * kEdgeTolerance;
        const vbool<W> inside = here & ((min(min(by[0], by[1]), by[2]) >= -slack) | (max(max(by[0], by[1]), by[2]) <= slack));
        if (any(inside)) on_hit(*triangle, inside, sum_of(constant(triangle->point) - o, triangle->normal) / det, by);
      }
    }
  }

 private:
  PRIMRAY_INLINE static vvec3<W> constant(const float (&v)[3]) { return {vfloat<W>(v[0]), vfloat<W>(v[1]), vfloat<W>(v[2])}; }
  PRIMRAY_INLINE static vfloat<W> difference(vfloat<W> a, vfloat<W> b, vfloat<W> c, vfloat<W> d) {
    return multiply_add(a, b, -(c * d));
  }
  PRIMRAY_INLINE static vfloat<W> sum_of(const vvec3<W>& a, const float (&b)[3]) {
    return multiply_add(a.z, vfloat<W>(b[2]), multiply_add(a.y, vfloat<W>(b[1]), a.x * b[0]));
  }
  PRIMRAY_INLINE static vfloat<W> inverse(vfloat<W> x) {
    return 1.0f / select(abs(x) < vfloat<W>(1e-30f), copysign(vfloat<W>(1e-30f), x), x);
  }

  PRIMRAY_INLINE vbool<W> passes(const FewTriangles::Run& run, const vvec3<W>& o, const vvec3<W>& per_d, vfloat<W> end) const {
    const vvec3<W> a = (constant(run.low) - o) * per_d, b = (constant(run.high) - o) * per_d;
    const vfloat<W> in = max(max(min(a.x, b.x), min(a.y, b.y)), max(min(a.z, b.z), tnear_));
    const vfloat<W> out = min(min(max(a.x, b.x), max(a.y, b.y)), min(max(a.z, b.z), end));
    return in <= out * kBoxTolerance;
  }
  // Margin of the distance to a box for its rounding (Ize 2013, "Robust BVH Ray Traversal").
  static constexpr float kBoxTolerance = 1 + 0x1p-21f;

  const FewTriangles& few_;
  const vvec3<W> o_, d_;
  const vfloat<W> tnear_;
};

template <int W>
PRIMRAY_RARE Hits<W> intersect_few(const FewTriangles& few, vbool<W> active, const Rays<W>& rays) {
  const vfloat<W> zero(0.0f), tnear = rays.tnear;
  vfloat<W> end = rays.tfar, first(1.0f), second(zero), third(zero);
  vint<W> number(-1);
  FewLanes<W>(few, rays).visit(
      [&] { return end; }, [&] { return active; },
      [&](const FewTriangles::Triangle& triangle, vbool<W> inside, vfloat<W> t, const vfloat<W>(&by)[3]) {
        const vbool<W> nearest = inside & (t > tnear) & (t < end);
        end = select(nearest, t, end), number = select(nearest, vint<W>(triangle.number), number);
        first = select(nearest, by[0], first), second = select(nearest, by[1], second);
        third = select(nearest, by[2], third);
      });
  Hits<W> h;
  h.t = end, h.ng = vvec3<W>(zero), h.prim = number, h.inst = h.inst_prim = vint<W>(-1);
  h.geom = select(number >= vint<W>(0), vint<W>(0), vint<W>(-1));
  const vfloat<W> scale = 1.0f / (first + second + third);
  h.u = min(second * scale, 1.0f), h.v = min(third * scale, 1.0f);
  return h;
}

template <int W>
PRIMRAY_RARE vbool<W> occluded_few(const FewTriangles& few, vbool<W> active, const Rays<W>& rays) {
  const vfloat<W> tnear = rays.tnear, tfar = rays.tfar;
  vbool<W> open = active;
  FewLanes<W>(few, rays).visit([&] { return tfar; }, [&] { return open; },
                               [&](const FewTriangles::Triangle&, vbool<W> inside, vfloat<W> t, const vfloat<W>(&)[3]) {
                                 open &= !(inside & (t > tnear) & (t < tfar));
                               });
  return active & !open;
}

}  // namespace primray
