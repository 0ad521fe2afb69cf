// Neighbourhood that shapes a face's limit patch: the faces around it up to creases, and the differences of their points that
// bound how far the patch is from flat.
#pragma once

#include <array>
#include <vector>

#include "subdivision/topology.hpp"

namespace primray::subdivision {

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

}  // namespace primray::subdivision
