// Displacement of a diced surface: while it is diced, so that edges are measured where they end up, and afterwards, with new
// normals.
//
// A vertex is moved by one vector, the mean of those of its corners: neither seams of primvars, nor creases, nor subsets with
// other materials open cracks. A corner's displacement is evaluated at the level where its vertex first appears, and depends on
// nothing that is coarser there; tangents, which would, are those of the final triangles.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "math/vec3.hpp"
#include "subdivision/dicing/footprint.hpp"
#include "subdivision/dicing/level.hpp"

namespace primray::subdivision {

// Normals of displaced triangles: one per vertex where there was one, and several where a crease had several.

inline dvec3 vector_at(const std::vector<float>& from, int row) {
  const float* p = &from[3 * size_t(row)];
  return {p[0], p[1], p[2]};
}

// Angle of a triangle's corner at `a`: the weight of a face in a vertex normal, however faces are split (Thuermer and Wuethrich
// 1998, "Computing Vertex Normals from Polygonal Facets").
double corner_angle(const dvec3& a, const dvec3& b, const dvec3& c);

// Corners of the triangles that share a normal.
struct NormalGroups {
  std::vector<int32_t> of_corner;
  std::vector<int32_t> vertex;  // of each group
  bool is_by_vertex = false;    // a vertex has no more than one

  // Groups by `normals`, which the corners had before: those of a vertex with nearly one direction.
  NormalGroups(const Triangles& t, int vertices, const std::vector<float>& normals);
  // Normals of triangles with these points; where faces have none, `before`, of each vertex.
  std::vector<float> normals(const Triangles& t, const std::vector<float>& points, const std::vector<float>& before) const;
};

// One normal per vertex: its own, or the mean of its corners'.
std::vector<float> normals_by_vertex(const Triangles& t, const std::vector<float>& points, const std::vector<float>& normals);

// Corners of faces, in the cage's object space.
struct CornerRows {
  std::span<const float> points;      // 9 per corner: its point, that of the next corner and that of the previous one along its
                                      // face
  std::span<const float> normals;     // 3 per corner; unit length
  std::span<const float> footprints;  // lengths over which textures are averaged
  std::span<const int32_t> faces;     // of the cage
  // Three rows per corner, in the order of `points`: in the arrays of values by vertex, and in each face-varying primvar.
  std::span<const int32_t> vertices;
  std::span<const float> vertex_values, varying_values;
  std::vector<std::span<const int32_t>> channels;
  std::vector<std::span<const float>> channel_values;
};

// Components of a displacement: along the tangent of `st`, across it, and along the normal; then in the cage's object space.
constexpr int kMovedNumbers = 6;
using Displace = std::function<void(const CornerRows&, std::span<float>)>;  // kMovedNumbers per corner

// Location of a primvar: first column, or a face-varying primvar.
struct ValuePlace {
  enum class Kind { kNone, kVertex, kVarying, kFaceVarying };
  Kind kind = Kind::kNone;
  int at = 0;
};

struct Displacing {
  Displace displace;
  ValuePlace st;     // spans tangents
  int normals = -1;  // face-varying primvar along which the surface is displaced, three numbers per time; -1: its own normals
  bool faces_differ = false;
};

// Output mesh under construction.
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

  // Adds a level's new vertices (`is_new`), after they have their points, normals and values.
  void add(const Level& level, const std::vector<uint8_t>& is_new);
  // Approximate displaced position of a vertex: `points` are those of the frame or of a step.
  dvec3 point(const std::vector<float>& points, int vertex) const;
  // Whether a vertex's corners differ so much that edges to it stay long, however fine the mesh.
  bool is_torn(int vertex) const { return is_torn_[size_t(vertex)] || (is_tangential_ && is_turned_[size_t(vertex)]); }
  // Displaced points of all vertices, at the frame.
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
  std::vector<double> stretches_;  // of the footprint's views: mean scale of a length in them
  Moved mesh_;
  std::vector<float> moved_;  // by vertex, kMovedNumbers
  std::vector<float> shift_;  // by vertex: the approximate vector at the frame
  std::vector<uint8_t> is_torn_, is_turned_;
  std::vector<int32_t> corners_;
  std::vector<int32_t> counts_;  // of a level's vertices: corners that have been evaluated
  bool is_tangential_ = false;
};

}  // namespace primray::subdivision
