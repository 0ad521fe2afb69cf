// Construction of emitters: every placement of an emissive mesh or sphere becomes a light row; instances share the choice among
// their triangles.
#include "build/emitters/emitters.hpp"

#include <algorithm>
#include <cmath>

#include "build/lights/lights.hpp"
#include "light/types/light_row.hpp"

namespace primray {
namespace {

daffine instance_matrix(const Scene& s, size_t instance) { return affine_from_columns(&s.world_from_group[12 * instance]); }

// Writes the fields of a geometry light to its row, for a placement of its group: kEmissionFactor, and those of any light.
void put_geometry_light(Scene& s, int32_t number, const daffine& world_from_group, float* row) {
  row[kEmissionFactor] = row[kEmissionFactor + 1] = row[kEmissionFactor + 2] = 1;
  if (number < 0) return;
  const GeometryLight& light = s.geometry_lights.all[number];
  copy_common_fields(light.row.data(), row);
  const vec3 L = placed_radiance(s, light, world_from_group);
  put(row, kEmissionFactor, dvec3(L));
  put_int(row, kLightFlags, int_at(row, kLightFlags) | (light.own ? kOwnRadiance : 0));
  if (light.shaping) add_shaping(*light.shaping, world_from_group * light.group_from_object, row, s.lights);
}

// Share of its radiance after the division by the area.
double share_of(const GeometryLight& light, const float* row) {
  const double whole = luminance(dvec3(light.radiance));
  return whole > 0 ? luminance(dvec3{row[kEmissionFactor], row[kEmissionFactor + 1], row[kEmissionFactor + 2]}) / whole : 0.0;
}

// Bounding sphere of the path of a part of a moving instance's group, and the part's largest size on it.
struct PathBounds {
  DoubleBox centers;
  double radius = 0;  // radius of the part's own bounding sphere
  double area = 0;    // squared size: factor of areas in the group's space, averaged over directions
  dvec3 center() const { return (centers.low + centers.high) * 0.5; }
  double reach() const { return 0.5 * length(centers.high - centers.low) * 1.1 + radius; }
};

// `center`, `own_radius`: bounding sphere of the part, in the group's space; `part`: frame in it whose unit sphere is queried.
PathBounds path_bounds(const Scene& s, size_t instance, const dvec3& center, double own_radius, const daffine& part) {
  const MovingInstances& moving = *s.motion.find(int32_t(instance));
  const MotionClock& clock = s.motion.clocks[size_t(moving.clock)];
  constexpr int kProbes = 8;  // per segment
  PathBounds ball;
  for (int k = 0; k <= clock.segments() * kProbes; ++k) {
    const int segment = std::min(k / kProbes, clock.segments() - 1);
    const float from = clock.times[size_t(segment)], to = clock.times[size_t(segment) + 1];
    const float time = from + (to - from) * (float(k - segment * kProbes) / kProbes);
    const daffine m = s.motion.at(moving, uint32_t(instance) - uint32_t(moving.first), time);
    const double sizes[] = {length(m.x), length(m.y), length(m.z)};
    ball.centers.add(m.point(center));
    ball.radius = std::max(ball.radius, own_radius * std::hypot(sizes[0], sizes[1], sizes[2]));
    const double x = length(m.vector(part.x)), y = length(m.vector(part.y)), z = length(m.vector(part.z));
    ball.area = std::max(ball.area, (x * y + y * z + z * x) / 3);
  }
  return ball;
}

const daffine kHere{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, dvec3(0.0)};

// Records that the next light row moves with an instance; `frame`: of its shape `k` in the group.
void set_moving_instance(Scene& s, size_t instance, int32_t k, const daffine& frame) {
  EmitterTable& table = s.emitters;
  table.moving_instance.resize(size_t(s.lights.count) + 1, -1);
  table.moving_instance.back() = int32_t(instance);
  table.frames.resize(table.first.size(), kHere);
  table.frames[size_t(k)] = frame;
}

// Writes the bounding sphere of a shape's path in a moving instance, in place of its own.
void put_path_bounds(const Scene& s, const ShapeWeight& w, size_t instance, float* row) {
  const PathBounds ball = path_bounds(s, instance, w.center(), w.radius(), kHere);
  double uneven = 1;
  const double axes[] = {length(light_vector(row, kAxisX)), length(light_vector(row, kAxisY)),
                         length(light_vector(row, kAxisZ))};
  const double least = std::min({axes[0], axes[1], axes[2]});
  if (least > 0) uneven = std::cbrt(axes[0] * axes[1] * axes[2]) / least;
  put(row, kMeshCenter, ball.center());
  row[kSize0] = float(ball.reach() * std::max(uneven, 1.0));
  put_int(row, kLightFlags, int_at(row, kLightFlags) | kMoving);
}

// `placement`, `instance`: see kMeshPlacement.
void add_mesh_row(Scene& s, const ShapeWeight& w, int32_t shape, const daffine& world_from_group, int placement, int instance) {
  float row[kLightFields] = {};
  put_int(row, kType, int(LightType::kMesh));
  row[kDiffuseFactor] = row[kSpecularFactor] = row[kInverseDet] = 1;
  put_int(row, kLightFlags, int(kGeometry));
  const daffine& m = world_from_group;
  put(row, kAxisX, m.x), put(row, kAxisY, m.y), put(row, kAxisZ, m.z), put(row, kOrigin, m.o);
  put(row, kMeshCenter, m.point(w.center()));
  const double size = std::cbrt(std::fabs(m.determinant()));
  row[kSize0] = float(w.radius() * size);
  put_geometry_light(s, w.light, m, row);
  const bool moves = placement >= 0 && s.motion.find(s.placement_instance[size_t(placement)]);
  if (moves) {
    const size_t passing = size_t(s.placement_instance[size_t(placement)] + instance);
    put_path_bounds(s, w, passing, row);
    set_moving_instance(s, passing, shape, w.light < 0 ? kHere : s.geometry_lights.all[w.light].group_from_object);
  }
  (!moves && put_rectangle(w.halves, m, row) ? s.emitters.rectangles : s.emitters.others) = true;
  const double share = w.light < 0 ? 1.0 : share_of(s.geometry_lights.all[w.light], row);
  put_int(row, kMeshIndex, shape), put_int(row, kMeshPlacement, placement + 1), put_int(row, kMeshInstance, int32_t(instance));
  row[kImportance] = float(w.power * size * size * share);
  s.lights.rows.insert(s.lights.rows.end(), row, row + kLightFields);
  ++s.lights.count;
  if (w.light >= 0) add_light_rules(s.geometry_lights.all[w.light].rules, s.scale, s.lights);
}

// Sets the end of the last row for light path expressions: a sphere that is merely emissive is an object.
void set_lpe_end(Scene& s, int32_t number) {
  if (number < 0) s.lights.ends.resize(size_t(s.lights.count) - 1, int32_t(kEndObject));
}

// Radiance of a sphere in a placement of its group.
vec3 sphere_radiance(const Scene& s, int32_t curved_row, int32_t number, const daffine& world_from_group) {
  const vec3 average = average_radiance(s, s.curved.surface[curved_row], number);
  if (number < 0) return average;
  const GeometryLight& own = s.geometry_lights.all[number];
  const double whole = luminance(dvec3(own.radiance));
  return whole > 0 ? average * float(luminance(dvec3(placed_radiance(s, own, world_from_group))) / whole) : average;
}

void add_sphere_row(Scene& s, const Group& group, int32_t curved_row, const daffine& world_from_group) {
  const uint32_t record = group.curved.of<SphereShape>().record_of(curved_row);
  const SphereShape::Record& shape = s.curved.records<SphereShape>()[record];
  LightInput light;
  light.type = LightType::kSphere, light.radius = 1;
  light.world_from_light = world_from_group * shape.to_group();
  const int32_t number = s.geometry_lights.curved(curved_row);
  light.emission = sphere_radiance(s, curved_row, number, world_from_group);
  const bool hit_test = s.lights.needs_hit_test;
  const int before = s.lights.count;
  add_light_rows(light, dvec3(0.0), 1.0, s.lights);
  s.lights.needs_hit_test = hit_test;  // rays hit it as geometry
  // Every shape of a group has its row, even if it emits nothing.
  if (s.lights.count == before) s.lights.rows.resize(s.lights.rows.size() + kLightFields, 0.0f), ++s.lights.count;
  float* row = &s.lights.rows[size_t(s.lights.count - 1) * kLightFields];
  put_int(row, kLightFlags, int_at(row, kLightFlags) | kGeometry);
  put_geometry_light(s, number, world_from_group, row);
  if (number >= 0) add_light_rules(s.geometry_lights.all[number].rules, s.scale, s.lights);
  set_lpe_end(s, number);
}

// Adds the row of shape `k`, a sphere in a moving instance: the bounding sphere of its path, of which the sphere is a part.
void add_moving_sphere_row(Scene& s, const Group& group, int32_t k, const daffine& world_from_group, size_t instance) {
  const int32_t curved_row = s.emitters.first[size_t(k)], number = s.geometry_lights.curved(curved_row);
  const uint32_t record = group.curved.of<SphereShape>().record_of(curved_row);
  const daffine sphere = s.curved.records<SphereShape>()[record].to_group();
  const double own_radius = std::max({length(sphere.x), length(sphere.y), length(sphere.z)});
  const PathBounds ball = path_bounds(s, instance, sphere.o, own_radius, sphere);
  const double reach = std::max(ball.reach(), kSmallestLight);
  float row[kLightFields] = {};
  put_int(row, kType, int(LightType::kSphere));
  put_int(row, kLightFlags, int(kGeometry | kMoving));
  row[kDiffuseFactor] = row[kSpecularFactor] = row[kInverseDet] = 1;
  for (const int field : {kAxisX, kInverseX})
    put(row, field, kHere.x), put(row, field + 3, kHere.y), put(row, field + 6, kHere.z);
  put(row, kOrigin, ball.center());
  row[kSize0] = float(reach);
  put_int(row, kPoseIndex, k);
  put_anchor(row, {kHere.x, kHere.y, kHere.z, ball.center()}, SphereLight::kAxial);
  const vec3 radiance = sphere_radiance(s, curved_row, number, world_from_group);
  put(row, kRadiance, dvec3(radiance));
  row[kImportance] = float(luminance(dvec3(radiance)) * ball.area / (reach * reach));
  put_geometry_light(s, number, world_from_group, row);
  set_moving_instance(s, instance, k, sphere);
  s.lights.rows.insert(s.lights.rows.end(), row, row + kLightFields);
  ++s.lights.count;
  add_light_rules(number < 0 ? LightRules{} : s.geometry_lights.all[number].rules, s.scale, s.lights);
  set_lpe_end(s, number);
}

// One placement of the group of each geometry light.
std::vector<daffine> first_places(const Scene& s) {
  std::vector<daffine> of_group(s.groups.size(), kHere);
  std::vector<char> known(s.groups.size(), 0);
  for (size_t p = 0; p < s.placement_group.size(); ++p) {
    const size_t group = size_t(s.placement_group[p]);
    if (!known[group]) of_group[group] = instance_matrix(s, s.placement_instance[p]), known[group] = 1;
  }
  std::vector<daffine> r;
  for (const GeometryLight& light : s.geometry_lights.all) {
    size_t group = 0;
    for (size_t g = 0; g < s.groups.size(); ++g) {
      const Group& in = s.groups[g];
      const size_t triangle = light.triangles.empty() ? SIZE_MAX : light.triangles[0].first;
      const bool holds = light.curved >= 0
                             ? in.curved.has_row(light.curved)
                             : triangle >= in.triangle_base && triangle < size_t(in.triangle_base) + in.all_triangles();
      if (holds) group = g;
    }
    r.push_back(of_group[group]);
  }
  return r;
}

}  // namespace

void build_emitters(Scene& s) {
  if (s.geometry_lights.any()) finish_geometry_lights(s, first_places(s));
  EmitterTable& table = s.emitters;
  MeshTable& meshes = s.meshes;
  std::vector<ShapeWeight> weights;
  std::vector<int32_t> group_first(s.groups.size() + 1);
  table.of_mesh.assign(meshes.surface.size(), -1), table.of_curved.assign(s.curved.rows(), -1);
  size_t row = 0;
  for (size_t g = 0; g < s.groups.size(); ++g) {
    const Group& group = s.groups[g];
    group_first[g] = int32_t(table.first.size());
    ShapeMaker shapes(s, group, weights);
    const size_t end = group.triangle_base + group.all_triangles();
    // Rows with the same first triangle belong to one mesh.
    while (row < meshes.surface.size() && size_t(meshes.triangle_base[row]) < end) {
      size_t next = row;
      bool emits = false;
      for (; next < meshes.surface.size() && meshes.triangle_base[next] == meshes.triangle_base[row]; ++next)
        emits |= max_component(average_radiance_of_mesh(s, next)) > 0;
      if (emits) {
        const size_t last = next < meshes.surface.size() ? size_t(meshes.triangle_base[next]) : s.indices.size() / 3;
        shapes.add({size_t(meshes.triangle_base[row]), std::min(last, end), row, next});
      }
      row = next;
    }
    shapes.finish();
    // Among curved shapes, spheres can be sampled; others are found by rays alone.
    const CurvedRange& spheres = group.curved.of<SphereShape>();
    for (uint32_t i = 0; i < spheres.count; ++i) {
      const uint32_t of = spheres.first_row + i;
      if (!(max_component(average_radiance(s, s.curved.surface[of], s.geometry_lights.curved(of))) > 0)) continue;
      ++table.shapes;
      table.of_curved[of] = int32_t(table.first.size()) - group_first[g];
      table.first.push_back(int32_t(of)), table.count.push_back(0), table.vertex_base.push_back(0);
      table.clock.push_back(-1), table.stride.push_back(0);
      for (auto* unused : {&table.corners, &table.root, &table.place_base, &table.run_shift, &table.cdf_base})
        unused->push_back(0);
      weights.push_back({});
    }
  }
  group_first.back() = int32_t(table.first.size());
  table.placement_light.assign(s.placement_group.size(), -1), table.placement_rows.assign(s.placement_group.size(), 0);
  if (!table.any()) return;

  const auto add_rows = [&](size_t group, const daffine& world_from_group, int placement, int instance) {
    for (int32_t k = group_first[group]; k < group_first[group + 1]; ++k) {
      if (table.count[k] > 0)
        add_mesh_row(s, weights[k], k, world_from_group, placement, instance);
      else if (placement >= 0 && s.motion.find(s.placement_instance[size_t(placement)]))
        add_moving_sphere_row(s, s.groups[group], k, world_from_group,
                              size_t(s.placement_instance[size_t(placement)] + instance));
      else
        add_sphere_row(s, s.groups[group], table.first[k], world_from_group);
    }
  };
  const int first_row = s.lights.count;
  if (group_first[1] > 0) {
    table.static_light = s.lights.count;
    add_rows(0, kHere, -1, 0);
  }
  for (size_t p = 0; p < s.placement_group.size(); ++p) {
    const size_t group = s.placement_group[p], first = s.placement_instance[p],
                 end = p + 1 < s.placement_group.size() ? s.placement_instance[p + 1] : s.world_from_group.size() / 12;
    const int64_t rows = group_first[group + 1] - group_first[group], wanted = rows * int64_t(end - first);
    if (rows == 0) continue;
    // With two levels of instances the inner ones are repeated for each outer one: no row holds those.
    const bool in_world = p - s.groups[0].placement_base < s.groups[0].placement_count;
    if (!in_world || s.lights.count - first_row + wanted > kMaxEmitterRows) {
      table.unsampled += wanted;
      continue;
    }
    table.placement_light[p] = s.lights.count, table.placement_rows[p] = int32_t(rows);
    for (size_t i = first; i < end; ++i) add_rows(group, instance_matrix(s, i), int(p), int(i - first));
  }
}

}  // namespace primray
