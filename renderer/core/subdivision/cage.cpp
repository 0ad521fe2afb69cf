// Construction of cage.hpp.
#include "subdivision/cage.hpp"

#include <algorithm>

namespace primray::subdivision {
namespace {

// Half-edges of every pair of vertices, indexed by the lesser vertex.
class EdgeIndex {
 public:
  struct Entry {
    int32_t other, corner;
    bool operator<(const Entry& b) const { return other != b.other ? other < b.other : corner < b.corner; }
  };
  EdgeIndex(const Topology& t, int vertices) : first_(vertices + 1, 0), entries_(t.corners()) {
    for (int c = 0; c < t.corners(); ++c) ++first_[least(t, c) + 1];
    for (int v = 0; v < vertices; ++v) first_[v + 1] += first_[v];
    std::vector<int32_t> at(first_.begin(), first_.end() - 1);
    for (int c = 0; c < t.corners(); ++c) {
      const int v = least(t, c), a = t.vertex[c], b = t.vertex[t.next(c)];
      entries_[at[v]++] = {a == v ? b : a, c};
    }
    for (int v = 0; v < vertices; ++v) std::sort(entries_.begin() + first_[v], entries_.begin() + first_[v + 1]);
  }
  std::span<const Entry> of(int v) const { return std::span(entries_).subspan(first_[v], first_[v + 1] - first_[v]); }

