// Construction of light rows and of light rules. Scale is moved from the matrix to the light's size if its axes stay
// perpendicular, so that only true shear remains.

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.hpp"
#include "build/lights/lights.hpp"
#include "light/shadow.hpp"
#include "light/types/light_row.hpp"

namespace primray {

// Construction of light rules.
bool is_special(const LightRules& light) {
  const vec3& c = light.shadow_color;
  return light.casters != 0 || !light.casts_shadows || c.x != 0 || c.y != 0 || c.z != 0 || light.shadow_distance >= 0;
}

void add_light_rules(const LightRules& light, double scale, LightTable& table) {
  const size_t row = size_t(table.count) - 1;
  const bool special = is_special(light);
  float* const own = &table.rows[row * kLightFields];
  put_int(own, kLightFlags, int_at(own, kLightFlags) | (light.visible_to_camera ? 0 : kHidden) | (special ? kSpecial : 0));
  if (light.link != 0) table.light_link.resize(row + 1, 0), table.light_link[row] = light.link;
  const bool dome = int_at(own, kType) == int(LightType::kDome);
  table.ends.resize(row + 1, int32_t(kEndObject)), table.ends[row] = end_number(light.group, dome ? kEndDome : kEndLight);
  if (!special) return;
  table.shadow_rows.resize((row + 1) * kShadowFields, 0.0f);
  float* shadow = &table.shadow_rows[row * kShadowFields];
  put_int(shadow, kCasters, light.casters), shadow[kCastsShadows] = light.casts_shadows ? 1.0f : 0.0f;
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
    if (const int casters = int_at(&table.shadow_rows[i], kCasters); casters != 0 && casters >= limit)
      throw Error("internal", "a light's shadow link names a collection that does not exist");
  for (const DomeTraits& dome : table.dome_traits)
    if (dome.link != 0 && dome.link >= limit) throw Error("internal", "a dome's link names a collection that does not exist");
}

namespace {

// Frame of a light: perpendicular unit axes with separate sizes, or the matrix divided by its mean size if that is impossible.
struct LightFrame {
  daffine world_from_light;
  dvec3 sizes{1.0, 1.0, 1.0};  // sizes removed from the matrix
  bool sheared = false;
};

LightFrame light_frame(const LightInput& light) {
  LightFrame f{light.world_from_light, {1.0, 1.0, 1.0}, false};
  daffine& m = f.world_from_light;
  const double x = length(m.x), y = length(m.y), z = length(m.z);
  bool round = true, flat = false;
  LightTypes::with(light.type, [&]<class T>(T) { round = T::is_round(m), flat = T::kFlat; });
  // Flat lights need no depth: any normal to their plane serves, on the side of -z.
  if (flat) {
    const dvec3 n = cross(m.x, m.y);
    const double side = dot(n, m.z) < 0 ? -1 : 1, area = length(n);
    if (area > 0) m.z = n * (side / area);
  }
  if (!round) {
    f.sheared = true;
    // The mean size is removed all the same, so that lengths in the frame are about those of the world: the importance in light
    // selection is estimated with them.
    const double size = flat ? std::sqrt(length(cross(m.x, m.y))) : std::cbrt(std::fabs(m.determinant()));
    if (size > 0) {
      f.sizes = {size, size, size};
      m.x = m.x * (1 / size), m.y = m.y * (1 / size), m.z = m.z * (flat ? 1.0 : 1 / size);
    }
    return f;
  }
  f.sizes = {x, y, z};
  m.x = m.x * (1 / x), m.y = m.y * (1 / y);
  if (!flat) m.z = m.z * (1 / z);
  return f;
}

// Only directions matter for a distant light or a dome: an orthonormal frame about its z (distant) or all its axes (dome).
Affine<float> rotation_of(const daffine& m) {
  return {vec3(normalize(m.x)), vec3(normalize(m.y)), vec3(normalize(m.z)), vec3(0.0f)};
}

// Returns whether the dome is sampled.
bool add_dome(const LightInput& light, const dvec3& origin, double scale, LightTable& table, float* row, Dome* earlier) {
  Dome d;
  if (earlier) {
    d = std::move(*earlier);
  } else {
    d.tint = light.emission;
    d.width = light.texture_width, d.height = light.texture_height;
    d.texels.assign(light.texels.begin(), light.texels.end());
    d.format = light.format;
    finish_dome_image(d);
  }
  d.world_from_light = rotation_of(light.world_from_light);
  LightTable portals;
  portals.weighed = LightTable::kWeighedPortals;
  const bool special = is_special(light);
  if (light.diffuse != 0 || light.specular != 0) {
    if (!earlier) special ? build_whole_dome_distribution(d) : build_dome_distribution(d);
    for (const PortalInput& p : light.portals) {
      LightInput rect;
      rect.type = LightType::kRect, rect.world_from_light = p.world_from_portal;
      rect.width = p.width, rect.height = p.height, rect.emission = vec3(1.0f);
      rect.times = p.times, rect.pose_matrices = p.pose_matrices;
      const int row = portals.count;
      add_light_rows(rect, origin, scale, portals);
      add_light_path(rect, origin, scale, row, 0, portals);
    }
    finish_light_rows(portals);
    // Half of the hemispherical mean through portals, for choosing among lights.
    if (portals.count > 0) d.irradiance += d.mean * 0.5 * std::numbers::pi;
  }
  const bool sampled = d.sampled || portals.count > 0;
  put_int(row, kDomeIndex, int32_t(table.domes.size()));
  row[kImportance] = float(d.irradiance);
  table.dome_light.push_back(sampled ? table.count : -1);
  table.dome_factors.push_back({light.diffuse, light.specular});
  table.dome_traits.push_back({light.link, !light.visible_to_camera, special, end_number(light.group, kEndDome)});
  table.domes.push_back(std::move(d));
  if (portals.count > 0 || !table.portals.empty()) {
    table.portals.resize(table.domes.size());
    table.portals.back() = std::move(portals);
  }
  return sampled;
}

// Intermediate values of a light's row: its frame, emission and flags.
struct RowFrame {
  daffine m;
  dvec3 emission;
  int flags = 0;
};

void put_distant(const LightInput& light, LightTable& table, float* row, RowFrame& f) {
  const Frame<double> frame(normalize(f.m.z));
  f.m = {frame.s, frame.t, frame.n, dvec3(0.0)};
  const double half = std::min(std::max(light.angle_deg, 0.0), 360.0) * (std::numbers::pi / 360);
  // 1 - cos t = 2 sin^2 (t / 2) is precise for the smallest suns.
  const double s = std::sin(0.5 * half), spread = 2 * s * s;
  row[kSize0] = float(spread);
  row[kImportance] = float(luminance(f.emission) * (spread > 0 ? 2 * std::numbers::pi * std::min(spread, 0.5) : 1.0));
  table.needs_hit_test |= row[kSize0] > 0;
}

// Writes axes, sizes and emission of lights with a position.
void put_placed(const LightInput& light, double scale, float* row, RowFrame& f) {
  const LightFrame frame = light_frame(light);
  f.m = frame.world_from_light;
  if (frame.sheared) f.flags |= kSheared;
  LightTypes::with(light.type, [&]<class T>(T) {
    double size[2] = {1, 1}, kept[2] = {1, 1};  // for types without sizes
    if constexpr (requires { T::sizes(light, frame.sizes, scale, size); }) {
      T::sizes(light, frame.sizes, scale, size);
      kept[0] = std::max(size[0], kSmallestLight), kept[1] = std::max(size[1], kSmallestLight);
      row[kSize0] = float(kept[0]), row[kSize1] = float(kept[1]);
    }
    f.emission = f.emission * T::emission_scale(size, kept, scale);
    if constexpr (requires { T::place(f.m); }) T::place(f.m);
  });
}

// Writes what ray hits and light selection need of their surface.
void put_surface(const LightInput& light, int image, LightTable& table, float* row, const RowFrame& f) {
  table.needs_hit_test |= can_be_hit(light.type);
  LightTypes::with(light.type, [&]<class T>(T) {
    if constexpr (requires { T::kAxial; }) put_anchor(row, f.m, T::kAxial);
  });
  const bool textured = light.type == LightType::kRect && image >= 0;
  if (textured) put_int(row, kImage, image + 1);
  row[kImportance] = float(luminance(f.emission) * (textured ? table.images[image].mean : 1.0));
}

void add_hierarchy(LightTable& table) {
  table.hierarchy.radius.assign(size_t(table.count), 0.0f);
  std::vector<int32_t> numbers;
  std::vector<LightBox> boxes;
  for (int i = 0; i < table.analytic_count; ++i) {
    const LightType type = LightType(int_at(table.row(i), kType));
    const bool moves = table.motion.row(i) >= 0;
    if ((type == LightType::kDistant && table.row(i)[kSize0] > 0) || (moves && can_be_hit(type) && type != LightType::kDistant))
      table.hierarchy.far.push_back(i);
    if (type == LightType::kDistant || moves || !can_be_hit(type)) continue;
    const LightBox box = light_box(table.row(i));
    double diagonal2 = 0;
    for (int a = 0; a < 3; ++a) diagonal2 += (double(box.high[a]) - box.low[a]) * (double(box.high[a]) - box.low[a]);
    table.hierarchy.radius[size_t(i)] = std::max(float(0.5 * std::sqrt(diagonal2)), float(kSmallestLight));
    numbers.push_back(i), boxes.push_back(box);
  }
  build_light_hierarchy(table.hierarchy, std::move(numbers), boxes);
}

}  // namespace

void put_common_fields(const LightInput& light, LightTable& table, float* row) {
  table.lobe_factors |= light.diffuse != 1 || light.specular != 1;
  row[kDiffuseFactor] = light.diffuse, row[kSpecularFactor] = light.specular;
}

void copy_common_fields(const float* from, float* to) {
  for (const int field : {kDiffuseFactor, kSpecularFactor}) to[field] = from[field];
}

void add_light_rows(const LightInput& light, const dvec3& origin, double scale, LightTable& table, int image, Dome* earlier) {
  float row[kLightFields] = {};
  put_common_fields(light, table, row);
  put_int(row, kType, int(light.type));
  row[kInverseDet] = 1;
  RowFrame f{light.world_from_light, dvec3(light.emission)};
  if (light.type == LightType::kDome) {
    if (!add_dome(light, origin, scale, table, row, earlier)) return;
  } else if (light.type == LightType::kDistant) {
    put_distant(light, table, row, f);
  } else {
    put_placed(light, scale, row, f);
    f.m.o = (light.world_from_light.o - origin) * scale;
    put_surface(light, image, table, row, f);
  }
  const daffine& m = f.m;
  put(row, kAxisX, m.x), put(row, kAxisY, m.y), put(row, kAxisZ, m.z), put(row, kOrigin, m.o);
  const double det = m.determinant();
  if (det == 0 && light.type != LightType::kDome) return;  // a light without size; translation has reported it
  const daffine whole{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, dvec3(0.0)};
  const daffine inv = inverse(light.type == LightType::kDome ? whole : m);
  put(row, kInverseX, inv.x), put(row, kInverseY, inv.y), put(row, kInverseZ, inv.z);
  if (f.flags & kSheared) row[kInverseDet] = float(std::fabs(1 / det));
  put(row, kRadiance, f.emission);
  put_int(row, kLightFlags, f.flags);
  if (light.shaping && light.type != LightType::kDome && light.type != LightType::kDistant)
    add_shaping(*light.shaping, light.world_from_light, row, table);
  table.rows.insert(table.rows.end(), row, row + kLightFields);
  ++table.count;
  add_light_rules(light, scale, table);
}

void finish_light_rows(LightTable& table) {
  if (table.analytic_count > table.weighed) add_hierarchy(table);
  finish_light_rules(table);
  build_light_choice(table);
}

}  // namespace primray
