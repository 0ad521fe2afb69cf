// Sizes go from the matrix into the light where its axes stay perpendicular, so that only a true shear is left to handle.
#include "build/lights/light_rows.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "build/lights/light_bounds.hpp"
#include "build/lights/light_choice.hpp"
#include "build/lights/light_rules.hpp"
#include "build/lights/shaping_rows.hpp"

namespace primray {
namespace {

// Squares of sizes must stay floats; a light smaller than this is as good as one of this size and the same power.
constexpr double kSmallest = 1e-15;

// A light's frame: perpendicular unit axes with sizes beside them, or the matrix without its mean size where that cannot be.
struct LightFrame {
  daffine world_from_light;
  dvec3 sizes{1.0, 1.0, 1.0};  // what went out of the matrix
  bool sheared = false;
};

bool perpendicular(const dvec3& a, const dvec3& b) { return std::fabs(dot(a, b)) <= 1e-6 * length(a) * length(b); }

LightFrame light_frame(const LightInput& light) {
  LightFrame f{light.world_from_light, {1.0, 1.0, 1.0}, false};
  daffine& m = f.world_from_light;
  const double x = length(m.x), y = length(m.y), z = length(m.z);
  const auto same = [](double a, double b) { return std::fabs(a - b) <= 1e-6 * std::max(a, b); };
  // Flat lights need no depth: any normal to their plane does, on the side where -z goes.
  bool round = true;
  switch (light.type) {
    case LightType::kRect:
      round = perpendicular(m.x, m.y);
      break;
    case LightType::kDisk:
      round = perpendicular(m.x, m.y) && same(x, y);
      break;
    case LightType::kSphere:
      round = perpendicular(m.x, m.y) && perpendicular(m.y, m.z) && perpendicular(m.z, m.x) && same(x, y) && same(y, z);
      break;
    case LightType::kCylinder:
      round = perpendicular(m.x, m.y) && perpendicular(m.y, m.z) && perpendicular(m.z, m.x) && same(y, z);
      break;
    default:
      break;
  }
  const bool flat = light.type == LightType::kRect || light.type == LightType::kDisk;
  if (flat) {
    const dvec3 n = cross(m.x, m.y);
    const double side = dot(n, m.z) < 0 ? -1 : 1, area = length(n);
    if (area > 0) m.z = n * (side / area);
  }
  if (!round) {
    f.sheared = true;
    // The mean size goes out of the matrix all the same, so that lengths of the frame are about those of the world: what
    // selection weighs is estimated by them.
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

// Only directions matter of a distant light or a dome: an orthonormal frame about its z (distant) or all its axes (dome).
Affine<float> rotation_of(const daffine& m) {
  return {vec3(normalize(m.x)), vec3(normalize(m.y)), vec3(normalize(m.z)), vec3(0.0f)};
}

// The point of a round light's surface (of a cylinder without ends) that is nearest to the core's origin.
void put_anchor(float* row, const daffine& m, LightType type) {
  if (m.determinant() == 0) return;  // such a light is left out
  dvec3 out = inverse(m).point(dvec3(0.0));
  const double along = type == LightType::kCylinder ? out.x : 0.0;
  out.x -= along;
  out = length(out) > 0 ? normalize(out) : dvec3{0, 0, 1};
  const dvec3 nearest = out * double(row[kSize0]);
  put(row, kAnchor, m.point({nearest.x + along, nearest.y, nearest.z}));
  put(row, kAnchorNormal, out);
}

void add_dome(const LightInput& light, const dvec3& origin, double scale, LightTable& table, float* row, bool& sampled) {
  Dome d;
  d.world_from_light = rotation_of(light.world_from_light);
  d.tint = light.emission;
  d.width = light.texture_width, d.height = light.texture_height;
  d.texels.assign(light.texels.begin(), light.texels.end());
  d.format = light.format;
  finish_dome_image(d);
  LightTable portals;
  portals.weighed = LightTable::kWeighedPortals;
  const bool special = is_special(light);
  if (light.diffuse != 0 || light.specular != 0) {
    special ? build_whole_dome_distribution(d) : build_dome_distribution(d);
    for (const PortalInput& p : light.portals) {
      LightInput rect;
      rect.type = LightType::kRect, rect.world_from_light = p.world_from_portal;
      rect.width = p.width, rect.height = p.height, rect.emission = vec3(1.0f);
      add_light_rows(rect, origin, scale, portals);
    }
    finish_light_rows(portals);
    // Of the light that comes through them about a hemisphere's half, for choosing among lights.
    if (portals.count > 0) d.irradiance += d.mean * 0.5 * std::numbers::pi;
  }
  sampled = d.sampled || portals.count > 0;
  row[kSize1] = float(table.domes.size());
  row[kImportance] = float(d.irradiance);
  table.dome_light.push_back(sampled ? table.count : -1);
  table.dome_factors.push_back({light.diffuse, light.specular});
  table.dome_traits.push_back({light.link, !light.visible_to_camera, special});
  table.domes.push_back(std::move(d));
  if (portals.count > 0 || !table.portals.empty()) {
    table.portals.resize(table.domes.size());
    table.portals.back() = std::move(portals);
  }
}

void add_hierarchy(LightTable& table) {
  table.met.radius.assign(size_t(table.count), 0.0f);
  std::vector<int32_t> numbers;
  std::vector<LightBox> boxes;
  for (int i = 0; i < table.listed; ++i) {
    const LightType type = LightType(int(table.row(i)[kType]));
    if (type == LightType::kDistant && table.row(i)[kSize0] > 0) table.met.far.push_back(i);
    if (type == LightType::kDistant || type == LightType::kDome || type == LightType::kPoint || type == LightType::kLine)
      continue;
    const LightBox box = light_box(table.row(i));
    double diagonal2 = 0;
    for (int a = 0; a < 3; ++a) diagonal2 += (double(box.high[a]) - box.low[a]) * (double(box.high[a]) - box.low[a]);
    table.met.radius[size_t(i)] = std::max(float(0.5 * std::sqrt(diagonal2)), float(kSmallest));
    numbers.push_back(i), boxes.push_back(box);
  }
  build_light_hierarchy(table.met, std::move(numbers), boxes);
}

}  // namespace

void put_common_fields(const LightInput& light, LightTable& table, float* row) {
  table.lobe_factors |= light.diffuse != 1 || light.specular != 1;
  row[kDiffuseFactor] = light.diffuse, row[kSpecularFactor] = light.specular;
}

void copy_common_fields(const float* from, float* to) {
  for (const int field : {kDiffuseFactor, kSpecularFactor}) to[field] = from[field];
}

void add_light_rows(const LightInput& light, const dvec3& origin, double scale, LightTable& table, int image) {
  float row[kLightFields] = {};
  put_common_fields(light, table, row);
  row[kType] = float(int(light.type));
  row[kInverseDet] = 1;
  int flags = 0;
  dvec3 emission(light.emission);
  bool sampled = true;
  daffine m = light.world_from_light;
  if (light.type == LightType::kDome) {
    add_dome(light, origin, scale, table, row, sampled);
    if (!sampled) return;
  } else if (light.type == LightType::kDistant) {
    const Frame<double> frame(normalize(m.z));
    m = {frame.s, frame.t, frame.n, dvec3(0.0)};
    const double half = std::min(std::max(light.angle_deg, 0.0), 360.0) * (std::numbers::pi / 360);
    // 1 - cos t = 2 sin^2 (t / 2) keeps its digits for the smallest suns.
    const double s = std::sin(0.5 * half), spread = 2 * s * s;
    row[kSize0] = float(spread);
    row[kImportance] = float(luminance(emission) * (spread > 0 ? 2 * std::numbers::pi * std::min(spread, 0.5) : 1.0));
    table.needs_hit_test |= row[kSize0] > 0;
  } else {
    const LightFrame f = light_frame(light);
    m = f.world_from_light;
    double size[2] = {0, 0};
    switch (light.type) {
      case LightType::kRect:
        size[0] = 0.5 * light.width * f.sizes.x * scale, size[1] = 0.5 * light.height * f.sizes.y * scale;
        break;
      case LightType::kDisk:
      case LightType::kSphere:
        size[0] = size[1] = light.radius * f.sizes.x * scale;
        break;
      case LightType::kCylinder:
        size[0] = light.radius * f.sizes.y * scale, size[1] = 0.5 * light.length * f.sizes.x * scale;
        break;
      case LightType::kLine:
        size[0] = size[1] = 0.5 * light.length * f.sizes.x * scale;
        break;
      default:
        break;
    }
    if (light.type != LightType::kPoint) {
      const double kept[2] = {std::max(size[0], kSmallest), std::max(size[1], kSmallest)};
      emission =
          emission * (light.type == LightType::kLine ? scale * size[1] / kept[1] : size[0] / kept[0] * (size[1] / kept[1]));
      row[kSize0] = float(kept[0]), row[kSize1] = float(kept[1]);
    }
    if (f.sheared) flags |= kSheared;
    if (light.type == LightType::kPoint) {
      m.x = {1, 0, 0}, m.y = {0, 1, 0}, m.z = {0, 0, 1};
      emission = emission * (scale * scale);
    } else if (light.type == LightType::kLine) {
      const Frame<double> across(normalize(m.x));
      m.x = across.n, m.y = across.s, m.z = across.t;
    } else {
      table.needs_hit_test = true;
    }
    m.o = (light.world_from_light.o - origin) * scale;
    if (light.type == LightType::kSphere || light.type == LightType::kCylinder) put_anchor(row, m, light.type);
    const bool textured = light.type == LightType::kRect && image >= 0;
    if (textured) row[kImage] = float(image + 1);
    row[kImportance] = float(luminance(emission) * (textured ? table.images[image].mean : 1.0));
  }
  put(row, kAxisX, m.x), put(row, kAxisY, m.y), put(row, kAxisZ, m.z), put(row, kOrigin, m.o);
  const double det = m.determinant();
  if (det == 0 && light.type != LightType::kDome) return;  // a light without size; translation has said so
  if (light.type == LightType::kDome) m = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, dvec3(0.0)};
  const daffine inv = inverse(m);
  put(row, kInverseX, inv.x), put(row, kInverseY, inv.y), put(row, kInverseZ, inv.z);
  if (flags & kSheared) row[kInverseDet] = float(std::fabs(1 / det));
  put(row, kRadiance, emission);
  row[kLightFlags] = float(flags);
  if (light.shaping && light.type != LightType::kDome && light.type != LightType::kDistant)
    add_shaping(*light.shaping, light.world_from_light, row, table);
  table.rows.insert(table.rows.end(), row, row + kLightFields);
  ++table.count;
  add_light_rules(light, scale, table);
}

void finish_light_rows(LightTable& table) {
  if (table.listed > table.weighed) add_hierarchy(table);
  finish_light_rules(table);
  build_light_choice(table);
}

}  // namespace primray
