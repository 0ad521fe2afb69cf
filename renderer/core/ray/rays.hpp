// W rays and their hits.
#pragma once

#include "math/vec3.hpp"

namespace primray {

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

}  // namespace primray
