// Splitting of faces (masks.hpp).
#include "subdivision/masks.hpp"

namespace primray::subdivision {
namespace {

struct Counts {
  int vertices = 0, edges = 0, faces = 0, corners = 0;
};

Counts number_chosen(const Topology& t, bool quads, const std::vector<uint8_t>& chosen, Split& s) {
  s.face_child.assign(t.faces(), -1), s.vertex_child.assign(t.vertices(), -1), s.edge_child.assign(t.edges(), -1);
  if (quads) s.face_point.assign(t.faces(), -1);
  Counts n;
  for (int f = 0; f < t.faces(); ++f) {
    if (!chosen[f]) continue;
    s.face_child[f] = quads ? n.corners : 4 * n.faces;
    if (quads) s.face_point[f] = n.faces;
    ++n.faces, n.corners += t.size(f);
    for (int c = t.begin(f), end = c + t.size(f); c < end; ++c) s.vertex_child[t.vertex[c]] = s.edge_child[t.edge[c]] = 0;
  }
  for (int32_t& v : s.vertex_child)
    if (v == 0) v = n.vertices++;
  for (int32_t& e : s.edge_child)
    if (e == 0) e = n.edges++;
  s.edge_points = n.vertices;
  if (quads)
    for (int32_t& f : s.face_point)
      if (f >= 0) f += n.vertices + n.edges;
  return n;
}

void allot(Topology& d, int arity, int faces, int edges) {
  d.arity = arity;
  d.vertex.resize(size_t(faces) * arity), d.twin.resize(d.vertex.size()), d.edge.resize(d.vertex.size());
  d.edge_corner.assign(edges, -1), d.edge_sharpness.assign(edges, 0);
}

// Half-edges of both halves of corner c's edge. `stride` is the number of corners of a child and `last` the corner that arrives
// at the child's vertex: child k of a face has corner k's vertex first.
struct Halves {
  const Topology& t;
  const Split& s;
  Topology& d;
  int stride;

  int child(int c) const {
    const int f = t.face_of(c);
    return s.face_child[f] < 0 ? -1 : s.face_child[f] + (c - t.begin(f));
  }
  // The half that touches the vertex of corner c, as an edge.
  int half_edge_of(int c, int v) const {
    const int e = t.edge[c];
    return 2 * s.edge_child[e] + (t.vertex[t.edge_corner[e]] != v);
  }
  void link(int c) {
    const int p = t.previous(c), v = t.vertex[c], at = stride * child(c);
    const int tc = t.twin[c], tp = t.twin[p];
    const int over = tc < 0 ? -1 : child(t.next(tc)), before = tp < 0 ? -1 : child(tp);
    d.edge[at] = half_edge_of(c, v);
    d.twin[at] = over < 0 ? -1 : stride * over + stride - 1;
    d.edge[at + stride - 1] = half_edge_of(p, v);
    d.twin[at + stride - 1] = before < 0 ? -1 : stride * before;
  }
};

void fill_quads(const Topology& t, const Split& s, Topology& d, int inner_edges) {
  Halves halves{t, s, d, 4};
  for (int f = 0; f < t.faces(); ++f) {
    const int child = s.face_child[f];
    if (child < 0) continue;
    const int b = t.begin(f), n = t.size(f);
    for (int k = 0; k < n; ++k) {
      const int c = b + k, at = 4 * (child + k), before = child + (k ? k - 1 : n - 1), after = child + (k + 1 < n ? k + 1 : 0);
      d.vertex[at] = s.vertex_child[t.vertex[c]];
      d.vertex[at + 1] = s.edge_point(t.edge[c]);
      d.vertex[at + 2] = s.face_point[f];
      d.vertex[at + 3] = s.edge_point(t.edge[t.previous(c)]);
      halves.link(c);
      d.edge[at + 1] = inner_edges + child + k, d.twin[at + 1] = 4 * after + 2;
      d.edge[at + 2] = inner_edges + before, d.twin[at + 2] = 4 * before + 1;
    }
  }
}

void fill_triangles(const Topology& t, const Split& s, Topology& d, int inner_edges) {
  Halves halves{t, s, d, 3};
  for (int f = 0; f < t.faces(); ++f) {
    const int child = s.face_child[f];
    if (child < 0) continue;
    const int middle = 3 * (child + 3), inner = inner_edges + child / 4 * 3;
    for (int k = 0; k < 3; ++k) {
      const int c = 3 * f + k, at = 3 * (child + k), across = middle + (k + 2) % 3;
      d.vertex[at] = s.vertex_child[t.vertex[c]];
      d.vertex[at + 1] = s.edge_point(t.edge[c]);
      d.vertex[at + 2] = s.edge_point(t.edge[t.previous(c)]);
      halves.link(c);
      d.vertex[middle + k] = d.vertex[at + 1];
      d.edge[at + 1] = d.edge[across] = inner + k;
      d.twin[at + 1] = across, d.twin[across] = at + 1;
    }
  }
}

}  // namespace

Topology split_faces(const Topology& t, Scheme scheme, const std::vector<uint8_t>& chosen, Split& s) {
  const bool quads = scheme != Scheme::kLoop;
  const Counts n = number_chosen(t, quads, chosen, s);
  Topology d;
  allot(d, quads ? 4 : 3, quads ? n.corners : 4 * n.faces, 2 * n.edges + (quads ? n.corners : 3 * n.faces));
  if (quads)
    fill_quads(t, s, d, 2 * n.edges);
  else
    fill_triangles(t, s, d, 2 * n.edges);
  for (int c = d.corners() - 1; c >= 0; --c) d.edge_corner[d.edge[c]] = c;
  for (int e = 0; e < t.edges(); ++e)
    if (const int k = s.edge_child[e]; k >= 0)
      d.edge_sharpness[2 * k] = d.edge_sharpness[2 * k + 1] = child_sharpness(t.edge_sharpness[e]);
  const int vertices = n.vertices + n.edges + (quads ? n.faces : 0);
  d.vertex_sharpness.assign(vertices, 0);
  for (int v = 0; v < t.vertices(); ++v)
    if (s.vertex_child[v] >= 0) d.vertex_sharpness[s.vertex_child[v]] = child_sharpness(t.vertex_sharpness[v]);
  finish_topology(d, vertices);
  return d;
}

}  // namespace primray::subdivision
