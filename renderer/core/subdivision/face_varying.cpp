// Construction of the topologies of face-varying primvars (cage.hpp).
#include "subdivision/cage.hpp"

#include <algorithm>

namespace primray::subdivision {
namespace {

// Opens edges whose ends have other values on their other side; sets twins and edges.
void cut_seams(const Topology& t, std::span<const int32_t> values, Topology& d) {
  d.twin = t.twin;
  for (int c = 0; c < t.corners(); ++c) {
    const int o = t.twin[c];
    if (o >= 0 && (values[c] != values[t.next(o)] || values[t.next(c)] != values[o])) d.twin[c] = d.twin[o] = -1;
  }
  d.edge.assign(t.corners(), -1);
  for (int c = 0; c < t.corners(); ++c) {
    if (d.edge[c] >= 0) continue;
    d.edge[c] = d.edges();
    if (d.twin[c] >= 0) d.edge[d.twin[c]] = d.edges();
    d.edge_corner.push_back(c);
    d.edge_sharpness.push_back(d.twin[c] < 0 ? kInfinite : t.edge_sharpness[t.edge[c]]);
  }
}

// A fan of corners around a vertex that have one value.
struct ValueFan {
  int first;  // corner
  int faces = 0;
  float inner_sharpness = 0;  // of the edges inside it
  bool is_open;
};

ValueFan fan_at(const Topology& d, int corner) {
  ValueFan fan{corner, 0, 0, d.twin[corner] < 0};
  for (int c = corner; c >= 0;) {
    ++fan.faces;
    c = d.counter_clockwise(c);
    if (c == corner) break;
    if (c >= 0) fan.inner_sharpness = std::max(fan.inner_sharpness, d.edge_sharpness[d.edge[c]]);
  }
  return fan;
}

// Sharpness of a vertex's fans, where its seams or the boundary rule make it differ from the vertex's own.
class Sharpener {
 public:
  Sharpener(Boundary boundary, LinearRule rule) : rule_(rule) {
    linear_boundaries_ = rule == LinearRule::kBoundaries || rule == LinearRule::kAll;
    dependent_ = rule == LinearRule::kCornersPlus1 || rule == LinearRule::kCornersPlus2;
    sharp_tips_ = boundary != Boundary::kEdgeAndCorner && rule != LinearRule::kNone;
  }

  // `seams`: an edge at the vertex is cut; `values`: how many differ; `shared`: a value has more than one fan.
  void sharpen(std::span<const ValueFan> fans, bool seams, bool at_boundary, float vertex_sharpness, int values, bool shared,
               std::span<float> out) const {
    std::fill(out.begin(), out.end(), vertex_sharpness);
    const bool tip = at_boundary && fans.size() == 1 && fans[0].faces == 1;
    if (!seams && !(at_boundary && linear_boundaries_) && !(tip && sharp_tips_)) return;
    if (all_are_sharp(fans, at_boundary, vertex_sharpness, values, shared)) {
      std::fill(out.begin(), out.end(), kInfinite);
      return;
    }
    for (size_t k = 0; k < fans.size(); ++k) {
      if (fans[k].faces == 1 && rule_ != LinearRule::kNone) out[k] = kInfinite;
      // A fan that an inner crease sharpens for some levels sharpens its neighbour as well.
      if (dependent_ && fans.size() == 2) out[k] = std::max(out[k], fans[1 - k].inner_sharpness);
    }
  }

 private:
  bool all_are_sharp(std::span<const ValueFan> fans, bool at_boundary, float vertex_sharpness, int values, bool shared) const {
    if (linear_boundaries_ || vertex_sharpness >= kInfinite || shared) return true;
    const bool plus2 = rule_ == LinearRule::kCornersPlus2;
    if (dependent_ && values > 2) return true;
    if (plus2 && values == 1 && !at_boundary) return true;  // a dart
    return plus2 && values == 2 && std::any_of(fans.begin(), fans.end(), [](const ValueFan& f) { return f.faces == 1; });
  }

  LinearRule rule_;
  bool linear_boundaries_, dependent_, sharp_tips_;
};

// Corners of every vertex, by vertex.
struct CornersOf {
  std::vector<int32_t> first, corner;

  explicit CornersOf(const Topology& t) : first(t.vertices() + 1, 0), corner(t.corners()) {
    for (int v : t.vertex) ++first[v + 1];
    for (int v = 0; v < t.vertices(); ++v) first[v + 1] += first[v];
    std::vector<int32_t> at(first.begin(), first.end() - 1);
    for (int c = 0; c < t.corners(); ++c) corner[at[t.vertex[c]]++] = c;
  }
};

}  // namespace

ValueTopology face_varying_topology(const Cage& cage, Boundary boundary, LinearRule rule, std::span<const int32_t> values) {
  const Topology& t = cage.topology;
  ValueTopology out;
  Topology& d = out.topology;
  d.arity = t.arity, d.first = t.first, d.face = t.face;
  cut_seams(t, values, d);
  d.vertex.assign(t.corners(), -1);
  out.value.assign(t.vertices(), -1), d.vertex_sharpness.assign(t.vertices(), 0);
  const CornersOf of(t);
  const Sharpener sharpener(boundary, rule);
  std::vector<ValueFan> fans;
  std::vector<float> sharpness;
  std::vector<int32_t> distinct;
  for (int v = 0; v < t.vertices(); ++v) {
    const std::span<const int32_t> corners(of.corner.data() + of.first[v], of.first[v + 1] - of.first[v]);
    fans.clear(), distinct.clear();
    bool seams = false, at_boundary = false;
    for (const bool open : {true, false}) {  // closed fans are what open ones leave
      for (int c : corners) {
        if (d.vertex[c] >= 0 || (open && d.twin[c] >= 0)) continue;
        const int name = fans.empty() ? v : int(out.value.size()) + int(fans.size()) - 1;
        fans.push_back(fan_at(d, c));
        distinct.push_back(values[c]);
        for (int k = c; k >= 0 && d.vertex[k] < 0; k = d.counter_clockwise(k)) d.vertex[k] = name;
        if (open) (t.twin[c] >= 0 ? seams : at_boundary) = true;
      }
    }
    if (fans.empty()) continue;
    sharpness.assign(fans.size(), 0);
    std::vector<int32_t> unique = distinct;
    std::sort(unique.begin(), unique.end());
    const int different = int(std::unique(unique.begin(), unique.end()) - unique.begin());
    sharpener.sharpen(fans, seams, at_boundary, t.vertex_sharpness[v], different, different < int(fans.size()), sharpness);
    out.value[v] = distinct[0], d.vertex_sharpness[v] = sharpness[0];
    out.value.insert(out.value.end(), distinct.begin() + 1, distinct.end());
    d.vertex_sharpness.insert(d.vertex_sharpness.end(), sharpness.begin() + 1, sharpness.end());
  }
  finish_topology(d, int(out.value.size()));
  return out;
}

}  // namespace primray::subdivision
