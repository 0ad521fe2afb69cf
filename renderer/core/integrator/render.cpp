// Tasks are (block of samples, tile), claimed in that order; a tile's blocks are done one after the other, so sums keep their
// order.
#include "integrator/render.hpp"

#include "integrator/choose_splits.hpp"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "scene/error.hpp"

namespace primray {
namespace {

struct Schedule {
  int tiles_x, tiles_y, blocks;
  int samples[kReplicates];

  Schedule(const Camera& camera, const IntegratorSettings& s) {
    tiles_x = (camera.width + kTile - 1) / kTile, tiles_y = (camera.height + kTile - 1) / kTile;
    for (int r = 0; r < kReplicates; ++r) samples[r] = (s.samples + kReplicates - 1 - r) / kReplicates;
    blocks = (samples[0] + kBlock - 1) / kBlock;
  }
  int64_t tiles() const { return int64_t(tiles_x) * tiles_y; }
  int64_t tasks() const { return tiles() * blocks; }
  TileBlock task(int64_t number, const Camera& camera) const {
    const int block = int(number / tiles()), tile = int(number % tiles());
    TileBlock b;
    b.x0 = tile % tiles_x * kTile, b.y0 = tile / tiles_x * kTile;
    b.x1 = std::min(b.x0 + kTile, camera.width), b.y1 = std::min(b.y0 + kTile, camera.height);
    b.film_x = b.x0, b.film_y = b.y0;
    for (int r = 0; r < kReplicates; ++r) {
      b.first[r] = block * kBlock;
      b.count[r] = std::clamp(samples[r] - b.first[r], 0, kBlock);
    }
    return b;
  }
};

}  // namespace

RenderStatistics render(const Scene& scene, const IntegratorSettings& asked, int lanes, Film& film, const Progress& progress,
                        RayRecorder* recorder) {
  const TaskFunction run_task = task_function(lanes);
  if (!run_task) throw Error("settings-error", "this build has no kernel of " + std::to_string(lanes) + " lanes");
  IntegratorSettings settings = asked;
  if (settings.splits == 0) settings.splits = choose_splits(scene, settings, run_task);
  const Schedule schedule(scene.camera, settings);
  std::atomic<int64_t> next{0}, done{0};
  std::atomic<bool> stop{false};
  std::atomic<int64_t> busy{0}, shaded{0};
  std::vector<std::atomic<int>> blocks_done(schedule.tiles());
  std::mutex mutex;
  std::condition_variable finished;
  const int threads = int(std::clamp<int64_t>(settings.threads, 1, std::max<int64_t>(schedule.tasks(), 1)));
  int running = threads;
  const auto start = std::chrono::steady_clock::now();

  const auto work = [&] {
    set_float_mode();
    const auto worker = std::make_unique<Worker>();
    for (int64_t i; !stop && (i = next++) < schedule.tasks(); ++done) {
      const int64_t tile = i % schedule.tiles();
      while (blocks_done[tile].load(std::memory_order_acquire) < i / schedule.tiles()) std::this_thread::yield();
      run_task(scene, settings, schedule.task(i, scene.camera), *worker, film, recorder);
      blocks_done[tile].fetch_add(1, std::memory_order_release);
      film.camera_rays += std::exchange(worker->camera_rays, 0),
          film.scattered_rays += std::exchange(worker->scattered_rays, 0);
      film.shadow_rays += std::exchange(worker->shadow_rays, 0);
    }
    busy += worker->busy_lanes, shaded += worker->shaded_lanes;
    const std::lock_guard lock(mutex);
    --running;
    finished.notify_all();
  };
  std::vector<std::thread> pool;
  for (int i = 0; i < threads; ++i) pool.emplace_back(work);

  RenderStatistics statistics;
  {
    std::unique_lock lock(mutex);
    while (!finished.wait_for(lock, std::chrono::milliseconds(50), [&] { return running == 0; })) {
      if (stop || !progress) continue;
      lock.unlock();
      if (!progress(double(done) / double(std::max<int64_t>(schedule.tasks(), 1)))) stop = true;
      lock.lock();
    }
  }
  for (std::thread& t : pool) t.join();
  statistics.splits = settings.splits;
  statistics.interrupted = stop && done < schedule.tasks();
  statistics.lane_occupancy = shaded > 0 ? double(busy) / double(shaded) : 0;
  statistics.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return statistics;
}

}  // namespace primray
