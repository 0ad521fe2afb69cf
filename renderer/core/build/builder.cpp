// Construction of the scene, including the camera's lens, and reopening of finished scenes; lights are in builder_lights.cpp.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <string_view>
#include <unordered_map>
#include <utility>

#include "accel/build.hpp"
#include "base/error.hpp"
#include "base/time_spans.hpp"
#include "build/builder.hpp"
#include "build/emitters/emitters.hpp"
#include "build/inputs/input_facts.hpp"
#include "build/lights/lights.hpp"

namespace primray {

// Part of SceneBuilder that sets a distorting lens.

namespace {

DistortionModel model_of(std::string_view name) {
  constexpr std::array<std::pair<std::string_view, DistortionModel>, 7> kModels{{
      {"rational", DistortionModel::kRational},
      {"angle-to-radius", DistortionModel::kAngleToRadius},
      {"radius-to-angle", DistortionModel::kRadiusToAngle},
      {"table", DistortionModel::kTable},
      {"rays", DistortionModel::kRays},
      {"lat-long", DistortionModel::kLatLong},
      {"cube", DistortionModel::kCube},
  }};
  for (const auto& [known, model] : kModels)
    if (known == name) return model;
  throw Error("internal", "unknown distortion model");
}

// Fewest surfaces for which hits are sorted, of whatever kind: an input that is connected to a constant must not change bits.
constexpr size_t kLeastSorted = 6;

}  // namespace

void SceneBuilder::set_distortion(const DistortionInput& input) {
  auto made = std::make_unique<Distortion>();
  made->model = model_of(input.model);
  std::copy_n(input.coefficients.begin(), std::min(input.coefficients.size(), size_t(Distortion::kCoefficients)), made->k);
  made->most_angle = input.most_angle;
  if (made->model == DistortionModel::kLatLong) made->k[0] *= scene_->scale;
  const double* w = input.table_window;
  made->table = {input.table_columns,
                 input.table_rows,
                 w[0],
                 w[1],
                 w[2],
                 w[3],
                 std::vector<float>(input.directions.begin(), input.directions.end()),
                 std::vector<float>(input.places.begin(), input.places.end())};
  for (float& coordinate : made->table.places) coordinate = float(coordinate * scene_->scale);
  const size_t directions = 3 * size_t(made->table.columns) * size_t(made->table.rows);
  if (made->table.directions.size() != directions ||
      made->table.places.size() != (made->model == DistortionModel::kRays ? directions : 0))
    throw Error("internal", "the table of directions has the wrong size");
  made->limit();
  Camera& camera = scene_->camera;
  scene_->distortion = std::move(made), camera.distortion = scene_->distortion.get();
  const ExactWindow& film = camera.window;
  camera.finest = float(camera.distortion->finest(film.left, film.right, film.bottom, film.top));
}

void SceneBuilder::set_flaws(const CameraInput& c) {
  Camera& camera = scene_->camera;
  const double unit = scene_->scale;
  LensFlaws& f = camera.flaws;
  f.natural = c.natural_vignetting;
  f.rim_distance = float(c.rim_distance * unit), f.rim_radius = float(c.rim_radius * unit);
  for (int i = 0; i < 3; ++i) {
    f.magnification[i] = float(c.magnification[i]), f.focus_shift[i] = float(c.focus_shift[i] * unit);
    f.is_chromatic |= c.magnification[i] != 1 || (c.focus_shift[i] != 0 && camera.has_lens());
  }
  camera.flawed = f.any() && !camera.orthographic;
}

// Part of SceneBuilder that reopens finished scenes. Embree, and user geometry, point to the Scene and into its arrays: these
// stay in place.
SceneBuilder::SceneBuilder(std::unique_ptr<Scene> scene)
    : scene_(std::move(scene)), is_reopened_(true), keeps_accel_(true), keeps_surfaces_(true) {
  Scene& s = *scene_;
  if (s.moves()) throw Error("internal", "a scene with motion cannot be reopened");
  group_origin_ = s.origin, group_scale_ = s.scale;
  pattern_levels_ = pattern_levels(s);
  s.camera = {}, s.distortion.reset(), s.outlines = {};
}

bool SceneBuilder::keeps_means() {
  if (pattern_levels_.empty()) return true;
  measure_levels();
  return pattern_levels(*scene_) == pattern_levels_;
}

void SceneBuilder::drop_surfaces_and_lights() {
  Scene& s = *scene_;
  if (s.geometry_lights.any()) throw Error("internal", "lights that are shapes cannot be given again");
  keeps_surfaces_ = levels_measured_ = false;
  s.positions.resize(s.positions.size() - 4), s.indices.pop_back();  // what finish() added; their memory stays
  s.surfaces = {}, s.surface_inputs_of.clear(), s.surface_inputs.clear(), s.tapes.clear();
  keep_domes(std::move(s.lights.domes));
  LinkTable links = std::move(s.lights.links);
  s.lights = {}, s.lights.links = std::move(links);
  s.emitters = {}, s.interiors = {}, s.camera_visibility = {};
  if (s.volumes) std::fill(s.volumes->light_of.begin(), s.volumes->light_of.end(), -1);
  s.camera = {}, s.distortion.reset();
  s.has_emission = s.has_thin = s.shadows_need_hits = s.has_smooth_glass = false;
}

bool SceneBuilder::replace_mesh(size_t row, const MeshInput& mesh, const daffine& before, const daffine& group_from_object) {
  Scene& s = *scene_;
  const bool mirrored = group_from_object.determinant() < 0;
  if (!mesh.times.empty() || mesh.cutout || mirrored != (before.determinant() < 0)) return false;
  if (keeps_accel_) {
    for (Group& group : s.groups) group.accel = {}, group.curve_accel = {};
    s.placed.clear(), s.cutouts.clear();
    s.few_triangles = {}, s.triangle_bvh = {};
    keeps_accel_ = false;
  }
  place_points(mesh.points, group_from_object, s.positions.data() + 3 * size_t(s.meshes.vertex_base.at(row)));
  if (row < s.object_spaces.of_mesh.size() && s.object_spaces.of_mesh[row] > 0) {
    const daffine group_from_world{
        {group_scale_, 0, 0}, {0, group_scale_, 0}, {0, 0, group_scale_}, group_origin_ * -group_scale_};
    s.object_spaces.put(size_t(s.object_spaces.of_mesh[row]), group_from_world * group_from_object);
  }
  const PlacedNormals placed(group_from_object);
  const int order[3] = {0, mirrored ? 2 : 1, mirrored ? 1 : 2};
  float* to = s.normals.data() + s.meshes.normal_base[row];
  for (size_t i = 0; i < mesh.normals.size() / 3; ++i) {
    const size_t j = 3 * (mesh.normal_kind == Attribute::kCorner ? i - i % 3 + order[i % 3] : i);
    const dvec3 n = placed({mesh.normals[j], mesh.normals[j + 1], mesh.normals[j + 2]});
    to[3 * i] = float(n.x), to[3 * i + 1] = float(n.y), to[3 * i + 2] = float(n.z);
  }
  return true;
}

std::vector<int> SceneBuilder::release_coarse_textures() {
  std::vector<int> released;
  if (scene_->textures.empty()) return released;
  measure_levels();
  for (size_t i = 0; i < scene_->textures.size(); ++i) {
    Texture& t = scene_->textures[i];
    if (has_needed_levels(t, t)) continue;
    t.images.clear(), t.tiles.fill(-1);
    released.push_back(int(i));
  }
  return released;
}

namespace {

constexpr size_t kMaxElements = size_t(1) << 31;  // gathers address elements by 32-bit signed numbers

void put(std::vector<float>& v, const dvec3& p) { v.insert(v.end(), {float(p.x), float(p.y), float(p.z)}); }

}  // namespace

SceneBuilder::SceneBuilder(dvec3 origin, double scale) : scene_(std::make_unique<Scene>()) {
  scene_->origin = origin;
  scene_->scale = scale;
  begin_prototype(origin, scale);
}

int SceneBuilder::begin_prototype(dvec3 center, double scale) {
  end_group();
  group_origin_ = center, group_scale_ = scale;
  Group g;
  g.triangle_base = uint32_t(scene_->indices.size() / 3), g.vertex_base = uint32_t(scene_->positions.size() / 3);
  scene_->groups.push_back(std::move(g));
  outside_from_group_.push_back({{1 / scale, 0, 0}, {0, 1 / scale, 0}, {0, 0, 1 / scale}, center});
  group_from_outside_.push_back({{scale, 0, 0}, {0, scale, 0}, {0, 0, scale}, center * -scale});
  return int(scene_->groups.size()) - 1;
}

void SceneBuilder::add_mesh(const MeshInput& mesh, const daffine& group_from_object) {
  Scene& s = *scene_;
  Group& group = s.groups.back();
  const size_t points = mesh.points.size() / 3, triangles = mesh.triangles.size() / 3;
  if (s.positions.size() + 3 * points >= kMaxElements || s.indices.size() + 3 * triangles >= kMaxElements)
    throw Error("too-large", "more than 715 million points or triangles");
  const int32_t first_vertex = int32_t(s.positions.size() / 3), first_triangle = int32_t(s.indices.size() / 3);
  const bool moves = !mesh.times.empty();
  const std::span<const float> first_points = moves ? mesh.step_points : mesh.points;
  s.positions.resize(s.positions.size() + 3 * points);
  place_points(first_points.first(3 * points), group_from_object, s.positions.data() + 3 * size_t(first_vertex));
  // A mirrored mesh keeps its outside by reversing its triangles; attributes by corner are reordered with them.
  const bool mirrored = group_from_object.determinant() < 0;
  const int order[3] = {0, mirrored ? 2 : 1, mirrored ? 1 : 2};
  const uint32_t base = uint32_t(first_vertex) - group.vertex_base;
  for (size_t t = 0; t < triangles; ++t)
    for (int k : order) s.indices.push_back(base + uint32_t(mesh.triangles[3 * t + k]));

  MeshTable& table = s.meshes;
  const auto add_vectors = [&](std::vector<float>& to, std::span<const float> from, Attribute kind, auto convert) {
    const int32_t at = int32_t(to.size());
    if (to.size() + from.size() >= kMaxElements) throw Error("too-large", "more than 715 million normals or colours");
    for (size_t i = 0; i < from.size() / 3; ++i) {
      const size_t j = kind == Attribute::kCorner ? i - i % 3 + order[i % 3] : i;
      put(to, convert(dvec3{from[3 * j], from[3 * j + 1], from[3 * j + 2]}));
    }
    return at;
  };
  const PlacedNormals placed(group_from_object);
  const bool normals_move = !mesh.step_normals.empty();
  int32_t normals = int32_t(s.normals.size());
  for (size_t step = 0; step < (normals_move ? mesh.times.size() : 1); ++step)
    add_vectors(s.normals,
                normals_move ? mesh.step_normals.subspan(step * mesh.normals.size(), mesh.normals.size()) : mesh.normals,
                mesh.normal_kind, placed);
  const int32_t colors = add_vectors(s.colors, mesh.colors, mesh.color_kind, [](const dvec3& c) { return c; });

  last_mesh_rows_ = table.surface.size(), last_mirrored_ = mirrored, last_is_curved_ = false;
  // One row for each surface of the mesh; most meshes have one.
  std::unordered_map<int32_t, int32_t> row_of_surface;
  for (size_t t = 0; t < triangles; ++t) {
    const int32_t surface = mesh.surfaces[mesh.surfaces.size() == 1 ? 0 : t];
    if (t > 0 && mesh.surfaces.size() == 1) {
      s.triangle_mesh.push_back(s.triangle_mesh.back());
      continue;
    }
    const auto [row, is_new] = row_of_surface.try_emplace(surface, int32_t(table.surface.size()));
    if (is_new) {
      table.surface.push_back(surface);
      table.normals.push_back(int32_t(mesh.normal_kind)), table.colors.push_back(int32_t(mesh.color_kind));
      table.normal_base.push_back(normals), table.color_base.push_back(colors);
      table.triangle_base.push_back(first_triangle), table.vertex_base.push_back(first_vertex);
      if (s.lights.links.any()) table.link.push_back(link_row_);
      if (moves) table.normal_stride.resize(table.surface.size(), 0);
      if (normals_move) table.normal_stride.back() = int32_t(mesh.normals.size());
      s.primvars.of_mesh.insert(s.primvars.of_mesh.end(), s.primvars.names, -1);
      record_object_space(s.object_spaces.of_mesh, size_t(row->second), surface, group_from_object);
    }
    s.triangle_mesh.push_back(row->second);
  }
  group.vertex_count += uint32_t(points);
  if (moves ? group.moving_cutout_count > 0 && !mesh.cutout
            : group.cutout_count + group.moving_count + group.moving_cutout_count > 0 &&
                  !(mesh.cutout && group.moving_vertex_count == 0))
    throw Error("internal", "meshes of a group must precede its cutouts and its moving meshes");
  if (moves)
    (mesh.cutout ? group.moving_cutout_count : group.moving_count) += uint32_t(triangles);
  else
    (mesh.cutout ? group.cutout_count : group.triangle_count) += uint32_t(triangles);
  if (moves) add_mesh_steps(mesh, group_from_object);
  s.has_cutouts |= mesh.cutout && triangles > 0;
  s.has_attributes |= mesh.normal_kind != Attribute::kNone || mesh.color_kind != Attribute::kNone;
}

void SceneBuilder::place_points(std::span<const float> points, const daffine& group_from_object, float* to) const {
  for (size_t i = 0; i + 3 <= points.size(); i += 3) {
    const dvec3 p = to_group(group_from_object.point({points[i], points[i + 1], points[i + 2]}));
    to[i] = float(p.x), to[i + 1] = float(p.y), to[i + 2] = float(p.z);
  }
}

void SceneBuilder::add_curved_row(CurvedRange& range, size_t record, int32_t surface) {
  CurvedTable& table = scene_->curved;
  if (range.count == 0) range.first = uint32_t(record), range.first_row = uint32_t(table.rows());
  if (range.first_row + range.count != table.rows()) throw Error("internal", "curved shapes of one kind must be consecutive");
  ++range.count;
  add_curved_row(surface);
}

void SceneBuilder::add_curved_row(int32_t surface) {
  CurvedTable& table = scene_->curved;
  table.surface.push_back(surface);
  if (scene_->lights.links.any()) table.link.push_back(link_row_);
  scene_->primvars.of_curved.insert(scene_->primvars.of_curved.end(), scene_->primvars.names, -1);
  last_curved_taken_ = true;
}

void SceneBuilder::reserve_triangles(size_t points, size_t triangles) {
  if (3 * points >= kMaxElements || 3 * triangles >= kMaxElements)
    throw Error("too-large", "more than 715 million points or triangles");
  scene_->positions.reserve(3 * points + 4);  // and what finish() adds
  scene_->indices.reserve(3 * triangles + 1), scene_->triangle_mesh.reserve(triangles);
}

void SceneBuilder::reserve_instances(size_t count) {
  if (count >= kMaxElements / 12) throw Error("too-large", "more than 178 million instances");
  scene_->world_from_group.reserve(12 * count);
}

void SceneBuilder::begin_placement(int parent, int prototype) {
  Scene& s = *scene_;
  parent_ = parent, undo_ = outside_from_group_[prototype], redo_ = group_from_outside_[parent];
  Group& group = s.groups[parent];
  if (group.placement_count == 0) group.placement_base = uint32_t(s.placement_group.size());
  s.placement_group.push_back(prototype);
  s.placement_instance.push_back(int32_t(s.world_from_group.size() / 12));
  s.primvars.of_placement.insert(s.primvars.of_placement.end(), s.primvars.names, -1);
}

std::vector<int64_t> SceneBuilder::add_instances(std::span<const double> rows) {
  std::vector<float>& to = scene_->world_from_group;
  if (to.size() + rows.size() >= kMaxElements) throw Error("too-large", "more than 178 million instances");
  std::vector<int64_t> left_out;
  for (size_t i = 0; i < rows.size(); i += 12) {
    const daffine parent_from_prototype = affine_from_rows(&rows[i]);
    if (!is_regular(parent_from_prototype)) {
      left_out.push_back(int64_t(i / 12));
      continue;
    }
    const daffine m = redo_ * (parent_from_prototype * undo_);
    for (const dvec3* c : {&m.x, &m.y, &m.z, &m.o}) put(to, *c);
  }
  return left_out;
}

namespace {

// The columns of a rotation by a quaternion of any length; one of length 0 does not rotate.
void rotate(const double* q, dvec3 (&axes)[3]) {
  const double x = q[0], y = q[1], z = q[2], w = q[3];
  const double square = x * x + y * y + z * z + w * w, by = square > 0 ? 2.0 / square : 0.0;
  const double xs = x * by, ys = y * by, zs = z * by;
  axes[0] = {1 - (y * ys + z * zs), x * ys + w * zs, x * zs - w * ys};
  axes[1] = {x * ys - w * zs, 1 - (x * xs + z * zs), y * zs + w * xs};
  axes[2] = {x * zs + w * ys, y * zs - w * xs, 1 - (x * xs + y * ys)};
}

// Products in the order of the matrix product that NumPy leaves to its library, fused as there.
dvec3 turned(const daffine& m, const dvec3& v) {
  const auto row = [&](double a, double b, double c) { return std::fma(c, v.z, std::fma(b, v.y, a * v.x)); };
  return {row(m.x.x, m.y.x, m.z.x), row(m.x.y, m.y.y, m.z.y), row(m.x.z, m.y.z, m.z.z)};
}

}  // namespace

std::vector<int64_t> SceneBuilder::add_point_instances(const daffine* outer, std::span<const double> positions,
                                                       std::span<const double> orientations, std::span<const double> scales) {
  std::vector<double> rows(positions.size() * 4);
  for (size_t i = 0; i < positions.size() / 3; ++i) {
    dvec3 axes[3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
    if (!orientations.empty()) rotate(&orientations[4 * i], axes);
    if (!scales.empty())
      for (size_t k = 0; k < 3; ++k) axes[k] *= scales[3 * i + k];
    dvec3 at{positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]};
    if (outer) {
      for (dvec3& axis : axes) axis = turned(*outer, axis);
      at = turned(*outer, at) + outer->o;
    }
    double* row = &rows[12 * i];
    for (size_t k = 0; k < 3; ++k) row[k] = axes[k].x, row[4 + k] = axes[k].y, row[8 + k] = axes[k].z;
    row[3] = at.x, row[7] = at.y, row[11] = at.z;
  }
  return add_instances(rows);
}

void SceneBuilder::end_placement() {
  Scene& s = *scene_;
  const Group& g = s.groups[s.placement_group.back()];
  const size_t first = size_t(s.placement_instance.back()) * 12;
  if (g.empty() || s.world_from_group.size() == first) {
    s.world_from_group.resize(first);
    s.placement_group.pop_back(), s.placement_instance.pop_back();
    s.primvars.of_placement.resize(s.primvars.of_placement.size() - s.primvars.names);
    last_placement_taken_ = false;
    return;
  }
  last_placement_taken_ = true;
  s.groups[parent_].placement_count++;
  s.has_instances = true;
  s.has_grouped |= g.placement_count > 0;
}

int SceneBuilder::add_ies_profile(const IesInput& profile) { return add_ies(profile, scene_->lights.shaping.profiles); }

void SceneBuilder::set_camera(const CameraInput& c) {
  Scene& s = *scene_;
  Camera& camera = s.camera;
  const daffine& m = c.world_from_camera;
  camera.width = c.width, camera.height = c.height, camera.pixels = c.pixels, camera.orthographic = c.orthographic;
  camera.world_from_camera = {vec3(m.x), vec3(m.y), vec3(m.z), vec3((m.o - s.origin) * s.scale)};
  const double unit = c.orthographic ? s.scale : 1.0;
  camera.left = float(c.window[0] * unit), camera.right = float(c.window[1] * unit);
  camera.bottom = float(c.window[2] * unit), camera.top = float(c.window[3] * unit);
  camera.window = {c.window[0], c.window[1], c.window[2], c.window[3]};
  // Embree's rays see nothing before their origin.
  const double back = std::max(0.0, -c.near);
  camera.back = float(back * s.scale);
  camera.near = float((c.near + back) * s.scale), camera.far = float((c.far + back) * s.scale);
  for (size_t i = 0; i + 4 <= c.clipping_planes.size(); i += 4) {
    const double* p = &c.clipping_planes[i];
    const double size = std::max({std::fabs(p[0]), std::fabs(p[1]), std::fabs(p[2])}), unit = size > 0 ? 1 / size : 1;
    camera.clipping_planes.push_back(
        {float(p[0] * unit), float(p[1] * unit), float(p[2] * unit), float(std::clamp(p[3] * unit * s.scale, -3e38, 3e38))});
  }
  camera.blades = c.blades;
  camera.first_corner = float(c.blade_rotation_deg / 360 - std::floor(c.blade_rotation_deg / 360));
  camera.lens_radius = float(c.lens_radius * s.scale), camera.focus_distance = float(c.focus_distance * s.scale);
  camera.filter.box_width = c.filter_width;
  camera.filter.inverse_cdf.assign(c.filter_inverse_cdf.begin(), c.filter_inverse_cdf.end());
  if (!c.distortion.model.empty()) set_distortion(c.distortion);
  if (!c.times.empty()) set_camera_path(c);
  set_flaws(c);
}

VolumeTable& SceneBuilder::volumes() {
  if (!scene_->volumes) scene_->volumes = std::make_unique<VolumeTable>();
  return *scene_->volumes;
}

int SceneBuilder::add_grid(const GridInput& grid) { return volumes().add_grid(grid); }

daffine SceneBuilder::core_from_world() const {
  const double scale = scene_->scale;
  return {{scale, 0, 0}, {0, scale, 0}, {0, 0, scale}, scene_->origin * -scale};
}

std::vector<int64_t> SceneBuilder::add_medium(const MediumInput& medium) {
  return volumes().add_medium(medium, core_from_world(), scene_->scale);
}

std::vector<int64_t> SceneBuilder::add_volume_emission(const VolumeEmissionInput& emission) {
  return volumes().add_emission(emission, core_from_world(), scene_->scale);
}

std::unique_ptr<Scene> SceneBuilder::finish_view() {
  share_tile_memory();
  find_camera_media(*scene_);
  scene_->outlines = find_light_outlines(*scene_);
  return std::move(scene_);
}

std::unique_ptr<Scene> SceneBuilder::finish() {
  if (keeps_surfaces_) return finish_view();
  Scene& s = *scene_;
  end_group();
  if (s.motion.any_points) s.meshes.normal_stride.resize(s.meshes.surface.size(), 0);
  s.curves.shrink();
  s.positions.insert(s.positions.end(), 4, 0.0f);  // Embree reads 16 bytes of the last vertex
  s.indices.push_back(0);                          // the core does so for the last triangle
  for (size_t i = 0; i < s.surfaces.rows.size(); i += kSurfaceFields) {
    const float* row = &s.surfaces.rows[i];
    const int flags = int_at(row, kFlags);
    s.has_emission |= (flags & kEmits) != 0;
    s.shadows_need_hits |= ((flags & kThin) && row[kTransmission] > 0) || row[kPresence] < 1;
    s.has_thin |= (flags & kHair) != 0;
  }
  // Camera rays pass through hidden surfaces as if these were transmissive.
  s.shadows_need_hits |= s.camera_visibility.any();
  share_tile_memory();
  set_input_features(s);
  const size_t surfaces = s.surfaces.rows.size() / kSurfaceFields;
  for (size_t i = 0; i < surfaces; ++i) {
    float row[kSurfaceFields];
    average_row(s, int32_t(i), row);
    s.has_smooth_glass |= (int_at(row, kFlags) & kPreview) && row[kTransmission] > 0 && row[kAlpha] == 0;
  }
  if (surfaces >= kLeastSorted && !s.volumes && !s.interiors.has_bounded())
    s.sort_shift = std::max(int(std::bit_width(surfaces)) - 8, 0);
  mark_media_boundaries(s);
  s.has_thin |= s.shadows_need_hits;
  s.has_emission |= s.geometry_lights.any();
  if (!s.lights.portals.empty()) s.lights.portals.resize(s.lights.domes.size());
  s.lights.analytic_count = s.lights.count;
  if (s.volumes && !s.volumes->any()) s.volumes.reset();
  if (s.has_emission) {
    const TimeSpan span("build emitters");
    build_emitters(s);
  }
  if (s.volumes && !is_reopened_) s.volumes->finish();
  if (s.volumes) add_volume_lights(s);
  finish_light_rows(s.lights);
  find_pivots(s);
  const bool glows = s.has_emission || (s.volumes && s.volumes->in_emissions.any());
  s.rays_find_light = glows || s.lights.needs_hit_test || !s.lights.domes.empty();
  s.only_hierarchy_lights_found =
      !glows && s.lights.domes.empty() && !s.lights.hierarchy.empty() && s.lights.hierarchy.far.empty();
  s.only_domes_found = !glows && !s.lights.needs_hit_test && !s.lights.domes.empty();
  if (s.needs_left_out()) throw Error("settings-error", "the scene needs a feature that this core was built without");
  if (!keeps_accel_) build_accel(s);
  find_camera_media(s);
  s.outlines = find_light_outlines(s);
  return std::move(scene_);
}

bool Scene::needs_left_out() const {
  return has_instances.is_left_out() || curved.is_left_out() || has_attributes.is_left_out() || has_inputs.is_left_out() ||
         has_cutouts.is_left_out() || has_emission.is_left_out() || has_thin.is_left_out() ||
         lights.lobe_factors.is_left_out() || lights.has_shaping.is_left_out() || camera.moves.is_left_out() ||
         curves.any.is_left_out() || motion.any_instances.is_left_out() || motion.any_points.is_left_out() ||
         (volumes && ((!built::kMotion && volumes->grids.any_blurred) || volumes->in_media.motion.any_instances.is_left_out() ||
                      volumes->in_emissions.motion.any_instances.is_left_out())) ||
         (!built::kMotion && !lights.motion.paths.empty()) || (!built::kLinks && lights.links.words > 0) ||
         (!built::kPortals && !lights.portals.empty()) || (!built::kSpecialShadows && !lights.shadow_rows.empty()) ||
         (!built::kLightImages && !lights.images.empty()) || (!built::kEmission && !geometry_lights.all.empty());
}

int64_t Scene::memory_bytes() const {
  const auto bytes = [](const auto& v) { return int64_t(v.capacity() * sizeof(v[0])); };
  int64_t total = bytes(positions) + bytes(indices) + bytes(triangle_mesh) + bytes(normals) + bytes(colors) +
                  bytes(world_from_group) + bytes(motion.linear) + bytes(motion.turning) + bytes(primvars.values) +
                  bytes(primvars.of_mesh) + bytes(primvars.of_placement) + texture_bytes() + int64_t(triangle_bvh.bytes);
  for_curved_kinds([&]<class K>(K) { total += bytes(curved.records<K>()); });
  total += bytes(curves.points) + bytes(curves.first_point) + bytes(curves.run) + bytes(curves.ends) + bytes(curves.row) +
           bytes(curves.curve);
  for (const Dome& d : lights.domes) total += bytes(d.texels) + bytes(d.column_cdf) + bytes(d.column_cuts) + bytes(d.density);
  for (const LightImage& i : lights.images) total += bytes(i.texels) + bytes(i.column_cdf);
  if (volumes) total += volumes->memory_bytes();
  if (distortion) total += bytes(distortion->table.directions);
  total += bytes(lights.rows) + bytes(lights.tree.blocks) + bytes(lights.tree.places) + bytes(lights.linked.places);
  total += bytes(lights.shaping.rows) + bytes(lights.shaping.profiles.data);
  return total;
}

}  // namespace primray
