// A bound on what Embree holds over all scenes of the process.
#pragma once

#include <cstdint>

namespace primray {

// Beyond so many bytes, builds end with Error("out-of-memory").
void limit_embree_memory(int64_t bytes);

}  // namespace primray
