// Explicit instantiations of fill_returns() for fewer lanes than the ISA class renders with: 1, 4 and 8.
#include "aov/returns_task.hpp"

namespace primray {
template void fill_returns<1>(const Scene&, size_t, ReturnRays&);
#if PRIMRAY_MAX_LANES > 4
template void fill_returns<4>(const Scene&, size_t, ReturnRays&);
#endif
#if PRIMRAY_MAX_LANES > 8
template void fill_returns<8>(const Scene&, size_t, ReturnRays&);
#endif
}  // namespace primray
