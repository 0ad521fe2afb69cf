// Geometry with UsdLux LightAPI or MeshLightAPI, beside the emission of its material.
//
// The light that it emits (to light samples, and to scattered rays that hit it) is its material's emission times `radiance`, or
// `radiance` alone (`own`); as a body (to camera rays, and those after mirrors or refraction) it shows the material's emission,
// or, if `shown`, the light that it emits. With `normalize` all of that is divided by the world-space area of the shape.
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
  std::vector<float> row;  // light row with the fields of any light: lobe factors
  std::optional<ShapingInput> shaping;
  // Its parts in its group: triangles [first, end), by index over the scene, or a curved shape.
  std::vector<std::pair<size_t, size_t>> triangles;
  int32_t curved = -1;  // its row of the CurvedTable
};

struct GeometryLights {
  std::vector<GeometryLight> all;
  std::vector<int32_t> of_mesh, of_curved;  // index of the light by row of the MeshTable and of the CurvedTable, or -1; may be
                                            // shorter than these
  // By light, for rays that hit it: kOwn and kShown; lobe factors; `radiance`, with the area in its first placement.
  std::vector<int32_t> flags;
  std::vector<int32_t> link;  // collection that it illuminates
  std::vector<int32_t> ends;  // see LightTable::ends
  std::vector<float> diffuse, specular, radiance;
  enum : int32_t { kOwn = 1, kShown = 2 };

  bool any() const { return built::kEmission && !all.empty(); }
  int32_t mesh(size_t row) const { return row < of_mesh.size() ? of_mesh[row] : -1; }
  int32_t curved(size_t row) const { return row < of_curved.size() ? of_curved[row] : -1; }
};

}  // namespace primray
