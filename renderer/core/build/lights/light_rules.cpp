// Construction of light rules.
#include "build/lights/light_rules.hpp"

#include <cmath>

#include "base/error.hpp"
#include "light/shadow.hpp"

namespace primray {

bool is_special(const LightRules& light) {
  const vec3& c = light.shadow_color;
  return light.casters != 0 || !light.casts_shadows || c.x != 0 || c.y != 0 || c.z != 0 || light.shadow_distance >= 0;
}

void add_light_rules(const LightRules& light, double scale, LightTable& table) {
  const size_t row = size_t(table.count) - 1;
  const bool special = is_special(light);
  float& flags = table.rows[row * kLightFields + kLightFlags];
  flags = float(int(flags) | (light.visible_to_camera ? 0 : kHidden) | (special ? kSpecial : 0));
  if (light.link != 0) table.light_link.resize(row + 1, 0), table.light_link[row] = light.link;
  const bool dome = int(table.rows[row * kLightFields + kType]) == int(LightType::kDome);
  table.ends.resize(row + 1, int32_t(kEndObject)), table.ends[row] = end_number(light.group, dome ? kEndDome : kEndLight);
  if (!special) return;
  table.shadow_rows.resize((row + 1) * kShadowFields, 0.0f);
  float* shadow = &table.shadow_rows[row * kShadowFields];
  shadow[kCasters] = float(light.casters), shadow[kCastsShadows] = light.casts_shadows ? 1.0f : 0.0f;
  shadow[kShadowColor] = light.shadow_color.x, shadow[kShadowColor + 1] = light.shadow_color.y,
  shadow[kShadowColor + 2] = light.shadow_color.z;
  const bool ends = light.shadow_distance >= 0;
  shadow[kShadowEnd] = ends ? float(light.shadow_distance * scale) : INFINITY;
  // The fading zone lies within the distance (ShadowAPI), and has no meaning without one.
  const double fade = std::min(light.shadow_falloff, light.shadow_distance);
  shadow[kShadowFade] = ends && fade > 0 ? float(fade * scale) : 0.0f;
  shadow[kShadowGamma] = float(light.shadow_gamma);
}

void finish_light_rules(LightTable& table) {
  if (table.links.any()) table.light_link.resize(size_t(table.count), 0);
  if (!table.shadow_rows.empty()) table.shadow_rows.resize(size_t(table.count) * kShadowFields, 0.0f);
  const int limit = 32 * table.links.words;
  for (const int32_t link : table.light_link)
    if (link < 0 || link >= limit) throw Error("internal", "a light's link names a collection that does not exist");
  for (size_t i = 0; i < table.shadow_rows.size(); i += kShadowFields)
    if (table.shadow_rows[i + kCasters] != 0 && table.shadow_rows[i + kCasters] >= float(limit))
      throw Error("internal", "a light's shadow link names a collection that does not exist");
  for (const DomeTraits& dome : table.dome_traits)
    if (dome.link != 0 && dome.link >= limit) throw Error("internal", "a dome's link names a collection that does not exist");
}

}  // namespace primray
