// What a block's samples add to the film: exact sums, in whatever order blocks end.
#pragma once

#include <algorithm>
#include <cmath>

#include "film/exact_sum.hpp"
#include "path/tile_task.hpp"

namespace primray {

// Moves the finite ones of samples [slot, slot + count) to the front; their number.
inline int drop_invalid(Worker& w, int slot, int count) {
  int kept = slot;
  for (int s = slot; s < slot + count; ++s) {
    if (!std::isfinite(w.r[s]) || !std::isfinite(w.g[s]) || !std::isfinite(w.b[s])) continue;
    w.r[kept] = w.r[s], w.g[kept] = w.g[s], w.b[kept] = w.b[s], w.a[kept] = w.a[s];
    ++kept;
  }
  return kept - slot;
}

// The samples of the block's `pixels`, `samples` each of both replicates, and the rays that they took, which are counted anew
// then.
inline void add_to_film(const TileBlock& block, Worker& w, int pixels, int samples, Film& film) {
  const int tile = block.film_y / kTile * film.tiles_x + block.film_x / kTile;
  const std::lock_guard lock(film.lock_of(tile));
  int64_t invalid = 0;
  for (int i = 0; i < pixels; ++i) {
    int slot = i * samples;
    for (int replicate = 0; replicate < kReplicates; slot += block.count[replicate++]) {
      const int asked = block.count[replicate], valid = drop_invalid(w, slot, asked);
      const size_t p = film.at(replicate, block.film_x + w.pixel_x[i], block.film_y + w.pixel_y[i]);
      if (valid > 0) {
        film.add(p, 0, exact_sum(w.r + slot, valid)), film.add(p, 1, exact_sum(w.g + slot, valid));
        film.add(p, 2, exact_sum(w.b + slot, valid));
      }
      film.counts[p] += uint32_t(valid);
      for (int s = slot; s < slot + valid; ++s) film.covered[p] += int64_t(w.a[s] * float(Film::kCovered));
      invalid += asked - valid;
    }
  }
  for (int r = 0; r < kReplicates; ++r) film.next[size_t(r) * film.tiles() + tile] += uint32_t(block.count[r]);
  film.tile_rays[tile] += w.camera_rays + w.scattered_rays + w.shadow_rays;
  film.invalid_samples += invalid;
  film.samples += int64_t(pixels) * samples;
  film.camera_rays += w.camera_rays, film.scattered_rays += w.scattered_rays, film.shadow_rays += w.shadow_rays;
  w.camera_rays = w.scattered_rays = w.shadow_rays = 0;
}

}  // namespace primray
