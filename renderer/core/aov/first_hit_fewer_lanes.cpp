// Explicit instantiations of fill_first_hits() and fill_layers() for fewer lanes than the ISA class renders with: 1, 4 and 8.
#include "aov/first_hit_task.hpp"

namespace primray {
template void fill_first_hits<1>(const Scene&, const PixelRect&, FirstHitPlanes&);
template void fill_layers<1>(const Scene&, size_t, LayerPoints&);
#if PRIMRAY_MAX_LANES > 4
template void fill_first_hits<4>(const Scene&, const PixelRect&, FirstHitPlanes&);
template void fill_layers<4>(const Scene&, size_t, LayerPoints&);
#endif
#if PRIMRAY_MAX_LANES > 8
template void fill_first_hits<8>(const Scene&, const PixelRect&, FirstHitPlanes&);
template void fill_layers<8>(const Scene&, size_t, LayerPoints&);
#endif
}  // namespace primray
