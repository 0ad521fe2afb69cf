// Part of SceneBuilder that adds lights, including those that are shapes.
#include "base/error.hpp"
#include "build/builder.hpp"
#include "build/lights/lights.hpp"

namespace primray {

void SceneBuilder::set_links(int rows, int collections, std::span<const uint8_t> members) {
  LinkTable& links = scene_->lights.links;
  links.rows = rows, links.words = (collections + 31) / 32;
  links.bits.assign(size_t(rows) * links.words, 0);
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < collections; ++c)
      if (members[size_t(r) * collections + c]) links.bits[size_t(r) * links.words + (c >> 5)] |= kBits[c & 31];
}

int SceneBuilder::add_light_image(const ImageInput& image) {
  LightImage to;
  to.width = image.width, to.height = image.height;
  to.texels.assign(image.pixels.begin(), image.pixels.end());
  build_light_image(to);
  scene_->lights.images.push_back(std::move(to));
  return int(scene_->lights.images.size()) - 1;
}

std::optional<int> SceneBuilder::add_light(const LightInput& light, int image) {
  LightTable& table = scene_->lights;
  const int rows = table.count;
  const size_t domes = table.domes.size();
  Dome* const earlier = light.earlier_dome < 0 ? nullptr : &earlier_domes_.at(size_t(light.earlier_dome));
  add_light_rows(light, scene_->origin, scene_->scale, table, image, earlier);
  add_light_path(light, scene_->origin, scene_->scale, rows, domes, table);
  return table.count > rows ? std::optional(rows) : std::nullopt;
}

int SceneBuilder::add_geometry_light(const LightInput& light) {
  GeometryLight to;
  to.radiance = light.emission, to.own = light.own, to.shown = light.shown, to.normalize = light.normalize;
  to.rules = light;
  to.shaping = light.shaping;
  to.row.assign(kLightFields, 0.0f);
  put_common_fields(light, scene_->lights, to.row.data());
  scene_->geometry_lights.all.push_back(std::move(to));
  return int(scene_->geometry_lights.all.size()) - 1;
}

void SceneBuilder::set_light_of_shape(int light, const daffine& group_from_object) {
  Scene& s = *scene_;
  GeometryLights& lights = s.geometry_lights;
  GeometryLight& worn = lights.all.at(size_t(light));
  worn.group_from_object = group_from_object;
  if (last_is_curved_) {
    if (!last_curved_taken_) return;
    lights.of_curved.resize(last_curved_rows_, -1), lights.of_curved.resize(s.curved.rows(), light);
    worn.curved = int32_t(s.curved.rows()) - 1;
    return;
  }
  if (last_mesh_rows_ == s.meshes.surface.size()) return;  // without triangles
  lights.of_mesh.resize(last_mesh_rows_, -1);
  lights.of_mesh.resize(s.meshes.surface.size(), light);
  worn.triangles.emplace_back(size_t(s.meshes.triangle_base[last_mesh_rows_]), s.indices.size() / 3);
}

}  // namespace primray
