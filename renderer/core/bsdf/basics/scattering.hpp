// What a surface says of one direction, and of one that it has drawn.
#pragma once

#include "math/vec3.hpp"

namespace primray {

template <int W>
struct BsdfEval {
  vvec3<W> diffuse, specular;  // f_cos, by lobe because lights may weigh them apart
  vfloat<W> pdf;
};

template <int W>
struct BsdfSample {
  vvec3<W> wi, weight;  // weight = f_cos / pdf
  vfloat<W> pdf;        // per solid angle; 0 for a delta lobe
  vbool<W> is_delta, transmits, straight;
  vvec3<W> diffuse_share;             // of f_cos; 0 for a delta lobe
  vbool<W> enters = vbool<W>(false);  // below an opaque surface, where it scatters until it comes out
};

}  // namespace primray
