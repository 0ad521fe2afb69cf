// Definitions for arrays.hpp.
#include "bindings/arrays.hpp"

#include "base/error.hpp"

namespace primray {

daffine affine_of(const InArray<double>& m) {
  if (m.ndim() != 2 || m.shape(0) < 3 || m.shape(1) != 4) throw Error("internal", "a matrix must have shape (4, 4) or (3, 4)");
  return affine_from_rows(m.data());
}

}  // namespace primray
