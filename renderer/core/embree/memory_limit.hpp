// Limit of Embree's memory over all scenes of the process.
#pragma once

#include <cstdint>

namespace primray {

// Builds that would exceed `bytes` end with Error("out-of-memory").
void limit_embree_memory(int64_t bytes);

}  // namespace primray