 private:
  static int least(const Topology& t, int c) { return std::min(t.vertex[c], t.vertex[t.next(c)]); }
  std::vector<int32_t> first_;
  std::vector<Entry> entries_;
};

void set_faces(Topology& t, const CageInput& in) {
  const size_t n = in.face_counts.size();
  t.vertex.assign(in.face_points.begin(), in.face_points.end());
  const bool all_alike =
      n > 0 && std::all_of(in.face_counts.begin(), in.face_counts.end(), [&](int k) { return k == in.face_counts[0]; });
  t.arity = all_alike && (in.face_counts[0] == 3 || in.face_counts[0] == 4) ? in.face_counts[0] : 0;
  if (t.arity) return;
  t.first.reserve(n + 1), t.face.reserve(t.vertex.size());
  for (size_t f = 0; f < n; ++f) {
    t.first.push_back(int32_t(t.face.size()));
    t.face.insert(t.face.end(), in.face_counts[f], int32_t(f));
  }
  t.first.push_back(int32_t(t.face.size()));
}

// Sets edges, in the order of their first half-edges, and twins; returns the number of edges that more than two faces have, or
// two in the same direction.
int set_edges(Topology& t, const EdgeIndex& index, int vertices) {
  t.twin.assign(t.corners(), -1), t.edge.assign(t.corners(), -1);
  std::vector<int32_t> first(t.corners());  // of each corner: the first half-edge of its edge
  int non_manifold = 0;
  for (int v = 0; v < vertices; ++v) {
    const auto entries = index.of(v);
    for (size_t i = 0, k; i < entries.size(); i = k) {
      for (k = i; k < entries.size() && entries[k].other == entries[i].other; ++k) first[entries[k].corner] = entries[i].corner;
      const int a = entries[i].corner, b = entries[k - 1].corner;
      const bool joined = k - i == 2 && t.vertex[a] != t.vertex[b];
      if (joined) t.twin[a] = b, t.twin[b] = a;
      non_manifold += !joined && k - i > 1;
    }
  }
  for (int c = 0; c < t.corners(); ++c) {
    if (first[c] == c) {
      t.edge[c] = t.edges();
      t.edge_corner.push_back(c);
      t.edge_sharpness.push_back(t.twin[c] >= 0 ? 0 : kInfinite);
    }
    t.edge[c] = t.edge[first[c]];
  }
  return non_manifold;
}

int set_creases(Topology& t, const EdgeIndex& index, const CageInput& in) {
  int unknown = 0;
  size_t edges = 0;
  for (int n : in.crease_lengths) edges += n - 1;
  const bool by_edge = in.crease_sharpnesses.size() == edges && in.crease_sharpnesses.size() != in.crease_lengths.size();
  size_t point = 0, edge = 0;
  for (size_t k = 0; k < in.crease_lengths.size(); point += in.crease_lengths[k++]) {
    for (int i = 0; i + 1 < in.crease_lengths[k]; ++i, ++edge) {
      const int a = in.crease_points[point + i], b = in.crease_points[point + i + 1];
      const auto entries = index.of(std::min(a, b));
      const auto found = std::lower_bound(entries.begin(), entries.end(), EdgeIndex::Entry{std::max(a, b), 0});
      if (found == entries.end() || found->other != std::max(a, b)) {
        ++unknown;
        continue;
      }
      float& s = t.edge_sharpness[t.edge[found->corner]];
      s = std::max(s, in.crease_sharpnesses[by_edge ? edge : k]);
    }
  }
  return unknown;
}

// Sets corners where faces or fans touch in a single point, and those that the boundary rule makes sharp.
void set_corners(Cage& cage, const CageInput& in) {
  Topology& t = cage.topology;
  std::vector<int32_t> corners(in.points, 0), fans(in.points, 0), ends(in.points, 0), in_open_fans(in.points, 0);
  for (int c = 0; c < t.corners(); ++c) {
    ++corners[t.vertex[c]];
    if (t.twin[c] >= 0) continue;
    ++fans[t.vertex[c]];
    for (int k = c; k >= 0; k = t.counter_clockwise(k)) ++in_open_fans[t.vertex[c]];
  }
  for (int e = 0; e < t.edges(); ++e) {
    const int c = t.edge_corner[e];
    if (t.twin[c] < 0) ++ends[t.vertex[c]], ++ends[t.vertex[t.next(c)]];
  }
  cage.is_singular.assign(in.points, 0);
  for (int v = 0; v < in.points; ++v) {
    int whole = 0;  // corners of a closed fan, if that is all there is
    if (corners[v] && !fans[v])
      for (int c = t.outgoing[v];;) {
        ++whole;
        if ((c = t.counter_clockwise(c)) == t.outgoing[v]) break;
      }
    const bool one_fan = fans[v] ? fans[v] == 1 && in_open_fans[v] == corners[v] : whole == corners[v];
    const bool one_curve = ends[v] == 2 && in_open_fans[v] == corners[v];
    cage.is_singular[v] = !one_fan;
    const bool tip = corners[v] == 1 && in.boundary == Boundary::kEdgeAndCorner;
    if (tip || (!one_fan && !one_curve)) t.vertex_sharpness[v] = kInfinite;
  }
}

// interpolateBoundary none: removes faces at vertices whose boundary is not entirely made sharp by creases.
void cut_boundary_faces(Cage& cage, const std::vector<uint8_t>& is_open) {
  const Topology& t = cage.topology;
  std::vector<uint8_t> at_boundary(t.vertices(), 0);
  for (int e = 0; e < t.edges(); ++e) {
    if (!is_open[e]) continue;
    const int c = t.edge_corner[e];
    at_boundary[t.vertex[c]] = at_boundary[t.vertex[t.next(c)]] = 1;
  }
  for (int c = 0; c < t.corners(); ++c)
    if (at_boundary[t.vertex[c]]) cage.is_hole[t.face_of(c)] = 1;
}

}  // namespace

Cage build_cage(const CageInput& in) {
  Cage cage;
  Topology& t = cage.topology;
  set_faces(t, in);
  const EdgeIndex index(t, in.points);
  cage.non_manifold_edges = set_edges(t, index, in.points);
  t.vertex_sharpness.assign(in.points, 0);
  finish_topology(t, in.points);
  std::vector<uint8_t> is_open(t.edges(), 0);
  if (in.boundary == Boundary::kNone) {
    std::vector<float> ends(t.edges(), 0);
    std::swap(ends, t.edge_sharpness);
    set_creases(t, index, in);
    for (int e = 0; e < t.edges(); ++e) is_open[e] = ends[e] >= kInfinite && t.edge_sharpness[e] < kInfinite;
    std::swap(ends, t.edge_sharpness);
  }
  cage.unknown_creases = set_creases(t, index, in);
  set_corners(cage, in);
  for (size_t k = 0; k < in.corner_points.size(); ++k) {
    float& s = t.vertex_sharpness[in.corner_points[k]];
    s = std::max(s, in.corner_sharpnesses[k]);
  }
  finish_topology(t, in.points);
  cage.is_hole.assign(t.faces(), 0);
  for (int f : in.holes) cage.is_hole[f] = 1;
  if (in.boundary == Boundary::kNone) cut_boundary_faces(cage, is_open);
  return cage;
}

}  // namespace primray::subdivision
