// Normals of displaced triangles (mover.hpp).
#include "subdivision/dicing/mover.hpp"

#include <cmath>

#include "subdivision/dicing/level.hpp"

namespace primray::subdivision {
namespace {

constexpr double kAlike = 0.99985;  // cosine of a degree

bool put_unit(const dvec3& n, float* to) {
  const double l = length(n);
  if (!(l > 1e-12) || !std::isfinite(l)) return false;
  to[0] = float(n.x / l), to[1] = float(n.y / l), to[2] = float(n.z / l);
  return true;
}

}  // namespace

double corner_angle(const dvec3& a, const dvec3& b, const dvec3& c) {
  const dvec3 e = b - a, f = c - a;
  return std::atan2(length(cross(e, f)), dot(e, f));
}

NormalGroups::NormalGroups(const Triangles& t, int vertices, const std::vector<float>& normals) {
  if (t.normals.empty()) {
    of_corner = t.points, is_by_vertex = true;
    vertex.resize(size_t(vertices));
    for (int v = 0; v < vertices; ++v) vertex[size_t(v)] = v;
    return;
  }
  std::vector<int32_t> last(size_t(vertices), -1), before, like;  // linked lists of groups by vertex, from the last one back
  of_corner.resize(t.points.size());
  is_by_vertex = true;
  for (size_t i = 0; i < t.points.size(); ++i) {
    const int v = t.points[i];
    const dvec3 n = vector_at(normals, t.normals[i]);
    int g = last[size_t(v)];
    while (g >= 0 && !(dot(n, vector_at(normals, like[size_t(g)])) > kAlike)) g = before[size_t(g)];
    if (g < 0) {
      g = int(vertex.size());
      is_by_vertex &= last[size_t(v)] < 0;
      before.push_back(last[size_t(v)]), like.push_back(t.normals[i]), vertex.push_back(v);
      last[size_t(v)] = g;
    }
    of_corner[i] = g;
  }
  if (!is_by_vertex) return;
  for (size_t i = 0; i < t.points.size(); ++i) of_corner[i] = t.points[i];
  vertex.resize(size_t(vertices));
  for (int v = 0; v < vertices; ++v) vertex[size_t(v)] = v;
}

std::vector<float> NormalGroups::normals(const Triangles& t, const std::vector<float>& points,
                                         const std::vector<float>& before) const {
  std::vector<dvec3> sums(vertex.size(), dvec3(0.0));
  for (size_t i = 0; i + 3 <= t.points.size(); i += 3) {
    const dvec3 p[3] = {vector_at(points, t.points[i]), vector_at(points, t.points[i + 1]), vector_at(points, t.points[i + 2])};
    const dvec3 n = cross(p[1] - p[0], p[2] - p[0]);
    const double l = length(n);
    if (!(l > 0)) continue;
    for (size_t k = 0; k < 3; ++k)
      sums[size_t(of_corner[i + k])] += n * (corner_angle(p[k], p[(k + 1) % 3], p[(k + 2) % 3]) / l);
  }
  std::vector<float> made(3 * vertex.size());
  for (size_t g = 0; g < vertex.size(); ++g)
    if (!put_unit(sums[g], &made[3 * g]))
      for (size_t k = 0; k < 3; ++k) made[3 * g + k] = before[3 * size_t(vertex[g]) + k];
  return made;
}

std::vector<float> normals_by_vertex(const Triangles& t, const std::vector<float>& points, const std::vector<float>& normals) {
  if (t.normals.empty()) return normals;
  const size_t vertices = points.size() / 3;
  std::vector<dvec3> sums(vertices, dvec3(0.0));
  for (size_t i = 0; i < t.points.size(); ++i) {
    const size_t first = i - i % 3, k = i % 3;
    const auto at = [&](size_t corner) { return vector_at(points, t.points[first + corner % 3]); };
    sums[size_t(t.points[i])] += vector_at(normals, t.normals[i]) * corner_angle(at(k), at(k + 1), at(k + 2));
  }
  std::vector<float> made(3 * vertices, 0.0f);
  for (size_t v = 0; v < vertices; ++v)
    put_unit(sums[v], &made[3 * v]);  // two sides of a sheet cancel out: the previous
                                      // normal stays
  return made;
}

}  // namespace primray::subdivision
