// Builder of the Scene's flat float arrays from double-precision input in scene units, relative to an origin and scaled by a
// power of two.
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "build/inputs/scene_inputs.hpp"
#include "build/lights/lights.hpp"
#include "math/matrix.hpp"
#include "scene/scene.hpp"
#include "texture/tiles.hpp"

namespace primray {

// Normals of a mesh in world space. Scales all by one factor rather than normalizing each: normals are interpolated as the
// object has them, here as in instances.
class PlacedNormals {
 public:
  explicit PlacedNormals(const daffine& m) : x_(cross(m.y, m.z)), y_(cross(m.z, m.x)), z_(cross(m.x, m.y)) {
    const double largest = std::max({length(x_), length(y_), length(z_)});
    factor_ = (m.determinant() < 0 ? -1 : 1) / (largest > 0 ? largest : 1.0);
  }
  dvec3 operator()(const dvec3& n) const { return (x_ * n.x + y_ * n.y + z_ * n.z) * factor_; }

 private:
  dvec3 x_, y_, z_;
  double factor_;
};

// Fog per world unit of length: of that density below the plane through `top` with normal `up` (0: everywhere).
struct FogInput {
  double density = 0;
  vec3 albedo{0.0f}, emission{0.0f};
  float phase = 0;  // see medium/phase_function.hpp
  dvec3 top{0.0, 0.0, 0.0}, up{0.0, 0.0, 0.0};
  double falloff = 0;
  bool hidden = false;  // from the camera
};

class SceneBuilder {
 public:
  // world point -> (world - origin) * scale; scale is a power of two, so that it causes no rounding.
  SceneBuilder(dvec3 origin, double scale);
  SceneBuilder(const SceneBuilder&) = delete;
  // Reopens a finished scene without motion (build/builder.cpp): its camera must be given again, everything else is kept.
  explicit SceneBuilder(std::unique_ptr<Scene> scene);
  // For a reopened scene, after its camera: whether all that is kept is what a new scene would have. Means of patterns depend
  // on the levels of the images that they read, and these on the camera.
  bool keeps_means();
  // For a reopened scene: keeps shapes, placements, volumes and textures alone. Everything else must be given again, with the
  // same numbers of surfaces and textures. It must not have shapes that are lights.
  void drop_surfaces_and_lights();

