// Participating media inside closed surfaces: which surfaces bound them, what is inside, and which of them contain the camera.
#pragma once

#include <cstdint>
#include <vector>

namespace primray {

// Maximum number of nested objects around a point; beyond, the outermost are dropped.
constexpr int kMostBodies = 4;

struct Interiors {
  bool followed = false;          // paths track the stack of media that they are in
  bool lit = false;               // some light is inside a medium
  float per_length = 1;           // world units per unit of the core's lengths
  std::vector<int32_t> is_body;   // by surface: 1 or 0
  std::vector<float> priorities;  // by surface: where objects overlap the one of higher priority prevails; empty: all equal
  std::vector<int32_t> bodies;    // by surface: representative of the surfaces that bound the same object; empty: each bounds
                                  // its own
  int32_t camera[kMostBodies] = {-1, -1, -1, -1};  // surfaces of the objects that contain the camera, the innermost first
  float camera_index2 = 1;                         // square of the index of refraction around the camera
  bool around_camera() const { return camera[0] >= 0; }
};

}  // namespace primray
