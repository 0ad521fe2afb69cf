// The list of recorded spans, which all threads append to.
#include "base/time_spans.hpp"

#include <pthread.h>
#include <unistd.h>

#include <chrono>
#include <mutex>
#include <utility>

namespace primray {
namespace {

std::mutex mutex;
std::vector<RecordedSpan> recorded;

int64_t now_ns() {
  using namespace std::chrono;
  return duration_cast<nanoseconds>(steady_clock::now().time_since_epoch()).count();
}

// The number that Python's threading.get_native_id() gives.
int64_t thread_number() {
#ifdef __APPLE__
  uint64_t number = 0;
  pthread_threadid_np(nullptr, &number);
  return int64_t(number);
#else
  return gettid();
#endif
}

}  // namespace

void record_spans(bool on) { TimeSpan::is_recording = on; }

std::vector<RecordedSpan> take_spans() {
  const std::lock_guard lock(mutex);
  return std::exchange(recorded, {});
}

void TimeSpan::begin(const char* name) { name_ = name, begin_ns_ = now_ns(); }

void TimeSpan::end() {
  const RecordedSpan span{name_, thread_number(), begin_ns_, now_ns()};
  const std::lock_guard lock(mutex);
  recorded.push_back(span);
}

}  // namespace primray
