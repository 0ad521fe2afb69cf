// Threads of returns.hpp: they take tasks in any order.
#include "aov/returns.hpp"

#include <algorithm>
#include <atomic>
#include <string>
#include <thread>

#include "aov/returns_task.hpp"
#include "base/error.hpp"
#include "base/time_spans.hpp"
#include "render/task_function.hpp"

namespace primray {

// Compiled in returns_fewer_lanes.cpp.
extern template void fill_returns<1>(const Scene&, size_t, ReturnRays&);
#if PRIMRAY_MAX_LANES > 4
extern template void fill_returns<4>(const Scene&, size_t, ReturnRays&);
#endif
#if PRIMRAY_MAX_LANES > 8
extern template void fill_returns<8>(const Scene&, size_t, ReturnRays&);
#endif

namespace {

using Fill = void (*)(const Scene&, size_t, ReturnRays&);

Fill fill_with(int lanes) {
  switch (lanes) {
    case 1:
      return fill_returns<1>;
    case 4:
      return fill_returns<4>;
#if PRIMRAY_MAX_LANES >= 8
    case 8:
      return fill_returns<8>;
#endif
#if PRIMRAY_MAX_LANES >= 16
    case 16:
      return fill_returns<16>;
#endif
  }
  throw Error("settings-error", "this build has no kernel for " + std::to_string(lanes) + " lanes");
}

}  // namespace

void find_returns(const Scene& scene, int lanes, int threads, ReturnRays& rays) {
  const Fill fill = fill_with(lanes);
  const size_t tasks = (rays.time.size() + ReturnRays::kTask - 1) / ReturnRays::kTask;
  rays.count.assign(rays.time.size(), 0), rays.by_task.assign(tasks, {});
  std::atomic<size_t> next{0};
  const auto work = [&] {
    const TimeSpan span("find returns");
    set_float_mode();
    for (size_t i; (i = next++) < tasks;) fill(scene, i, rays);
  };
  std::vector<std::thread> pool;
  for (size_t i = 0; i < std::clamp(size_t(std::max(threads, 1)), size_t(1), std::max(tasks, size_t(1))); ++i)
    pool.emplace_back(work);
  for (std::thread& t : pool) t.join();
}

}  // namespace primray
