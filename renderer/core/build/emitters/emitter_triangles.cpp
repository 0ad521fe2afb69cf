// Choice among a shape's triangles (emitters.hpp). A tree needs about 150 bytes per leaf, so the triangles of large shapes
// share leaves: runs of consecutive triangles, which are usually adjacent.
#include "build/emitters/emitters.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "math/box.hpp"
#include "scene/scene.hpp"

namespace primray {
namespace {

// Weight of back faces of closed emissive shapes: a triangle seen from its back is usually behind the shape's front.
// MediumState such a shape all triangles are seen from the back, and none is preferred.
constexpr float kBackFloor = 0.1f;
// Cosine limit that includes all directions.
constexpr float kAllSides = -1.01f;
// Lower limit of a run's weight relative to the strongest, so that none is lost to underflow.
constexpr double kWeakest = 1e-20;

// Returns 1 or -1 if every edge is shared by two triangles that pass it in opposite directions, depending on whether their
// normals point out of the volume or into it; otherwise 0.
int outward(const ShapeTriangles& shape) {
  std::vector<uint64_t> edges, opposite;
  edges.reserve(3 * shape.count), opposite.reserve(3 * shape.count);
  double volume = 0;
  const dvec3 middle = shape.corners(0)[0];  // precision goes to the shape, not to its position
  for (size_t t = 0; t < shape.count; ++t) {
    const auto i = shape.indices(t);
    for (size_t k = 0; k < 3; ++k) {
      const uint64_t a = i[k], b = i[(k + 1) % 3];
      edges.push_back(a << 32 | b), opposite.push_back(b << 32 | a);
    }
    const auto p = shape.corners(t);
    volume += dot(p[0] - middle, cross(p[1] - middle, p[2] - middle));
  }
  std::sort(edges.begin(), edges.end()), std::sort(opposite.begin(), opposite.end());
  const bool closed = edges == opposite && std::adjacent_find(edges.begin(), edges.end()) == edges.end();
  return !closed || volume == 0 ? 0 : volume > 0 ? 1 : -1;
}

LightBounds bounds_of_run(const ShapeTriangles& shape, const std::vector<double>& powers, size_t begin, size_t end, int side) {
  LightBounds b;
  DoubleBox box;
  dvec3 sum(0.0), normal(0.0);
  double power = 0, area = 0;
  for (size_t t = begin; t < end; ++t) {
    const auto p = shape.corners(t);
    normal = cross(p[1] - p[0], p[2] - p[0]);
    power += powers[t], area += 0.5 * length(normal), sum = sum + (p[0] + p[1] + p[2]) * (powers[t] / 3);
    for (const dvec3& q : p) box.add(q);
    for (size_t step = 1; step <= shape.later; ++step)
      for (const dvec3& q : shape.corners(t, step)) box.add(q);
  }
  const dvec3 center = shape.later > 0 ? (box.low + box.high) * 0.5 : sum * (1 / power);
  if (shape.later > 0) area = std::max(area, dot(box.high - box.low, box.high - box.low));
  for (size_t a = 0; a < 3; ++a) {
    b.low[a] = float(component(box.low, a)), b.high[a] = float(component(box.high, a));
    b.center[a] = float(component(center, a)), b.axis[a] = 0;
  }
  b.least2 = std::max(float(area / std::numbers::pi), 1e-24f);
  if (side == 0 || end - begin > 1 || shape.later > 0) return b;
  const dvec3 n = normalize(normal) * double(side);
  for (size_t a = 0; a < 3; ++a) b.axis[a] = float(component(n, a));
  b.cos_end = kAllSides, b.floor = kBackFloor;
  return b;
}

}  // namespace

std::array<uint32_t, 3> ShapeTriangles::indices(size_t triangle) const {
  const uint32_t* i = &scene.indices[3 * (first + triangle)];
  return {i[0], i[1], i[2]};
}

std::array<dvec3, 3> ShapeTriangles::corners(size_t triangle, size_t step) const {
  std::array<dvec3, 3> r;
  const auto corner = indices(triangle);
  for (size_t k = 0; k < 3; ++k) {
    const float* p = &scene.positions[3 * (vertex_base + corner[k] + step * stride)];
    r[k] = {p[0], p[1], p[2]};
  }
  return r;
}

void add_triangle_choice(const ShapeTriangles& shape, const std::vector<ShapeTriangles>& meshes,
                         const std::vector<double>& powers, EmitterTable& table) {
  int shift = 0;
  while ((shape.count >> shift) > kMostTriangleRuns) ++shift;
  const size_t runs = ((shape.count - 1) >> shift) + 1;
  std::vector<int> side(shape.count, 0);
  for (const ShapeTriangles& mesh : meshes)
    if (shift == 0) std::fill_n(side.begin() + ptrdiff_t(mesh.first - shape.first), mesh.count, outward(mesh));
  std::vector<double> power(runs);
  for (size_t t = 0; t < shape.count; ++t) power[t >> shift] += powers[t];
  const double strongest = *std::max_element(power.begin(), power.end());
  std::vector<LightBounds> bounds(runs);
  std::vector<int32_t> numbers;
  for (size_t r = 0; r < runs; ++r) {
    if (!(power[r] > 0)) continue;
    bounds[r] = bounds_of_run(shape, powers, r << shift, std::min((r + 1) << shift, shape.count), side[r << shift]);
    bounds[r].intensity = float(std::max(power[r] / strongest, kWeakest));
    numbers.push_back(int32_t(r));
  }
  LightTree& tree = table.by_place.tree;
  std::vector<LightTree::Place> places;
  table.root.push_back(add_light_tree(tree, bounds, numbers, places));
  table.place_base.push_back(int32_t(tree.places.size())), table.run_shift.push_back(shift);
  tree.places.resize(tree.places.size() + runs, {-1, -1});
  for (size_t k = 0; k < numbers.size(); ++k) tree.places[size_t(table.place_base.back() + numbers[k])] = places[k];
  table.cdf_base.push_back(int32_t(table.cdf.size()));
  if (shift == 0) return;
  const double whole = std::accumulate(powers.begin(), powers.end(), 0.0);
  double sum = 0;
  table.cdf.push_back(0);
  for (const double p : powers) table.cdf.push_back(int32_t(std::llround((sum += p) / whole * EmitterTable::kWhole)));
}

}  // namespace primray
