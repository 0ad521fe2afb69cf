// Paths on lanes: what each carries from one vertex to the next.
#pragma once

#include "ray/rays.hpp"
#include "sampler/sampler.hpp"

namespace primray {

// W paths out of a pool: what each carries from one vertex to the next.
template <int W>
struct PathLanes {
  Rays<W> ray;
  vvec3<W> beta;        // throughput
  vfloat<W> bsdf_pdf;   // density of the ray's direction; 0: camera or delta
  vfloat<W> splits;     // paths among which the sample was split
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

// What paths of a scene carry beyond the rest: through see-through surfaces, over textures, to lights with lobe factors, to
// lights that are linked, while a shutter is open, among many lights, with a guide, for light path expressions.
struct PathNeeds {
  bool travelled, cones, diffuse_shares, links, time, normals, first_received, routes;
};

}  // namespace primray
