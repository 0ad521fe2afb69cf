// Detection of emissive rectangles.
#include "build/emitters/emitter_rectangles.hpp"

#include <algorithm>
#include <cmath>

#include "math/row.hpp"
#include "scene/scene.hpp"

namespace primray {
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
  row[kLightFlags] = float(int(row[kLightFlags]) | kRectangle);
  return true;
}

}  // namespace primray
