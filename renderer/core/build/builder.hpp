// From double-precision input in scene units to the Scene's flat float arrays, relative to an origin and scaled by a power of
// two.
#pragma once

#include <memory>
#include <optional>
#include <span>

#include "build/inputs/camera_input.hpp"
#include "build/inputs/curves_input.hpp"
#include "build/inputs/light_input.hpp"
#include "build/inputs/mesh_input.hpp"
#include "build/lights/light_rules.hpp"
#include "scene/scene.hpp"

namespace primray {

class SceneBuilder {
 public:
  // world point -> (world - origin) * scale; scale is a power of two, so that nothing is rounded by it.
  SceneBuilder(dvec3 origin, double scale);
  SceneBuilder(const SceneBuilder&) = delete;
  // Opens a finished scene again (build/builder_again.cpp): its shapes, placements and textures stay, and all else is to be
  // given anew, as many surfaces and textures as before among it. What moves, and shapes that are lights, it must not have.
  explicit SceneBuilder(std::unique_ptr<Scene> scene);

  // How many names of primvars the surfaces' inputs read; before any shape.
  void set_primvar_names(int count) { scene_->primvars.names = count; }
  // Inputs that vary, beside the surface's constants; textures by their number.
  int32_t add_surface(const SurfaceInput& constants, std::vector<InputSource> varying = {}, int tape = -1);
  // What inputs may read outputs of; its number. Before the surfaces.
  int add_tape(Tape tape);
  // A texture without its images yet: `channels` 1 or 3; `finest_only` for those that cut-outs read.
  int add_texture(int channels, bool udim, bool finest_only);
  // Until the next begin_prototype, shapes go to the current group: the static one at first.
  // Prototype space is recentred and scaled as well; `center` and `scale` are in its own units.
  int begin_prototype(dvec3 center, double scale);
  // A group's cut-outs come after its other meshes.
  void add_mesh(const MeshInput& mesh, const daffine& group_from_object);
  // A curved shape of a kind (scene/curved), of what its `make` takes; those of one kind follow each other in a group. False
  // where there is no such shape, as with a matrix that has no inverse.
  template <class K, class Input>
  bool add_curved(const Input& input, int32_t surface, const daffine& group_from_object) {
    last_curved_taken_ = false, last_is_curved_ = true, last_curved_rows_ = scene_->curved.rows();
    const auto record = K::make(input, group_from_outside_.back() * group_from_object);
    if (!record) return false;
    auto& records = scene_->curved.records<K>();
    add_curved_row(scene_->groups.back().curved.of<K>(), records.size(), surface);
    note_object_space(scene_->object_spaces.of_curved, scene_->curved.rows() - 1, surface, group_from_object);
    records.push_back(*record);
    return true;
  }
  // Curves that move come after a group's others.
  void add_curves(const CurvesInput& curves, const daffine& group_from_object);
  // `width` numbers a row, of the shape that was added last.
  void add_mesh_primvar(int name, PrimvarKind kind, int width, std::span<const float> values);
  void add_curved_primvar(int name, PrimvarKind kind, int width, std::span<const float> values);
  // How many rows of meshes, curved shapes and placements there are so far: for those who keep tables beside them.
  size_t mesh_rows() const { return scene_->meshes.surface.size(); }
  size_t curved_rows() const { return scene_->curved.rows(); }
  size_t placement_rows() const { return scene_->placement_group.size(); }
  // Of a scene that is opened again: what add_mesh would make of the mesh with this matrix, in place of what it made with the
  // other one, from that row on. False, and nothing is done, where it would be more than points and normals.
  bool restand_mesh(size_t row, const MeshInput& mesh, const daffine& before, const daffine& group_from_object);
  // Of a scene that is opened again, after its camera: whether its textures have the levels that a new one's would have.
  bool keeps_levels();
  // Room for all meshes, as for instances.
  void reserve_triangles(size_t points, size_t triangles);
  // Room for all instances of all placements: appending would else take twice their memory for a moment.
  void reserve_instances(size_t count);
  // Between the two come its instances. `parent` is 0 or a prototype without shapes, which is then placed by user geometry;
  // placements of one parent follow each other.
  void begin_placement(int parent, int prototype);
  // `rows`: 12 doubles an instance, parent from prototype. Singular or non-finite ones are left out; the result names them.
  std::vector<int64_t> add_instances(std::span<const double> rows);
  void end_placement();
  // In place of add_instances, once for the placement: `rows` are 12 doubles for each time and, within it, instance.
  std::vector<int64_t> add_moving_instances(std::span<const float> times, bool turns, std::span<const double> rows);
  // Rays' times: the shutter's part of the span that all times are of, and the frame's time.
  void set_exposure(double opens, double closes, double frame);
  // How much later the shutter opens for each column and row of the frame, in parts of the span: set_exposure is of the first.
  void set_rolling(double per_column, double per_row);
  // A row for every instance that was not left out of the last placement.
  void add_placement_primvar(int name, int width, std::span<const float> values);
  // Before shapes and lights: whether what wears row r is in collection c, (rows) (collections) flags; number 0 has all.
  void set_links(int rows, int collections, std::span<const uint8_t> members);
  // Of the shapes that follow.
  void set_link_row(int row) { link_row_ = row; }
  // Its number, for ShapingInput.
  int add_ies_profile(const IesInput& profile);
  // An image for rectangle lights; its number.
  int add_light_image(const ImageInput& image);
  // `image`: of a rectangle, or -1.
  void add_light(const LightInput& light, int image = -1);
  // A light that shapes wear; its number.
  int add_geometry_light(const LightInput& light);
  // The shape that was added last is a part of that light.
  void set_light_of_shape(int light, const daffine& group_from_object);
  void set_camera(const CameraInput& camera);
  // After all shapes, placements and the camera, which decide the levels that are kept. `tile`: 0, or 1001 to 1100.
  void set_texture_image(int texture, int tile, const ImageInput& image);
  // Builds the acceleration structures; the builder is empty afterwards.
  std::unique_ptr<Scene> finish();

