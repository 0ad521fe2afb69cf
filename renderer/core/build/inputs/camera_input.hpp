// Input of the camera, with the film's window and filter.
#pragma once

#include <span>
#include <string>

#include "math/matrix.hpp"
#include "scene/camera.hpp"

namespace primray {

// Input of a lens's distortion: its model by name, or "".
struct DistortionInput {
  std::string model;
  std::span<const double> coefficients;
  double most_angle = 0;        // radians
  double table_window[4] = {};  // left, right, bottom, top
  int table_columns = 0, table_rows = 0;
  std::span<const float> directions;  // 3 per texel
};

struct CameraInput {
  daffine world_from_camera;
  bool orthographic = false;
  double window[4] = {-1, 1, -1, 1};  // left, right, bottom, top
  double near = 0, far = 0, lens_radius = 0, focus_distance = 1;
  int width = 1, height = 1;
  PixelWindow pixels{0, 0, 1, 1};
  int blades = 0;
  double blade_rotation_deg = 0;
  // Motion: the times of S + 1 poses, their matrices (12 numbers each), and for each pose window, near, far, lens radius and
  // focus distance.
  std::span<const float> times;
  std::span<const double> pose_matrices, pose_numbers;
  std::span<const double> clipping_planes;  // 4 per plane
  DistortionInput distortion;
  bool natural_vignetting = false;
  double rim_distance = 0, rim_radius = 0;  // before the lens; radius 0: none
  double magnification[3] = {1, 1, 1};      // of red, green and blue
  double focus_shift[3] = {0, 0, 0};
  float filter_width = 1;
  std::span<const float> filter_inverse_cdf;  // empty: a box
};

}  // namespace primray
