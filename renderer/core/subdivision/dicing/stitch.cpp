// Triangulation of the drawn faces (level.hpp).
#include "subdivision/dicing/level.hpp"

namespace primray::subdivision {
namespace {

// A corner of a level; as a side, the half-edge that leaves it. Level -1: a side inside a face, which nothing splits.
struct Place {
  int level, corner;
};
constexpr Place kInside{-1, 0};

class Stitcher {
 public:
  Stitcher(const std::vector<Level>& levels, const std::vector<float>& points) : levels_(levels), points_(points) {
    out_.values.resize(levels[0].values.size());
  }

  Triangles run() {
    reserve();
    for (size_t l = 0; l < levels_.size(); ++l) {
      const Level& level = levels_[l];
      for (int f = 0; f < level.surface.topology.faces(); ++f) {
        if (!level.is_active[f] || level.is_refined[f]) continue;
        cage_face_ = level.cage_face[f];
        draw(int(l), level.surface.topology, f);
      }
    }
    return std::move(out_);
  }

 private:
  // Reserves memory for faces without finer neighbours.
  void reserve() {
    size_t n = 0;
    for (const Level& level : levels_)
      for (int f = 0; f < level.surface.topology.faces(); ++f)
        if (level.is_active[f] && !level.is_refined[f]) n += level.surface.topology.size(f) - 2;
    out_.points.reserve(3 * n), out_.faces.reserve(n);
    if (!levels_[0].corner_normal.empty()) out_.normals.reserve(3 * n);
    for (std::vector<int32_t>& ids : out_.values) ids.reserve(3 * n);
  }

  void draw(int l, const Topology& t, int f) {
    const int b = t.begin(f);
    const Place p[4] = {{l, b}, {l, b + 1}, {l, b + 2}, {l, b + 3}};
    if (t.size(f) == 3) {
      triangle(p[0], p[1], p[2], p[0], p[1], p[2]);
    } else if (distance2(p[0], p[2]) <= distance2(p[1], p[3])) {
      triangle(p[0], p[1], p[2], p[0], p[1], kInside);
      triangle(p[0], p[2], p[3], kInside, p[2], p[3]);
    } else {
      triangle(p[1], p[2], p[3], p[1], p[2], kInside);
      triangle(p[1], p[3], p[0], kInside, p[3], p[0]);
    }
  }

  float distance2(Place a, Place b) const {
    const float *p = &points_[size_t(point(a)) * 3], *q = &points_[size_t(point(b)) * 3];
    const float x = p[0] - q[0], y = p[1] - q[1], z = p[2] - q[2];
    return x * x + y * y + z * z;
  }

  bool is_split(Place side) const {
    if (side.level < 0) return false;
    const Level& level = levels_[side.level];
    return !level.is_split_edge.empty() && level.is_split_edge[level.surface.topology.edge[side.corner]];
  }

  // Both halves of a split side, one level finer on the same side of the edge.
  void halve(Place side, Place& first, Place& second) const {
    const Level& level = levels_[side.level];
    const Topology& t = level.surface.topology;
    const int stride = levels_[side.level + 1].surface.topology.arity;
    const int f = t.face_of(side.corner), child = level.surface.split.face_child[f] - t.begin(f);
    first = {side.level + 1, stride * (child + side.corner)};
    second = {side.level + 1, stride * (child + t.next(side.corner)) + stride - 1};
  }

  // Halves its split sides, one after the other, towards the opposite corner.
  void triangle(Place a, Place b, Place c, Place ab, Place bc, Place ca) {
    if (is_split(ab)) {
      Place first, second;
      halve(ab, first, second);
      triangle(a, second, c, first, kInside, ca);
      triangle(second, b, c, second, bc, kInside);
    } else if (is_split(bc)) {
      triangle(b, c, a, bc, ca, ab);
    } else if (is_split(ca)) {
      triangle(c, a, b, ca, ab, bc);
    } else {
      add(a), add(b), add(c);
      out_.faces.push_back(cage_face_);
    }
  }

  int point(Place p) const {
    const Layer& s = levels_[p.level].surface;
    return s.output[s.topology.vertex[p.corner]];
  }

  void add(Place p) {
    const Level& level = levels_[p.level];
    out_.points.push_back(point(p));
    if (!level.corner_normal.empty()) out_.normals.push_back(level.corner_normal[p.corner]);
    for (size_t k = 0; k < level.values.size(); ++k)
      out_.values[k].push_back(level.values[k].output[level.values[k].topology.vertex[p.corner]]);
  }

  const std::vector<Level>& levels_;
  const std::vector<float>& points_;
  Triangles out_;
  int cage_face_ = 0;
};

}  // namespace

Triangles stitch(const std::vector<Level>& levels, const std::vector<float>& points) { return Stitcher(levels, points).run(); }

}  // namespace primray::subdivision
