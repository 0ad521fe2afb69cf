// Construction of the EmitterTable's shapes, and detection of emissive rectangles.

#include <algorithm>
#include <cmath>

#include "build/emitters/emitters.hpp"
#include "build/inputs/input_facts.hpp"
#include "math/row.hpp"
#include "scene/scene.hpp"

namespace primray {

// Detection of emissive rectangles.

namespace {

// Tolerance relative to the size: densities are only as exact as that.
constexpr double kClose = 1e-5;

// Returns the corner of `t` that is not in `other`; -1 unless all others are.
int own_corner(const std::array<uint32_t, 3>& t, const std::array<uint32_t, 3>& other) {
  int own = -1, shared = 0;
  for (int k = 0; k < 3; ++k) {
    if (std::find(other.begin(), other.end(), t[size_t(k)]) != other.end())
      ++shared;
    else
      own = k;
  }
  return shared == 2 ? own : -1;
}

}  // namespace

ShapeHalves find_halves(const ShapeTriangles& shape, const std::vector<double>& powers) {
  if (shape.later > 0 || shape.count != 2 || !(powers[0] > 0) || !(powers[1] > 0)) return {};
  const auto i = shape.indices(0), j = shape.indices(1);
  const int k = own_corner(i, j), l = own_corner(j, i);
  // Both have the same orientation: the corner after the own corner in one comes before it in the other.
  if (k < 0 || l < 0 || i[size_t(k + 1) % 3] != j[size_t(l + 2) % 3]) return {};
  const auto p = shape.corners(0), q = shape.corners(1);
  const dvec3 corner = p[size_t(k)], x = p[size_t(k + 1) % 3] - corner, y = p[size_t(k + 2) % 3] - corner;
  const dvec3 off = corner + x + y - q[size_t(l)];
  if (!(length(off) <= kClose * std::min(length(x), length(y)))) return {};
  return {k + 3 * l, x * 0.5, y * 0.5};
}

bool put_rectangle(const ShapeHalves& halves, const daffine& world_from_group, float* row) {
  if (halves.corners < 0) return false;
  const dvec3 x = world_from_group.vector(halves.x), y = world_from_group.vector(halves.y);
  const double sizes = length(x) * length(y);
  if (!(sizes > 1e-30) || !(std::fabs(dot(x, y)) <= kClose * sizes)) return false;
  put(row, kMeshHalfX, x), put(row, kMeshHalfY, y);
  put_int(row, kLightFlags, int_at(row, kLightFlags) | kRectangle);
  return true;
}

namespace {

std::vector<double> powers_of(const Scene& s, const ShapeTriangles& shape) {
  std::vector<double> powers;
  for (size_t t = 0; t < shape.count; ++t) {
    const double L = luminance(dvec3(average_radiance_of_mesh(s, s.triangle_mesh[shape.first + t])));
    double area = 0;  // the largest over time: it must not be 0 unless it is so at all times
    for (size_t step = 0; step <= shape.later; ++step) {
      const auto p = shape.corners(t, step);
      area = std::max(area, 0.5 * length(cross(p[1] - p[0], p[2] - p[0])));
    }
    powers.push_back(L > 0 ? L * area : 0.0);
  }
  return powers;
}

ShapeWeight weigh(const Scene& s, const ShapeTriangles& shape, size_t row) {
  ShapeWeight w;
  const std::vector<double> powers = powers_of(s, shape);
  for (size_t t = 0; t < shape.count; ++t) {
    w.power += powers[t];
    if (!(powers[t] > 0)) continue;
    for (size_t step = 0; step <= shape.later; ++step)
      for (const dvec3& q : shape.corners(t, step)) w.box.add(q);
  }
  if (!(w.power > 0) || !std::isfinite(w.power)) return {};
  w.halves = find_halves(shape, powers);
  w.light = s.geometry_lights.mesh(row);
  return w;
}

}  // namespace

vec3 average_radiance(const Scene& s, int32_t surface, int32_t light) {
  const float presence = s.surfaces.rows[size_t(surface) * kSurfaceFields + kPresence];
  if (light < 0) return average_emission(s, surface) * presence;
  const GeometryLight& own = s.geometry_lights.all[light];
  return (own.own ? vec3(1.0f) : average_emission(s, surface)) * own.radiance * presence;
}

vec3 average_radiance_of_mesh(const Scene& s, size_t row) {
  return average_radiance(s, s.meshes.surface[row], s.geometry_lights.mesh(row));
}

void ShapeMaker::add(const EmittingMesh& mesh) {
  const ShapeWeight w = weigh(s_, triangles(mesh.first, mesh.end), mesh.row);
  if (!(w.power > 0)) return;
  ++s_.emitters.shapes;
  if (!meshes_.empty() && (!joins(mesh, w) || moves(mesh.first) != moves(meshes_.front().first))) finish();
  weight_ = meshes_.empty() ? w : weight_;
  if (!meshes_.empty()) weight_.power += w.power, weight_.box.add(w.box);
  meshes_.push_back(mesh);
}

void ShapeMaker::finish() {
  if (meshes_.empty()) return;
  EmitterTable& table = s_.emitters;
  const ShapeTriangles shape = triangles(meshes_.front().first, meshes_.back().end);
  const int32_t number = int32_t(table.first.size() - group_first_);
  std::vector<ShapeTriangles> parts;
  std::vector<double> powers(shape.count, 0.0);  // of meshes between them: none
  for (const EmittingMesh& m : meshes_) {
    parts.push_back(triangles(m.first, m.end));
    const std::vector<double> own = powers_of(s_, parts.back());
    std::copy(own.begin(), own.end(), powers.begin() + ptrdiff_t(m.first - shape.first));
    std::fill(table.of_mesh.begin() + ptrdiff_t(m.row), table.of_mesh.begin() + ptrdiff_t(m.next), number);
  }
  table.first.push_back(int32_t(shape.first)), table.count.push_back(int32_t(shape.count));
  table.vertex_base.push_back(int32_t(shape.vertex_base)), table.corners.push_back(weight_.halves.corners);
  table.clock.push_back(shape.later > 0 ? group_.clock : -1), table.stride.push_back(int32_t(shape.stride));
  add_triangle_choice(shape, parts, powers, table);
  weights_.push_back(weight_);
  meshes_.clear();
}

bool ShapeMaker::moves(size_t triangle) const { return triangle >= size_t(group_.triangle_base) + group_.still_count(); }

ShapeTriangles ShapeMaker::triangles(size_t first, size_t end) const {
  ShapeTriangles shape{s_, first, end - first, group_.vertex_base};
  if (!moves(first)) return shape;
  shape.later = size_t(s_.motion.clocks[size_t(group_.clock)].segments()), shape.stride = group_.moving_vertex_count;
  return shape;
}

bool ShapeMaker::joins(const EmittingMesh& mesh, const ShapeWeight& w) const {
  if (w.light >= 0 || weight_.light >= 0 || w.halves.corners >= 0 || weight_.halves.corners >= 0) return false;
  if (mesh.end - meshes_.front().first > kMostTriangleRuns) return false;
  return length(w.center() - weight_.center()) < w.radius() + weight_.radius();
}

}  // namespace primray
