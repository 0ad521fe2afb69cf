// Construction of light paths.
#include "build/lights/lights.hpp"

#include <algorithm>

#include "math/box.hpp"
#include "motion/clock.hpp"

namespace primray {
namespace {

// Rotation of a matrix with perpendicular columns of any lengths.
daffine unit_axes(const daffine& m) {
  daffine r{normalize(m.x), normalize(m.y), normalize(m.z), dvec3(0.0)};
  if (r.determinant() < 0) r.x = r.x * -1.0, r.y = r.y * -1.0, r.z = r.z * -1.0;
  return r;
}

daffine transposed(const daffine& r) {
  return {{r.x.x, r.y.x, r.z.x}, {r.x.y, r.y.y, r.z.y}, {r.x.z, r.y.z, r.z.z}, dvec3(0.0)};
}

// Rotation from the nearest rotation of the first matrix to that of the second: for lights, whose motion is rigid, M2 M1^-1.
daffine rotation_between(const daffine& from, const daffine& to) {
  const daffine linear_from{from.x, from.y, from.z, dvec3(0.0)}, linear_to{to.x, to.y, to.z, dvec3(0.0)};
  if (is_regular(linear_from)) return linear_to * inverse(linear_from);
  return unit_axes(to) * transposed(unit_axes(from));
}

}  // namespace

void add_light_path(const LightInput& light, const dvec3& origin, double scale, int first_row, size_t first_dome,
                    LightTable& table) {
  if (light.times.empty()) return;
  LightPath path;
  path.clock = clock_of_times(light.times);
  const size_t steps = light.times.size();
  std::vector<daffine> relative(steps);
  DoubleBox places;
  for (size_t k = 0; k < steps; ++k) {
    const daffine m = affine_from_rows(&light.pose_matrices[12 * k]);
    relative[k] = rotation_between(light.world_from_light, m);
    relative[k].o = (m.o - origin) * scale;
    places.add(relative[k].o);
  }
  path.places.resize(steps);
  make_pose_segments(relative.data(), steps, path.places.data());
  path.origin = (light.world_from_light.o - origin) * scale;
  for (int i = first_row; i < table.count; ++i) {
    const LightType type = LightType(int_at(table.row(i), kType));
    if (type == LightType::kDistant || type == LightType::kDome) continue;
    // Extent about the centre of rotation, given by its box.
    const LightBox box = light_box(table.row(i));
    double reach = 0;
    for (int a = 0; a < 3; ++a) {
      const double o = component(path.origin, size_t(a));
      const double far = std::max(std::abs(box.low[a] - o), std::abs(box.high[a] - o));
      reach += far * far;
    }
    with_light_type(table.row(i), [&]<class T>(T) {
      LightBounds still;
      path.spread = float(T::tree_bounds(table.row(i), still).factor);
    });
    path.center = vec3((places.low + places.high) * 0.5);
    path.radius = float(std::max(0.5 * length(places.high - places.low) + std::sqrt(reach), kSmallestLight) * 1.0001);
  }
  const int32_t number = int32_t(table.motion.paths.size());
  table.motion.of_row.resize(size_t(table.count), -1), table.motion.of_dome.resize(table.domes.size(), -1);
  std::fill(table.motion.of_row.begin() + first_row, table.motion.of_row.end(), number);
  std::fill(table.motion.of_dome.begin() + ptrdiff_t(first_dome), table.motion.of_dome.end(), number);
  table.motion.paths.push_back(std::move(path));
}

}  // namespace primray
