// Lookup of kernels by number of lanes.
#include "render/task_function.hpp"

namespace primray {

TaskFunction task_function(int lanes) {
  switch (lanes) {
    case 1:
      return render_tile_block<1>;
    case 4:
      return render_tile_block<4>;
#if PRIMRAY_MAX_LANES >= 8
    case 8:
      return render_tile_block<8>;
#endif
#if PRIMRAY_MAX_LANES >= 16
    case 16:
      return render_tile_block<16>;
#endif
  }
  return nullptr;
}

}  // namespace primray
