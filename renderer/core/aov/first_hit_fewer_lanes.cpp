// Explicit instantiations of fill_first_hits() for fewer lanes than the ISA class renders with: 1, 4 and 8.
#include "aov/first_hit_task.hpp"

namespace primray {
template void fill_first_hits<1>(const Scene&, const PixelRect&, FirstHitPlanes&);
#if PRIMRAY_MAX_LANES > 4
template void fill_first_hits<4>(const Scene&, const PixelRect&, FirstHitPlanes&);
#endif
#if PRIMRAY_MAX_LANES > 8
template void fill_first_hits<8>(const Scene&, const PixelRect&, FirstHitPlanes&);
#endif
}  // namespace primray
