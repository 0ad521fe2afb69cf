// Instance of the path loop for 1 lane.
#include "integrator/path_loop.hpp"

namespace primray {
template void render_tile_block<1>(const Scene&, const IntegratorSettings&, const TileBlock&, Worker&, Film&, RayRecorder*);
}
