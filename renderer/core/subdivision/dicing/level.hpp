// Levels of a cage that is being diced: the faces drawn at each, and the indices of their vertices, normals and values in the
// output mesh.
#pragma once

#include "subdivision/split.hpp"
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

}  // namespace primray::subdivision
