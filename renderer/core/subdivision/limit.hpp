// Limit positions of vertices under infinite refinement, and the surface's normals there.
//
// Masks of smooth vertices: Halstead, Kass and DeRose 1993 (Catmull-Clark), Loop 1987 and Hoppe et al. 1994. Creases and
// boundaries: the cubic B-spline's position, and for tangents the left eigenvectors of the schemes' own matrices (limit.cpp).
// Semi-sharp vertices are first refined, within the ring of faces around them, until only infinite sharpness is left.
#pragma once

#include <map>
#include <span>
#include <utility>
#include <vector>

#include "math/vec3.hpp"
#include "subdivision/masks.hpp"
#include "subdivision/topology.hpp"

namespace primray::subdivision {

// A fan cut by infinitely sharp edges: each piece has a separate normal.
struct FanNormals {
  std::vector<dvec3> normals;      // unit length, outwards
  std::vector<int32_t> of_corner;  // index of the normal for the fan's corners, in its order
};

// Limits of fans in a level where the scheme's faces are all alike (quads, Loop's triangles). Not for bilinear ones.
class Limit {
 public:
  explicit Limit(Scheme scheme) : scheme_(scheme) {}

  // Writes the limit of vertex `v` to `out`, (width,).
  void position(const Topology& t, int v, std::span<const double> values, int width, double* out);
  // Writes the limit of positions (3,) for a vertex with nothing sharp about it; returns its normal.
  dvec3 smooth_point(const Topology& t, int v, std::span<const double> positions, double* out);
  // Normals of the fan that contains `corner`.
  void normals(const Topology& t, int corner, std::span<const double> positions, FanNormals& out);
  const Fan& fan() const { return fan_; }

 private:
  // Values of a fan in its order: the vertex, its spokes, the far corners of its quads.
  struct Ring {
    int width = 0, spokes = 0, faces = 0;
    bool closed = false;
    float vertex_sharpness = 0;
    std::vector<float> sharpness;
    std::vector<double> v, e, f;
  };
  using Turn = std::vector<std::pair<double, double>>;  // cos and sin of 2 pi i / n

  void load(const Topology& t, int corner, std::span<const double> values, int width);
  void refine();
  void settle();
  bool is_settled() const;
  int infinite_spokes() const;
  void smooth_position(double* out) const;
  void ring_position(double* out);
  dvec3 smooth_ring_normal();
  dvec3 sector_normal(int first, int faces, bool is_corner) const;
  dvec3 area_normal(int first, int faces) const;
  dvec3 spoke(int i) const;
  dvec3 diagonal(int i) const;
  const Turn& turn(int n);

  Scheme scheme_;
  Fan fan_;
  Ring ring_;
  std::vector<double> next_e_, next_f_, next_v_;
  std::map<int, Turn> turns_;
};

}  // namespace primray::subdivision
