// Part of SceneBuilder that reopens finished scenes. Embree, and user geometry, point to the Scene and into its arrays: these
// stay in place.
#include "base/error.hpp"
#include "build/builder.hpp"
#include "build/inputs/placed_normals.hpp"
#include "build/texture_levels.hpp"

namespace primray {

SceneBuilder::SceneBuilder(std::unique_ptr<Scene> scene) : scene_(std::move(scene)), is_again_(true), keeps_accel_(true) {
  Scene& s = *scene_;
  if (s.moves() || s.geometry_lights.any())
    throw Error("internal", "a scene with motion or geometry lights cannot be reopened");
  group_origin_ = s.origin, group_scale_ = s.scale;
  s.positions.resize(s.positions.size() - 4), s.indices.pop_back();  // what finish() added; their memory stays
  s.surfaces = {}, s.surface_inputs_of.clear(), s.surface_inputs.clear(), s.tapes.clear();
  LinkTable links = std::move(s.lights.links);
  s.lights = {}, s.lights.links = std::move(links);
  s.emitters = {}, s.outlines = {}, s.interiors = {};
  s.camera = {}, s.distortion.reset();
  s.has_emission = s.has_thin = false;
}

bool SceneBuilder::restand_mesh(size_t row, const MeshInput& mesh, const daffine& before, const daffine& group_from_object) {
  Scene& s = *scene_;
  const bool mirrored = group_from_object.determinant() < 0;
  if (!mesh.times.empty() || mesh.cutout || mirrored != (before.determinant() < 0)) return false;
  if (keeps_accel_) {
    for (Group& group : s.groups) group.accel = {};
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

bool SceneBuilder::keeps_levels() {
  Scene& s = *scene_;
  if (s.textures.empty()) return true;
  measure_footprints(s);
  for (const Texture& t : s.textures)
    for (const TextureImage& image : t.images)
      if (finest_level(t, image.width, image.height) != image.first_level) return false;
  return true;
}

}  // namespace primray
