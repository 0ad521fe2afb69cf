// Topology of one level of a subdivided cage: faces, half-edges and sharpnesses, which the masks traverse. Knows no positions.
//
// A corner is also the half-edge that leaves it along its face. Face-varying primvars have another topology over the same
// corners, in which vertices are values and seams are boundaries (cage.hpp), so that one set of masks serves both.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace primray::subdivision {

enum class Scheme { kCatmullClark, kLoop, kBilinear };
enum class Boundary { kNone, kEdgeOnly, kEdgeAndCorner };

inline constexpr float kInfinite = 10;  // UsdGeomMesh, SHARPNESS_INFINITE

// Sharpness one level down (DeRose, Kass and Truong 1998, section 3: uniform semi-sharp creases).
inline float child_sharpness(float s) { return s >= kInfinite ? s : (s > 1 ? s - 1 : 0); }

struct Topology {
  int arity = 0;                      // corners of every face: 3 or 4, 0 where they differ
  std::vector<int32_t> first;         // arity 0: first corner of each face, then the number of corners
  std::vector<int32_t> face;          // arity 0: of each corner
  std::vector<int32_t> vertex;        // of each corner
  std::vector<int32_t> twin;          // of each corner: the opposite half-edge, -1 where the surface ends
  std::vector<int32_t> edge;          // of each corner
  std::vector<int32_t> edge_corner;   // of each edge: its first half-edge
  std::vector<float> edge_sharpness;  // infinite where the surface ends
  std::vector<float> vertex_sharpness;
  std::vector<int32_t> outgoing;  // of each vertex: the corner at which its fan begins, -1 for isolated points
  std::vector<uint8_t> is_sharp;  // of each vertex: it, or an edge at it, is sharp

  int corners() const { return int(vertex.size()); }
  int edges() const { return int(edge_corner.size()); }
  int vertices() const { return int(outgoing.size()); }
  int faces() const { return arity ? corners() / arity : int(first.size()) - 1; }
  int face_of(int c) const { return arity == 4 ? c >> 2 : (arity == 3 ? c / 3 : face[c]); }
  int begin(int f) const { return arity ? f * arity : first[f]; }
  int size(int f) const { return arity ? arity : first[f + 1] - first[f]; }
  int next(int c) const {
    if (arity == 4) return (c & ~3) | ((c + 1) & 3);
    const int f = face_of(c), b = begin(f);
    return c + 1 == b + size(f) ? b : c + 1;
  }
  int previous(int c) const {
    if (arity == 4) return (c & ~3) | ((c + 3) & 3);
    const int f = face_of(c), b = begin(f);
    return c == b ? b + size(f) - 1 : c - 1;
  }
  // The next corner around the same vertex, -1 past the last one.
  int counter_clockwise(int c) const { return twin[previous(c)]; }
  int clockwise(int c) const { return twin[c] < 0 ? -1 : next(twin[c]); }
};

// Sets `outgoing` and `is_sharp` from the other fields; `vertices` is the number of vertices.
void finish_topology(Topology& t, int vertices);

// The corners around a vertex, counter-clockwise; an open fan begins and ends where the surface does.
struct Fan {
  std::vector<int32_t> corners;  // one per face
  std::vector<int32_t> spokes;   // the vertices at the other ends of its edges; an open fan has one more than corners
  std::vector<float> sharpness;  // of the spokes
  bool closed = false;
};

// Gathers the fan that contains `corner`.
void gather_fan(const Topology& t, int corner, Fan& fan);

}  // namespace primray::subdivision
