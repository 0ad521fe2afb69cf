// Instance of the path loop for 4 lanes.
#include "integrator/path_loop.hpp"

namespace primray {
template void render_tile_block<4>(const Scene&, const IntegratorSettings&, const TileBlock&, Worker&, Film&, RayRecorder*);
}
