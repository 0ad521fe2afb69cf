// Flatness test: whether two triangles (one of Loop's) represent a face well enough, or how many more levels it takes.
//
// Positions may be off by a tenth of a pixel perpendicular to the surface, and along it where something ends at an edge (a
// crease, a seam, another material); normals around the face are within a degree of its own; primvars, seen as a texture, are
// off by no more than a tenth of a pixel either. Bounds come from the control points: a spline's distance from linear is at
// most 1/8 of its second differences in each direction and 1/4 of the mixed ones; elsewhere the convex hull bounds it.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "subdivision/dicing/footprint.hpp"
#include "subdivision/dicing/level.hpp"
#include "subdivision/topology.hpp"

namespace primray::subdivision {

// Neighbourhood that shapes a face's limit patch: the faces around it up to creases, and the differences of their points that
// bound how far the patch is from flat.

// Kind of a vertex for the sector of faces, between infinitely sharp edges, to which a face belongs there.
enum class Sector {
  kSmooth,      // all around, as many faces as a regular mesh has
  kCrease,      // a smooth crease or boundary with the regular number of faces on this side
  kBentCrease,  // a smooth crease with another number of faces
  kCorner,      // infinitely sharp: the vertex does not move
  kOther        // extraordinary, semi-sharp or the end of a crease
};

struct Neighbourhood {
  std::vector<int32_t> faces;  // the face first
  std::array<Sector, 4> sectors{};
  // Every vertex is regular (corners may have any number of faces): the patch is a B-spline, or a box spline for triangles.
  bool is_regular = false;
  // Second differences p[0] - 2 p[1] + p[2] along corner 0's edge and across it; quads only.
  std::array<std::vector<std::array<int32_t, 3>>, 2> bends;
  // Mixed differences p[0] - p[1] + p[2] - p[3] around a quad, or around two triangles that share an edge.
  std::vector<std::array<int32_t, 4>> twists;
};

// Gathers the neighbourhood of face `f`, 3 or 4 corners. `linear`: values that are (bi)linear over each face.
void gather_neighbourhood(const Topology& t, int f, bool linear, Neighbourhood& out);

// The vertex before `v` along the crease whose half-edge or reverse is the face's side `corner`; -1 without one.
int crease_neighbour(const Topology& t, int corner, int v);

// A primvar in the numbering of the level.
struct LevelValues {
  const Topology* topology;
  const std::vector<double>* values;
  int width = 0;
  bool linear = false;      // over each face of the level
  bool is_channel = false;  // with a topology of its own
};

class Flatness {
 public:
  Flatness(const Footprint& print, double pixels, bool linear, bool faces_differ, std::vector<uint8_t> cage_holes)
      : print_(print), tolerance_(pixels), linear_(linear), faces_differ_(faces_differ), cage_holes_(std::move(cage_holes)) {}

  // Returns the number of levels until face `f`, whose longest edge covers `longest` pixels, counts as flat; 0 if it does.
  double levels_to_flat(const Level& level, int f, const std::vector<double>& points, std::span<const LevelValues> values,
                        double longest);

 private:
  dvec3 point(int v) const { return {(*points_)[size_t(v) * 3], (*points_)[size_t(v) * 3 + 1], (*points_)[size_t(v) * 3 + 2]}; }
  dvec3 bend(const std::array<int32_t, 3>& d) const { return point(d[0]) - 2.0 * point(d[1]) + point(d[2]); }
  dvec3 twist(const std::array<int32_t, 4>& d) const { return point(d[0]) - point(d[1]) + (point(d[2]) - point(d[3])); }
  bool look();
  void measure_views();
  double pixels(dvec3 d) const;
  double levels_of(dvec3 off) const;
  double normal_levels() const;
  double height_levels() const;
  double edge_levels(const Level& level, std::span<const LevelValues> values) const;
  bool is_line_wanted(const Level& level, std::span<const LevelValues> values, int corner) const;
  double crease_levels(int k) const;
  double smooth_edge_levels(int k) const;
  double position_levels() const;
  double value_levels(const LevelValues& v, double along, double longest);
  double lattice_levels(const LevelValues& v, int component, double allowed) const;
  double joint_levels(const LevelValues& v, int component, double allowed) const;
  bool is_like_surface(const LevelValues& v) const;

  const Footprint& print_;
  double tolerance_;
  bool linear_, faces_differ_;
  std::vector<uint8_t> cage_holes_;

  const Topology* t_ = nullptr;
  const std::vector<double>* points_ = nullptr;
  int face_ = 0;
  Neighbourhood around_, around_values_;
  dvec3 normal_{0.0};
  double rounding_ = 0;  // of positions
  std::vector<double> view_scale_;
};

}  // namespace primray::subdivision
