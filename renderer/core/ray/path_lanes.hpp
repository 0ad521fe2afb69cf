// Path state in lanes, carried from one vertex to the next.
#pragma once

#include "ray/rays.hpp"
#include "sampler/sampler.hpp"

namespace primray {

// W paths out of a pool: the state that each carries from one vertex to the next.
template <int W>
struct PathLanes {
  Rays<W> ray;
  vvec3<W> beta;        // throughput
  vfloat<W> bsdf_pdf;   // solid-angle density of the ray's direction; 0: camera ray or delta lobe
  vfloat<W> splits;     // number of parts that the sample was split into
  vfloat<W> travelled;  // see PathPool
  vfloat<W> cone_width, cone_spread;
  vvec3<W> diffuse_share;
  vvec3<W> normal;
  vfloat<W> first_received;
  vint<W> link;
  vint<W> route_diffuse, route_other;  // see PathPool
  vint<W> slot, depth, vertex;
  Sampler<W> sampler;
};

// Optional path state that the scene needs: transmissive surfaces, textures, lights with lobe factors, linked lights, an open
// shutter, many lights, a guide, light path expressions.
struct PathNeeds {
  bool travelled, cones, diffuse_shares, links, time, normals, first_received, routes;
};

}  // namespace primray
