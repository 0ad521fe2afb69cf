// Part of SceneBuilder that adds what surface inputs read: primvars, sources, textures.
#include "build/builder.hpp"

#include <algorithm>

#include "base/error.hpp"
#include "build/inputs/input_facts.hpp"
#include "texture/mip_pyramid.hpp"
#include "texture/tile_file.hpp"

namespace primray {

int32_t SceneBuilder::append_primvar(std::span<const float> values) {
  std::vector<float>& all = scene_->primvars.values;
  if (all.size() + values.size() >= size_t(1) << 31) throw Error("too-large", "more than 2147 million values in primvars");
  const int32_t at = int32_t(all.size());
  all.insert(all.end(), values.begin(), values.end());
  return at;
}

void SceneBuilder::add_volume(int32_t surface, const SurfaceInput& s) {
  Interiors& interiors = scene_->interiors;
  if (s.interface) {
    interiors.filled.push_back({surface, *s.volume});
    return;
  }
  const float per_length = float(1 / scene_->scale);
  const VolumeInput& v = *s.volume;
  interiors.volume_of.resize(size_t(surface), -1);
  interiors.volume_of.push_back(int32_t(interiors.volumes.size()));
  interiors.volumes.push_back(
      {v.extinction * per_length, v.scattering * per_length, v.emission * per_length, v.phase, s.camera});
}

void SceneBuilder::set_fog(const FogInput& input) {
  const double scale = scene_->scale;
  Fog& fog = scene_->interiors.fog;
  fog.extinction = float(input.density / scale), fog.albedo = input.albedo;
  fog.emission = input.emission * float(1 / scale), fog.phase = input.phase;
  fog.up = vec3(input.up), fog.top = float(dot(input.up, input.top - scene_->origin) * scale);
  fog.falloff = float(input.falloff * scale), fog.hidden = input.hidden;
}

int32_t SceneBuilder::add_surface(const SurfaceInput& constants, std::vector<InputSource> varying, int tape) {
  Scene& s = *scene_;
  s.surface_inputs_of.push_back(varying.empty() ? -1 : int32_t(s.surface_inputs.size()));
  if (!varying.empty()) s.surface_inputs.push_back({constants, std::move(varying), tape});
  std::vector<float>& priorities = s.interiors.priorities;
  const int32_t row = s.surfaces.add(constants);
  if (constants.dielectric_priority != 0) priorities.resize(size_t(row), 0.0f);
  if (constants.dielectric_priority != 0 || !priorities.empty()) priorities.push_back(constants.dielectric_priority);
  s.camera_visibility.add(size_t(row), constants.interface ? constants.camera : CameraVisibility::kSeen);
  if (constants.volume) add_volume(row, constants);
  return row;
}

int SceneBuilder::add_tape(Tape tape) {
  tape.is_placed = tape.asks_place();
  scene_->tapes.push_back(std::move(tape));
  return int(scene_->tapes.size()) - 1;
}

void SceneBuilder::record_object_space(std::vector<int32_t>& of, size_t row, int32_t surface,
                                       const daffine& group_from_object) {
  Scene& s = *scene_;
  if (s.tapes.empty()) return;
  const int32_t inputs = s.surface_inputs_of.at(size_t(surface));
  const int tape = inputs < 0 ? -1 : s.surface_inputs[size_t(inputs)].tape;
  if (tape < 0 || !s.tapes[size_t(tape)].asks_object_space) return;
  of.resize(row + 1, 0);
  of[row] = s.object_spaces.add(group_from_outside_.back() * group_from_object);
}

void SceneBuilder::add_mesh_primvar(int name, PrimvarKind kind, int width, std::span<const float> values) {
  Scene& s = *scene_;
  if (last_mesh_rows_ == s.meshes.surface.size()) return;  // without triangles
  const int32_t at = append_primvar(values);
  if (kind == PrimvarKind::kCorner && last_mirrored_) {
    // Mirrored triangles are reversed: their second and third corners are swapped.
    float* v = &s.primvars.values[at];
    for (size_t i = 0; i + 3 * width <= values.size(); i += 3 * width)
      std::swap_ranges(v + i + width, v + i + 2 * width, v + i + 2 * width);
  }
  const int32_t primvar = s.primvars.add(kind, width, at);
  for (size_t row = last_mesh_rows_; row < s.meshes.surface.size(); ++row)
    s.primvars.of_mesh[row * s.primvars.names + name] = primvar;
}

void SceneBuilder::add_curved_primvar(int name, PrimvarKind kind, int width, std::span<const float> values) {
  PrimvarTable& t = scene_->primvars;
  if (!last_curved_taken_) return;
  const int32_t primvar = t.add(kind, width, append_primvar(values));
  for (size_t row = last_curved_rows_; row < scene_->curved.rows(); ++row) t.of_curved[row * t.names + name] = primvar;
}

void SceneBuilder::add_placement_primvar(int name, int width, std::span<const float> values) {
  PrimvarTable& t = scene_->primvars;
  if (!last_placement_taken_) return;
  t.of_placement[t.of_placement.size() - t.names + name] = t.add(PrimvarKind::kInstance, width, append_primvar(values));
}

int SceneBuilder::add_texture(int channels, bool udim, bool finest_only) {
  if (is_reopened_) return next_texture_++;
  Texture t;
  t.channels = channels, t.udim = udim, t.finest_only = finest_only;
  scene_->textures.push_back(std::move(t));
  return int(scene_->textures.size()) - 1;
}

void SceneBuilder::set_texture_image(int texture, int tile, const ImageInput& image) {
  const int finest = finest_texture_level(texture, image.width, image.height);
  Texture& t = scene_->textures[size_t(texture)];
  add_texture_image(t, tile, make_image(image.pixels, image.width, image.height, t.channels, finest, t.finest_only));
}

int SceneBuilder::finest_texture_level(int texture, int width, int height) {
  measure_levels();
  return finest_level(scene_->textures.at(size_t(texture)), width, height);
}

void SceneBuilder::set_texture_tiles(int texture, int tile, const std::string& path, const std::string& key,
                                     std::shared_ptr<TileMemory> memory) {
  measure_levels();
  Texture& t = scene_->textures.at(size_t(texture));
  const TextureImage header = tile_file_header(path, key);
  if (header.channels != t.channels) throw Error("texture-cache", "it has other channels than are read");
  add_texture_image(t, tile,
                    open_tile_file(path, key, std::move(memory), finest_level(t, header.width, header.height), t.finest_only));
}

void SceneBuilder::add_texture_image(Texture& t, int tile, TextureImage image) {
  if (t.udim) {
    const int number = tile - kFirstTile;
    if (number < 0 || number >= int(t.tiles.size())) throw Error("internal", "the texture has no such UDIM tile");
    t.tiles[size_t(number)] = int32_t(t.images.size());
  }
  t.images.push_back(std::move(image));
}

void SceneBuilder::share_tile_memory() {
  int64_t whole = 0;
  TileMemory* memory = nullptr;
  for (const Texture& t : scene_->textures) {
    for (const TextureImage& image : t.images) {
      whole += image.memory_bytes();
      if (image.tiles) memory = &image.tiles->memory();
    }
  }
  if (memory) memory->hold(whole);
}

bool SceneBuilder::take_texture_images(int texture, Texture& earlier) {
  measure_levels();
  Texture& t = scene_->textures.at(size_t(texture));
  if (earlier.images.empty() || earlier.channels != t.channels || earlier.udim != t.udim ||
      earlier.finest_only != t.finest_only || !has_needed_levels(t, earlier))
    return false;
  t.images = std::move(earlier.images), t.tiles = earlier.tiles;
  earlier.images.clear();
  return true;
}

void SceneBuilder::measure_levels() {
  if (!levels_measured_) measure_footprints(*scene_);
  levels_measured_ = true;
}

int64_t Scene::texture_bytes() const {
  int64_t total = 0;
  for (const Texture& t : textures)
    for (const TextureImage& image : t.images)
      total += image.bytes_from(std::max(image.first_level, finest_level(t, image.width, image.height)));
  return total;
}

}  // namespace primray
