// Assertions of the core: checked in a debug build (`make debug`), and compiled to nothing in all others. They state invariants
// of the render loop (masks, indices, finite values, unit lengths). What a user may get wrong is an Error while the scene is
// built.
#pragma once

#if PRIMRAY_DEBUG
#include <cstdio>
#include <cstdlib>

namespace primray {

// Prints the condition and its place, and aborts.
[[noreturn]] inline void assertion_failed(const char* condition, const char* file, int line) {
  std::fprintf(stderr, "%s:%d: assertion failed: %s\n", file, line, condition);
  std::abort();
}

}  // namespace primray

#define PRIMRAY_ASSERT(...) ((__VA_ARGS__) ? void(0) : ::primray::assertion_failed(#__VA_ARGS__, __FILE__, __LINE__))
#else
#define PRIMRAY_ASSERT(...) void(0)
#endif
