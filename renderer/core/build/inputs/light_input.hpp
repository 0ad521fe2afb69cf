// Input of lights, with their images, portals and profiles.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "light/light.hpp"
#include "light/rules_input.hpp"
#include "light/shaping/shaping_input.hpp"
#include "math/matrix.hpp"

namespace primray {

// Image as given: (height, width, channels) linear floats, finite, first row at the top.
struct ImageInput {
  std::span<const float> pixels;
  int width = 0, height = 0;
};

// Rectangle through which a dome is sampled.
struct PortalInput {
  daffine world_from_portal;
  double width = 1, height = 1;
  // Motion, as in LightInput.
  std::span<const float> times{};
  std::span<const double> stances{};
};

// IES profile: angles in degrees, ascending, two or more of each; `candela` by horizontal angle. See light/shaping/ies.hpp.
struct IesInput {
  std::span<const float> vertical_deg, horizontal_deg, candela;
  bool horizontal_pole = false;
};

struct LightInput : LightRules, LightSize {
  LightType type = LightType::kPoint;
  daffine world_from_light;
  vec3 emission;
  float diffuse = 1, specular = 1;
  int texture_width = 0, texture_height = 0;
  std::span<const float> texels;  // image of a dome: 3 (width) (height), first row at the top
  DomeFormat format = DomeFormat::kLatLong;
  std::vector<PortalInput> portals;  // of a dome
  std::optional<ShapingInput> shaping;
  // Motion: times, and world_from_light at each (12 numbers), rigid.
  std::span<const float> times;
  std::span<const double> stances;
  // For geometry: see GeometryLight.
  bool own = false, shown = false, normalize = false;
};

}  // namespace primray
