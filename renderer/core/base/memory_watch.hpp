// Ends the process before it exceeds its memory limit, for commands that run in a process of their own.
#pragma once

#include <cstdint>
#include <string>

namespace primray {

// Messages that a watch prints, around the number of MiB in use, and the exit code of the process.
struct MemoryVerdict {
  std::string before, after;            // on stderr
  std::string json_before, json_after;  // on stdout, if not empty
  int exit_code;
};

// Watches the resident size against the limit `bytes`, in place of an earlier watch; 0: stops watching.
void watch_memory(int64_t bytes, MemoryVerdict verdict);

}  // namespace primray
