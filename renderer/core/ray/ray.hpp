// Rays, hits and path state in lanes, and the encoding of hits in nested instances.
#pragma once

#include "math/lanes.hpp"
#include "math/vec3.hpp"
#include "sampler/sampler.hpp"

namespace primray {

// W rays and their hits.
template <int W>
struct Rays {
  vvec3<W> o, d;
  vfloat<W> tnear, tfar;
  vfloat<W> time = vfloat<W>(0.0f);  // within the shutter interval, [0, 1]
};

template <int W>
struct Hits {
  vfloat<W> t;  // the ray's own tfar if nothing was hit
  vvec3<W> ng;  // as Embree returns it: for spheres the unit normal in object space
  vfloat<W> u, v;
  vint<W> prim, geom, inst, inst_prim;  // geom -1: no hit; for pairs, prim counts triangles
  vfloat<W> time = vfloat<W>(0.0f);     // of the ray
};

// Encoding of hits in nested instances: the ids of both levels, packed into the fields that Embree has for one.

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

// W paths out of a pool: the state that each carries from one vertex to the next.
template <int W>
struct PathLanes {
  Rays<W> ray;
  vvec3<W> beta;        // throughput
  vfloat<W> bsdf_pdf;   // solid-angle density of the ray's direction; 0: camera ray or delta lobe
  vfloat<W> splits;     // number of parts that the sample was split into; 0: not yet
  vfloat<W> travelled;  // see PathPool
  vfloat<W> cone_width, cone_spread;
  vvec3<W> diffuse_share;
  vvec3<W> normal;
  vfloat<W> first_received;
  vint<W> link;
  vint<W> lpe_diffuse, lpe_other;  // see PathPool
  vint<W> slot, depth, vertex;
  Sampler<W> sampler;
};

// Optional path state that the scene needs: transmissive surfaces, textures, lights with lobe factors, linked lights, an open
// shutter, many lights, a guide, light path expressions.
struct PathNeeds {
  bool travelled, cones, diffuse_shares, links, time, normals, first_received, lpe;
};

}  // namespace primray
