// Rendering of single pixels with a log of their paths
// (integrator/path_log.hpp).
#include <algorithm>
#include <memory>

#include "base/flush_denormals.hpp"
#include "integrator/path_log.hpp"
#include "lpe/automaton.hpp"
#include "render/render.hpp"

namespace primray {

void log_pixel(const Scene& scene, const IntegratorSettings& asked, int x, int y, const SampleSpan (&spans)[kReplicates],
               PathLog& log) {
  log.origin = scene.origin, log.scale = scene.scale;
  IntegratorSettings settings = asked;
  settings.path_log = &log;
  const int removals =
      (settings.clamps() ? 1 << kClamped : 0) | (settings.lpe && settings.lpe->leaves_out >= 0 ? 1 << kCaustics : 0);
  Film film(1, 1, settings.lpe ? settings.lpe->expressions : 0, removals);
  const FlushDenormals flush;
  const auto worker = std::make_unique<Worker>();
  TileBlock block{x, y, x + 1, y + 1, 0, 0};
  for (uint32_t at = 0;; at += kBlock) {
    uint32_t samples = 0;
    for (int r = 0; r < kReplicates; ++r) {
      const uint32_t first = std::min(spans[r].first + at, std::max(spans[r].first, spans[r].end));
      block.first[r] = int(first);
      block.count[r] = int(std::min<uint32_t>(kBlock, std::max(first, spans[r].end) - first));
      samples += uint32_t(block.count[r]);
    }
    if (samples == 0) return;
    render_tile_block<1>(scene, settings, block, *worker, film, nullptr);
  }
}

}  // namespace primray
