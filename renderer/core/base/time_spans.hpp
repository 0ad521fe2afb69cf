// Time spans of the core's work for a trace. They are recorded only while someone asks for them, and never in an inner loop:
// one for each thread of a pass, or for each step of the set-up.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

namespace primray {

struct RecordedSpan {
  const char* name;
  int64_t thread;            // the operating system's identifier
  int64_t begin_ns, end_ns;  // of std::chrono::steady_clock
};

// Starts or stops recording; what was recorded stays.
void record_spans(bool on);

// Returns the recorded spans in the order of their ends, and forgets them.
std::vector<RecordedSpan> take_spans();

// Records its lifetime on the thread that created it. `name` is a literal.
class TimeSpan {
 public:
  explicit TimeSpan(const char* name) {
    if (is_recording.load(std::memory_order_relaxed)) begin(name);
  }
  ~TimeSpan() {
    if (name_) end();
  }
  TimeSpan(const TimeSpan&) = delete;
  TimeSpan& operator=(const TimeSpan&) = delete;

 private:
  friend void record_spans(bool on);
  void begin(const char* name);
  void end();

  static inline std::atomic<bool> is_recording{false};
  const char* name_ = nullptr;
  int64_t begin_ns_ = 0;
};

}  // namespace primray
