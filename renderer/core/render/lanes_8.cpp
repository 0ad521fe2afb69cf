// Instance of the path loop for 8 lanes.
#include "integrator/path_loop.hpp"

namespace primray {
template void render_tile_block<8>(const Scene&, const IntegratorSettings&, const TileBlock&, Worker&, Film&, RayRecorder*);
}