 private:
  dvec3 to_group(const dvec3& p) const { return (p - group_origin_) * group_scale_; }
  void place_points(std::span<const float> points, const daffine& group_from_object, float* to) const;
  void add_curved_row(CurvedRange& range, size_t record, int32_t surface);
  void add_curved_row(int32_t surface);
  void place_controls(std::span<const float> points, std::span<const int32_t> segments, bool closed,
                      const daffine& group_from_object, float* to) const;
  void add_curve_steps(const CurvesInput& curves, const daffine& group_from_object);
  // The current group's vertices move by the clock of these times.
  void take_clock(std::span<const float> times);
  int32_t append_primvar(std::span<const float> values);
  // The shape's own space, of a row whose surface asks for it.
  void note_object_space(std::vector<int32_t>& of, size_t row, int32_t surface, const daffine& group_from_object);
  void add_mesh_steps(const MeshInput& mesh, const daffine& group_from_object);
  // The later times of the current group's moving vertices, after all of its vertices.
  void end_group();
  void set_camera_path(const CameraInput& camera);
  void set_distortion(const DistortionInput& distortion);
  void set_flaws(const CameraInput& camera);

  std::unique_ptr<Scene> scene_;
  std::vector<std::vector<float>> later_points_;    // of the current group, by time from the second on
  std::vector<std::vector<float>> later_controls_;  // likewise of curves
  // Of the current group.
  dvec3 group_origin_;
  double group_scale_;
  // By group: undoes its recentring, and does it.
  std::vector<daffine> outside_from_group_, group_from_outside_;
  // Of the placement that is being filled.
  int parent_ = 0;
  daffine undo_, redo_;
  // Of the shape and the placement that were added last.
  size_t last_mesh_rows_ = 0;    // first row of the mesh
  size_t last_curved_rows_ = 0;  // of the curved shape
  bool last_is_curved_ = false;
  bool last_mirrored_ = false, last_curved_taken_ = false, last_placement_taken_ = false;
  bool levels_measured_ = false;
  // Of a scene that is opened again.
  bool is_again_ = false, keeps_accel_ = false;
  int textures_met_ = 0;
  int32_t link_row_ = 0;
};

}  // namespace primray
