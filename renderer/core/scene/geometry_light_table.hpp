// Geometry that is a light of its own (UsdLux LightAPI and MeshLightAPI on a shape), beside what its material emits.
//
// Light that it gives (light samples, and scattered rays that meet it) is its material's glow times `radiance`, or `radiance`
// alone (`own`); bodies of light (camera rays, and those after mirrors or refraction) are the glow as the material has it, or,
// where `shown`, what it gives. With `normalize` all of that is divided by the area of the shape where it stands.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "light/light.hpp"
#include "light/rules_input.hpp"
#include "light/shaping/shaping_input.hpp"

namespace primray {

struct GeometryLight {
  vec3 radiance{1.0f, 1.0f, 1.0f};
  bool own = false, shown = false, normalize = false;
  LightRules rules;
  daffine group_from_object{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, dvec3(0.0)};
  std::vector<float> row;  // a light row with what any light has: lobe factors
  std::optional<ShapingInput> shaping;
  // Its parts in its group: triangles [first, end), counted over the scene, or a curved shape.
  std::vector<std::pair<size_t, size_t>> triangles;
  int32_t curved = -1;  // its row of the CurvedTable
};

struct GeometryLights {
  std::vector<GeometryLight> all;
  std::vector<int32_t> of_mesh, of_curved;  // by row of the MeshTable and of the CurvedTable: which, or -1; may end early
  // By light, for rays that meet it: kOwn and kShown; lobe factors; `radiance`, with the area of the first place it stands in.
  std::vector<int32_t> flags;
  std::vector<int32_t> link;  // the collection that it reaches
  std::vector<int32_t> ends;  // as LightTable::ends
  std::vector<float> diffuse, specular, radiance;
  enum : int32_t { kOwn = 1, kShown = 2 };

  bool any() const { return built::kEmission && !all.empty(); }
  int32_t mesh(size_t row) const { return row < of_mesh.size() ? of_mesh[row] : -1; }
  int32_t curved(size_t row) const { return row < of_curved.size() ? of_curved[row] : -1; }
};

}  // namespace primray
