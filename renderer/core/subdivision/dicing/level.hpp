// Levels of a cage that is being diced: the faces drawn at each, the indices of their vertices, normals and values in the
// output mesh, and the triangulation of the drawn faces.
#pragma once

#include <vector>

#include "subdivision/masks.hpp"
#include "subdivision/topology.hpp"

namespace primray::subdivision {

// A topology with its numbering into the next level, and into the output: -1 where a vertex is not (yet) part of it.
struct Layer {
  Topology topology;
  Split split;
  std::vector<int32_t> output;
};

struct Level {
  Layer surface;
  std::vector<Layer> values;           // one per face-varying primvar
  std::vector<uint8_t> is_active;      // of each face: it, or what it is split into, is drawn; others only serve masks
  std::vector<uint8_t> is_refined;     // of each face: active, and drawn at a finer level
  std::vector<uint8_t> is_split_edge;  // of each edge: a refined face has it
  std::vector<int32_t> cage_face;      // of each face
  std::vector<int32_t> corner_normal;  // of each corner; empty where normals belong to vertices

  // Frees what only the masks need, once the next level exists.
  void keep_numbers_only() {
    shrink(surface.topology);
    for (Layer& layer : values) shrink(layer.topology);
  }

 private:
  static void shrink(Topology& t) {
    t.twin = {}, t.edge_corner = {}, t.outgoing = {}, t.edge_sharpness = {}, t.vertex_sharpness = {}, t.is_sharp = {};
  }
};

// Triangulation of the drawn faces of all levels. A face beside finer ones includes the vertices that these have on its edges,
// so that every edge of the mesh has the same two ends on both sides.
struct Triangles {
  std::vector<int32_t> points;               // three per triangle, into the output's vertices
  std::vector<int32_t> normals;              // three per triangle; empty where normals belong to vertices
  std::vector<std::vector<int32_t>> values;  // one per face-varying primvar
  std::vector<int32_t> faces;                // of the cage, one per triangle
};

// `points`: the output's vertices, three floats each.
Triangles stitch(const std::vector<Level>& levels, const std::vector<float>& points);

}  // namespace primray::subdivision
