// Which surfaces bound bodies that light goes through, what is inside, and where the camera stands among them.
#pragma once

#include <cstdint>
#include <vector>

namespace primray {

// So many bodies may be around a point; of more, the lowest are forgotten.
constexpr int kMostBodies = 4;

struct Interiors {
  bool followed = false;          // paths keep account of the bodies that they are in
  bool lit = false;               // lights stand in some
  float per_length = 1;           // world units in one unit of the core's lengths
  std::vector<int32_t> is_body;   // by surface: 1 or 0
  std::vector<float> priorities;  // by surface: of bodies that overlap the higher one is there; empty: all the same
  std::vector<int32_t> bodies;    // by surface: one of those that bound the same body; empty: each bounds its own
  int32_t camera[kMostBodies] = {-1, -1, -1, -1};  // surfaces of the bodies about it, the innermost first
  float camera_index2 = 1;                         // square of the index that the camera is in
  bool around_camera() const { return camera[0] >= 0; }
};

}  // namespace primray
