// Instance of the path loop for 16 lanes.
#include "integrator/path_loop.hpp"

namespace primray {
template void render_tile_block<16>(const Scene&, const IntegratorSettings&, const TileBlock&, Worker&, Film&, RayRecorder*);
}
