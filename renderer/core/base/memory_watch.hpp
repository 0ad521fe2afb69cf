// Ends the process before it holds more memory than it may, for commands that have a process of their own.
#pragma once

#include <cstdint>
#include <string>

namespace primray {

// What a watch prints, around the number of MiB held then, and with which exit code the process ends.
struct MemoryVerdict {
  std::string before, after;            // on stderr
  std::string json_before, json_after;  // on stdout, where they are not empty
  int exit_code;
};

// Watch what is resident against `bytes`, in place of an earlier watch; 0: no more.
void watch_memory(int64_t bytes, MemoryVerdict verdict);

}  // namespace primray
