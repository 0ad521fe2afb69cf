// Moves a diced surface as materials displace it: while it is diced, so that edges are measured where they end up, and once it
// is, with normals of what it has become.
//
// A vertex is moved by one vector, the mean of what the corners that meet in it say: neither seams of primvars, nor creases,
// nor subsets with other materials open cracks. What a corner says is asked for at the level where its vertex first appears,
// and rests on nothing that is coarser there; tangents, which would, are those of the triangles in the end.
#pragma once

#include <functional>

#include "subdivision/dicing/footprint.hpp"
#include "subdivision/dicing/level.hpp"
#include "subdivision/dicing/stitch.hpp"

namespace primray::subdivision {

// Corners of faces, in the cage's own space.
struct CornerRows {
  std::span<const float> points;      // 9 a corner: it, the next one and the previous one along its face
  std::span<const float> normals;     // 3 a corner; unit length
  std::span<const float> footprints;  // lengths over which textures are averaged
  std::span<const int32_t> faces;     // of the cage
  // Three rows a corner, in the order of `points`: of the arrays of values by vertex, and of each face-varying primvar.
  std::span<const int32_t> vertices;
  std::span<const float> vertex_values, varying_values;
  std::vector<std::span<const int32_t>> channels;
  std::vector<std::span<const float>> channel_values;
};

// What a displacement is given in: along the tangent of `st`, across it, and along the normal; then in the cage's own space.
constexpr int kMovedNumbers = 6;
using Displace = std::function<void(const CornerRows&, std::span<float>)>;  // kMovedNumbers a corner

// Where a primvar's numbers are found: from a column on, or of a face-varying primvar.
struct ValuePlace {
  enum class Kind { kNone, kVertex, kVarying, kFaceVarying };
  Kind kind = Kind::kNone;
  int at = 0;
};

struct Displacing {
  Displace displace;
  ValuePlace st;     // spans tangents
  int normals = -1;  // a face-varying primvar along which the surface is displaced, three numbers a time; -1: its own
  bool faces_differ = false;
};

// The mesh that comes out, while it grows.
struct Moved {
  std::vector<float>&points, &normals;
  std::vector<std::vector<float>>&step_points, &step_normals;
  const std::vector<float>&vertex_values, &varying_values;
  const std::vector<std::vector<float>>& face_varying;
  int vertex_width, varying_width;
  std::vector<int> channel_widths;
};

class Mover {
 public:
  Mover(const Displacing& how, const Footprint& print, double pixels, Moved mesh);

  // After a level's vertices of which `is_new` says so have got their points, normals and values.
  void add(const Level& level, const std::vector<uint8_t>& is_new);
  // Where a vertex comes to lie, nearly: `points` are those of the frame or of a step.
  dvec3 point(const std::vector<float>& points, int vertex) const;
  // Corners of a vertex say so different things that edges to it stay as long as they are, however fine.
  bool is_torn(int vertex) const { return is_torn_[size_t(vertex)] || (is_tangential_ && is_turned_[size_t(vertex)]); }
  // Of all vertices, at the frame.
  std::vector<float> points() const;
  void finish(Triangles& triangles);

 private:
  void choose_corners(const Level& level, const std::vector<uint8_t>& is_new);
  void ask(const Level& level, size_t first, size_t count);
  void take(const Level& level, size_t first, size_t count, const std::vector<float>& moved);
  double spacing(const dvec3& p) const;
  const float* st_of(const Level& level, int corner) const;
  void turn(const Level& level);
  bool are_aligned(const Level& level, int a, int b) const;
  bool says_the_same(const Level& level, int a, int b) const;
  int normal_of(const Level& level, int corner) const;
  const std::vector<float>& st_values() const;
  size_t st_width() const;
  void move(const Triangles& t, std::vector<float>& points, const std::vector<float>& normals) const;

  const Displacing& how_;
  const Footprint& print_;
  double pixels_;
  std::vector<double> stretches_;  // of the footprint's views: a length's in them, on the whole
  Moved mesh_;
  std::vector<float> moved_;  // by vertex, kMovedNumbers
  std::vector<float> shift_;  // by vertex: the vector at the frame, nearly
  std::vector<uint8_t> is_torn_, is_turned_;
  std::vector<int32_t> corners_;
  std::vector<int32_t> counts_;  // of a level's vertices: corners that have been asked for
  bool is_tangential_ = false;
};

}  // namespace primray::subdivision