  // Keeps the domes of a scene that is not rendered any more, for lights that say `earlier_dome`. Each may be taken once, and
  // none that had portals. A reopened scene keeps its own.
  void keep_domes(std::vector<Dome> domes) { earlier_domes_ = std::move(domes); }
  // Number of primvar names that the surfaces' inputs read; must be set before any shape.
  void set_primvar_names(int count) { scene_->primvars.names = count; }
  // Adds a surface with constants and varying inputs; textures by their number.
  int32_t add_surface(const SurfaceInput& constants, std::vector<InputSource> varying = {}, int tape = -1);
  // Adds a tape whose outputs inputs may read; returns its number. Must precede the surfaces.
  int add_tape(Tape tape);
  // Adds a texture without images yet: `channels` 1 or 3; `finest_only` for those that cutouts read.
  int add_texture(int channels, bool udim, bool finest_only);
  // Begins a prototype: until the next begin_prototype() shapes are added to it; before the first, to the static group.
  // Prototype space is recentred and scaled as well; `center` and `scale` are in its own units.
  int begin_prototype(dvec3 center, double scale);
  // Adds a mesh. A group's cutouts come after its other meshes.
  void add_mesh(const MeshInput& mesh, const daffine& group_from_object);
  // Adds a curved shape of kind K (scene/curved) from the input of K::make; shapes of one kind must be consecutive in a group.
  // Returns false if there is no such shape, for example with a singular matrix.
  template <class K, class Input>
  bool add_curved(const Input& input, int32_t surface, const daffine& group_from_object) {
    last_curved_taken_ = false, last_is_curved_ = true, last_curved_rows_ = scene_->curved.rows();
    const auto record = K::make(input, group_from_outside_.back() * group_from_object);
    if (!record) return false;
    auto& records = scene_->curved.records<K>();
    add_curved_row(scene_->groups.back().curved.of<K>(), records.size(), surface);
    record_object_space(scene_->object_spaces.of_curved, scene_->curved.rows() - 1, surface, group_from_object);
    records.push_back(*record);
    return true;
  }
  // Adds curves. Those that move come after a group's others.
  void add_curves(const CurvesInput& curves, const daffine& group_from_object);
  // Adds a primvar of the last shape, `width` numbers per row.
  void add_mesh_primvar(int name, PrimvarKind kind, int width, std::span<const float> values);
  void add_curved_primvar(int name, PrimvarKind kind, int width, std::span<const float> values);
  // Numbers of rows of meshes, curved shapes and placements so far, for callers that keep tables beside them.
  size_t mesh_rows() const { return scene_->meshes.surface.size(); }
  size_t curved_rows() const { return scene_->curved.rows(); }
  size_t placement_rows() const { return scene_->placement_group.size(); }
  // For a reopened scene: replaces what add_mesh() made of the mesh with matrix `before` by what it makes with the new one,
  // from that row on. Returns false, and changes nothing, if more than points and normals would change.
  bool replace_mesh(size_t row, const MeshInput& mesh, const daffine& before, const daffine& group_from_object);
  // For a reopened scene, after its camera: returns the textures of which rays may ask for finer levels than are kept. Their
  // images are released and must be set again.
  std::vector<int> release_coarse_textures();
  // Reserves memory for all meshes.
  void reserve_triangles(size_t points, size_t triangles);
  // Reserves memory for all instances of all placements: appending would temporarily take twice as much.
  void reserve_instances(size_t count);
  // Begins and ends a placement; its instances are added in between. `parent` is 0 or a prototype without shapes, which is then
  // placed by user geometry; placements of one parent are consecutive.
  void begin_placement(int parent, int prototype);
  // `rows`: 12 doubles per instance, parent from prototype. Singular or non-finite ones are skipped; returns their indices.
  std::vector<int64_t> add_instances(std::span<const double> rows);
  // The same of point instances, by the formulas and in the order of primray/description/placement.py: parent from prototype is
  // `outer` * translation * rotation * scale. `positions` and `scales` are 3 doubles per instance, `orientations` 4 (x, y, z,
  // w); the latter two may be empty.
  std::vector<int64_t> add_point_instances(const daffine* outer, std::span<const double> positions,
                                           std::span<const double> orientations, std::span<const double> scales);
  void end_placement();
  // Used in place of add_instances(), once per placement: `rows` are 12 doubles for each time and, within it, instance.
  std::vector<int64_t> add_moving_instances(std::span<const float> times, bool turns, std::span<const double> rows);
  // Fills the scene with fog (medium/fog.hpp).
  void set_fog(const FogInput& fog);
  // Sets rays' times: the shutter's part of the span that all times refer to, and the frame's time.
  void set_exposure(double opens, double closes, double frame);
  // Sets the rolling shutter: the delay per column and row of the frame, in parts of the span, relative to set_exposure().
  void set_rolling_shutter(double per_column, double per_row);
  // Adds a primvar of the last placement, a row for every instance that was not skipped.
  void add_placement_primvar(int name, int width, std::span<const float> values);
  // Sets membership[row][collection] flags, (rows) (collections), before shapes and lights; collection 0 has all rows.
  void set_links(int rows, int collections, std::span<const uint8_t> members);
  // Sets the link row of the shapes that follow.
  void set_link_row(int row) { link_row_ = row; }
  // Adds an IES profile and returns its index, for ShapingInput.
  int add_ies_profile(const IesInput& profile);
  // Adds an image for rectangle lights and returns its index.
  int add_light_image(const ImageInput& image);
  // `image`: of a rectangle light, or -1.
  // Returns the light's row, if it is sampled.
  std::optional<int> add_light(const LightInput& light, int image = -1);
  // Adds a light to which shapes may belong, and returns its index.
  int add_geometry_light(const LightInput& light);
  // Makes the last shape part of that light.
  void set_light_of_shape(int light, const daffine& group_from_object);
  // Adds a grid of values, which media may have, and returns its number.
  int add_grid(const GridInput& grid);
  // Add a medium, or emission, and its instances; they return the indices of those that are left out since their matrix is
  // singular or not finite.
  std::vector<int64_t> add_medium(const MediumInput& medium);
  // Adds a grid that velocities blur (GridTable::add_blurred), and returns its number.
  int add_blurred_grid(int grid, int velocity, double frame) { return volumes().add_blurred_grid(grid, velocity, frame); }
  std::vector<int64_t> add_volume_emission(const VolumeEmissionInput& emission);
  void set_camera(const CameraInput& camera);
  // Sets an image after all shapes, placements and the camera, which determine the levels that are kept. `tile`: 0, or 1001 to
  // 1100.
  void set_texture_image(int texture, int tile, const ImageInput& image);
  // The finest level that rays can ask for of an image of that size; after all shapes, placements and the camera.
  int finest_texture_level(int texture, int width, int height);
  // Sets an image from a file of tiles (texture/tile_file.hpp), read by tile within the budget of `memory`, or held whole
  // without.
  void set_texture_tiles(int texture, int tile, const std::string& path, const std::string& key,
                         std::shared_ptr<TileMemory> memory);
  // Used in place of set_texture_image(): moves the images of an earlier scene's texture, which was made of the same files, if
  // their levels suffice. Finer ones than rays ask for change nothing.
  bool take_texture_images(int texture, Texture& earlier);
  // Builds the acceleration structures; the builder is empty afterwards.
  std::unique_ptr<Scene> finish();

