// Thread of memory_watch.hpp.
//
// It reads the resident size, more often the less room is left: estimates before each step refuse what does not fit, and this
// is for what they miss. A limit in the allocator would count address space, which threads and allocators reserve but do not
// touch.
#include "base/memory_watch.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <mutex>
#include <thread>

namespace primray {
namespace {

// The process ends when this much room is left, which it may use up while the thread sleeps.
constexpr int64_t kMargin = 24 << 20;
// Assumed maximum rate at which a process takes memory, in bytes per microsecond: two cores that touch new pages.
constexpr int64_t kFastest = 6000;
constexpr int64_t kShortest = 500, kLongest = 20'000;  // microseconds between two checks

std::mutex mutex;
std::condition_variable changed;
int64_t most = 0;
MemoryVerdict verdict;
bool is_running = false;

// Resident bytes according to proc(5), 0 if they cannot be read.
int64_t resident(int statm) {
  char text[128];
  const ssize_t count = pread(statm, text, sizeof text - 1, 0);
  if (count <= 0) return 0;
  text[count] = 0;
  char* end = text;
  std::strtoll(text, &end, 10);
  return std::strtoll(end, nullptr, 10) * sysconf(_SC_PAGESIZE);
}

void write_all(int file, const std::string& text) {
  for (size_t at = 0; at < text.size();) {
    const ssize_t written = write(file, text.data() + at, text.size() - at);
    if (written <= 0) return;
    at += size_t(written);
  }
}

[[noreturn]] void end_process(int64_t held) {
  const std::string number = std::to_string(held >> 20);
  write_all(STDERR_FILENO, verdict.before + number + verdict.after);
  if (!verdict.json_before.empty()) write_all(STDOUT_FILENO, verdict.json_before + number + verdict.json_after);
  _exit(verdict.exit_code);
}

void watch() {
  const int statm = open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
  if (statm < 0) return;
  std::unique_lock lock(mutex);
  while (true) {
    if (most == 0) {
      changed.wait(lock);
      continue;
    }
    const int64_t held = resident(statm), room = most - kMargin - held;
    if (room < 0) end_process(held);
    changed.wait_for(lock, std::chrono::microseconds(std::clamp(room / kFastest, kShortest, kLongest)));
  }
}

}  // namespace

void watch_memory(int64_t bytes, MemoryVerdict on_end) {
  const std::lock_guard lock(mutex);
  most = bytes, verdict = std::move(on_end);
  if (most > 0 && !is_running) std::thread(watch).detach(), is_running = true;
  changed.notify_all();
}

}  // namespace primray
