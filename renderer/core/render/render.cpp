// Scheduling of a pass: it is divided into tasks of up to kBlock samples of each replicate of one tile. They are claimed in
// order, blocks before tiles, so that all tiles advance together; which thread renders which task, and when, changes no bit.

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "base/error.hpp"
#include "base/time_spans.hpp"
#include "lpe/automaton.hpp"
#include "render/render.hpp"
#include "render/task_function.hpp"

namespace primray {

// Lookup of kernels by number of lanes.
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

namespace {

struct Task {
  int tile, block;
};

// Remaining sample range of a tile at the beginning of the pass.
struct Span {
  uint32_t first[kReplicates], end[kReplicates];

  uint32_t longest() const {
    uint32_t n = 0;
    for (int r = 0; r < kReplicates; ++r) n = std::max(n, end[r] > first[r] ? end[r] - first[r] : 0);
    return n;
  }
};

std::vector<Task> tasks_of(const std::vector<Span>& spans) {
  std::vector<Task> tasks;
  uint32_t blocks = 0;
  for (const Span& s : spans) blocks = std::max(blocks, (s.longest() + kBlock - 1) / kBlock);
  for (uint32_t block = 0; block < blocks; ++block)
    for (size_t tile = 0; tile < spans.size(); ++tile)
      if (block * kBlock < spans[tile].longest()) tasks.push_back({int(tile), int(block)});
  return tasks;
}

TileBlock tile_block(const Task& task, const Span& span, const Film& film, const PixelWindow& pixels) {
  TileBlock b;
  b.film_x = task.tile % film.tiles_x * kTile, b.film_y = task.tile / film.tiles_x * kTile;
  // Pixels are identified by their position in the frame, so that a crop has the same ones.
  b.x0 = pixels.x + b.film_x, b.y0 = pixels.y + b.film_y;
  b.x1 = std::min(b.x0 + kTile, pixels.x + film.width), b.y1 = std::min(b.y0 + kTile, pixels.y + film.height);
  for (int r = 0; r < kReplicates; ++r) {
    const uint32_t first = std::min(span.first[r] + uint32_t(task.block) * kBlock, std::max(span.first[r], span.end[r]));
    b.first[r] = int(first);
    b.count[r] = int(std::min<uint32_t>(kBlock, std::max(first, span.end[r]) - first));
  }
  return b;
}

}  // namespace

TaskFunction kernel_of(int lanes) {
  const TaskFunction run_task = task_function(lanes);
  if (!run_task) throw Error("settings-error", "this build has no kernel for " + std::to_string(lanes) + " lanes");
  return run_task;
}

PassStatistics render_pass(const Scene& scene, const IntegratorSettings& settings, int lanes, std::span<const uint32_t> ends,
                           Film& film, const Progress& progress, RayRecorder* recorder) {
  const TaskFunction run_task = kernel_of(lanes);
  const size_t tiles = size_t(film.tiles());
  const PixelWindow& pixels = scene.camera.pixels;
  if (ends.size() != kReplicates * tiles || film.width != pixels.width || film.height != pixels.height)
    throw Error("invariant", "the pass does not fit the film");
  if (film.expressions != (settings.lpe ? settings.lpe->expressions : 0))
    throw Error("invariant", "the film has other light path expressions");
  const bool caustics_left_out = settings.lpe && settings.lpe->leaves_out >= 0;
  if (film.removed[kClamped].any() != settings.clamps() || film.removed[kCaustics].any() != caustics_left_out)
    throw Error("invariant", "the film records other kinds of removed light");
  std::vector<Span> spans(tiles);
  for (size_t t = 0; t < tiles; ++t)
    for (int r = 0; r < kReplicates; ++r) spans[t].first[r] = film.next[r * tiles + t], spans[t].end[r] = ends[r * tiles + t];
  const std::vector<Task> tasks = tasks_of(spans);

  std::atomic<size_t> next{0}, done{0};
  std::atomic<bool> stop{false};
  std::atomic<int64_t> busy{0}, shaded{0};
  std::mutex mutex;
  std::condition_variable finished;
  const size_t threads = std::clamp<size_t>(size_t(settings.threads), 1, std::max<size_t>(tasks.size(), 1));
  size_t running = threads;
  const auto start = std::chrono::steady_clock::now();

  const auto work = [&] {
    const TimeSpan span("trace paths");
    set_float_mode();
    const auto worker = std::make_unique<Worker>();
    for (size_t i; !stop && (i = next++) < tasks.size(); ++done)
      run_task(scene, settings, tile_block(tasks[i], spans[size_t(tasks[i].tile)], film, pixels), *worker, film, recorder);
    busy += worker->busy_lanes, shaded += worker->shaded_lanes;
    const std::lock_guard lock(mutex);
    --running;
    finished.notify_all();
  };
  std::vector<std::thread> pool;
  for (size_t i = 0; i < threads; ++i) pool.emplace_back(work);

  {
    std::unique_lock lock(mutex);
    while (!finished.wait_for(lock, std::chrono::milliseconds(50), [&] { return running == 0; })) {
      if (stop || !progress) continue;
      lock.unlock();
      if (!progress(double(done) / double(std::max<size_t>(tasks.size(), 1)))) stop = true;
      lock.lock();
    }
  }
  for (std::thread& t : pool) t.join();
  PassStatistics statistics;
  statistics.interrupted = done < tasks.size();
  statistics.busy_lanes = busy, statistics.shaded_lanes = shaded;
  statistics.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return statistics;
}

}  // namespace primray