 private:
  VolumeTable& volumes();
  daffine core_from_world() const;
  dvec3 to_group(const dvec3& p) const { return (p - group_origin_) * group_scale_; }
  void place_points(std::span<const float> points, const daffine& group_from_object, float* to) const;
  void add_curved_row(CurvedRange& range, size_t record, int32_t surface);
  void add_curved_row(int32_t surface);
  void place_controls(std::span<const float> points, std::span<const int32_t> segments, bool closed,
                      const daffine& group_from_object, float* to) const;
  void add_curve_steps(const CurvesInput& curves, const daffine& group_from_object);
  // Sets the motion samples of the current group's vertices.
  void take_clock(std::span<const float> times);
  int32_t append_primvar(std::span<const float> values);
  void add_volume(int32_t surface, const SurfaceInput& constants);
  // Stores the object space of a shape's row, if its surface reads it.
  void record_object_space(std::vector<int32_t>& of, size_t row, int32_t surface, const daffine& group_from_object);
  void add_mesh_steps(const MeshInput& mesh, const daffine& group_from_object);
  // Appends the later times of the current group's moving vertices, after all of its vertices.
  void end_group();
  void add_texture_image(Texture& texture, int tile, TextureImage image);
  // Tells the memory for tiles how much of its budget the images take that are held whole.
  void share_tile_memory();
  // Measures footprints on textures, once.
  void measure_levels();
  std::unique_ptr<Scene> finish_view();
  void set_camera_path(const CameraInput& camera);
  void set_distortion(const DistortionInput& distortion);
  void set_flaws(const CameraInput& camera);

  std::unique_ptr<Scene> scene_;
  std::vector<std::vector<float>> later_points_;    // of the current group, by time from the second on
  std::vector<std::vector<float>> later_controls_;  // of the current group's curves, by time from the second on
  // Recentring of the current group.
  dvec3 group_origin_;
  double group_scale_;
  // Inverse of the recentring of each group, and the recentring.
  std::vector<daffine> outside_from_group_, group_from_outside_;
  // Placement under construction.
  int parent_ = 0;
  daffine undo_, redo_;
  // Last shape and placement.
  size_t last_mesh_rows_ = 0;    // first row of the mesh
  size_t last_curved_rows_ = 0;  // first row of the curved shape
  bool last_is_curved_ = false;
  bool last_mirrored_ = false, last_curved_taken_ = false, last_placement_taken_ = false;
  bool levels_measured_ = false;
  // Reopened scene.
  bool is_reopened_ = false, keeps_accel_ = false, keeps_surfaces_ = false;
  std::vector<int> pattern_levels_;  // that the earlier camera asked for of images that patterns read
  int next_texture_ = 0;
  std::vector<Dome> earlier_domes_;
  int32_t link_row_ = 0;
};

}  // namespace primray
