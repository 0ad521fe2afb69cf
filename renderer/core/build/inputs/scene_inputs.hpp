// Inputs of the builder: cameras, lights with their images, portals and profiles, meshes and curves.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "light/light.hpp"
#include "light/light_options.hpp"
#include "math/matrix.hpp"
#include "scene/camera.hpp"
#include "scene/scene.hpp"

namespace primray {

// Input of a lens's distortion: its model by name, or "".
struct DistortionInput {
  std::string model;
  std::span<const double> coefficients;
  double most_angle = 0;        // radians
  double table_window[4] = {};  // left, right, bottom, top
  int table_columns = 0, table_rows = 0;
  std::span<const float> directions;  // 3 per texel
  std::span<const float> places;      // likewise, in scene units; of a table of rays
};

// Input of the camera, with the film's window and filter.
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

// C curves with N control points in total: cubic Bezier segments; a curve of n segments has 3 n + 1 points.
struct CurvesInput {
  std::span<const float> points;      // 4 N: x, y, z and radius, in object space; similarity transforms scale radii
  std::span<const int32_t> segments;  // C, at least 1 each
  std::span<const int32_t> surfaces;  // one, or one per segment, -1 where it is not drawn
  bool closed = false;                // the last point of each is its first
  bool joined = false;                // segments may meet at angles
  // Motion: the times of S + 1 steps, and their points (4 N each).
  std::span<const float> times, step_points;
};

// Arrays of one mesh as given; all indices have been checked to be in range.
struct MeshInput {
  std::span<const float> points;       // 3 N
  std::span<const int32_t> triangles;  // 3 T
  std::span<const float> normals;      // empty, 3 N or 9 T
  std::span<const float> colors;       // empty, 3 T, 3 N or 9 T
  Attribute normal_kind = Attribute::kNone, color_kind = Attribute::kNone;
  std::span<const int32_t> surfaces;  // one, or one per triangle
  bool cutout = false;                // all of its surfaces have an opacity threshold, or none
  // Motion: the times of S + 1 steps, their points (3 N each) and, unless they are constant, normals.
  std::span<const float> times, step_points, step_normals;
};

// Image as given: (height, width, channels) linear floats, finite, first row at the top.
struct ImageInput {
  std::span<const float> pixels;
  int width = 0, height = 0;
};

// Rectangle through which a dome is sampled.
struct PortalInput {
  daffine world_from_portal;
  double width = 1, height = 1;
  // Motion, as in LightInput.
  std::span<const float> times{};
  std::span<const double> pose_matrices{};
};

// IES profile: angles in degrees, ascending, two or more of each; `candela` by horizontal angle. See light/shaping/ies.hpp.
struct IesInput {
  std::span<const float> vertical_deg, horizontal_deg, candela;
  bool horizontal_pole = false;
};

// Input of a light.
struct LightInput : LightRules, LightSize {
  LightType type = LightType::kPoint;
  daffine world_from_light;
  vec3 emission;
  float diffuse = 1, specular = 1;
  int texture_width = 0, texture_height = 0;
  std::span<const float> texels;  // image of a dome: 3 (width) (height), first row at the top
  DomeFormat format = DomeFormat::kLatLong;
  std::vector<PortalInput> portals;  // of a dome
  int earlier_dome =
      -1;  // of SceneBuilder::keep_domes(): one that had the same image, format, emission and rules; texels are not read
  std::optional<ShapingInput> shaping;
  // Motion: times, and world_from_light at each (12 numbers), rigid.
  std::span<const float> times;
  std::span<const double> pose_matrices;
  // Geometry lights only: see GeometryLight.
  bool own = false, shown = false, normalize = false;
};

}  // namespace primray
