// Results of evaluating and of sampling a surface's BSDF.
#pragma once

#include "math/vec3.hpp"

namespace primray {

template <int W>
struct BsdfEval {
  vvec3<W> diffuse, specular;  // f_cos by kind of lobe, because lights may weight them separately
  vfloat<W> pdf;
};

template <int W>
struct BsdfSample {
  vvec3<W> wi, weight;  // weight = f_cos / pdf
  vfloat<W> pdf;        // per solid angle; 0 for a delta lobe
  vbool<W> is_delta, transmits, straight;
  vvec3<W> diffuse_share;             // of f_cos; 0 for a delta lobe
  vbool<W> enters = vbool<W>(false);  // into an opaque surface, below which the path scatters until it leaves
};

}  // namespace primray
