// Construction of shaping rows. Beside the formula's own parameters, a row has the largest angle off its axis at which the
// light emits, for light selection.
#include "build/lights/lights.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "light/shaping/shaping.hpp"

namespace primray {
namespace {

constexpr double kRadians = std::numbers::pi / 180;
// A larger factor could not be distinguished from a division by 0.
constexpr double kSteepest = 1e30;

bool keeps_angles(const daffine& m) {
  const double x = length(m.x), y = length(m.y), z = length(m.z), low = 1e-6 * x * x;
  return std::fabs(x - y) <= 1e-6 * x && std::fabs(x - z) <= 1e-6 * x && std::fabs(dot(m.x, m.y)) <= low &&
         std::fabs(dot(m.y, m.z)) <= low && std::fabs(dot(m.z, m.x)) <= low;
}

// Radius of the light's bounding sphere, more than rounding requires.
double reach_radius(const float* row) {
  double r = 0;
  with_light_type(row, [&]<class T>(T) { r = T::bounding_radius(row); });
  const float* center = row + light_center(row);
  return r * 1.001 + 1e-6 * std::max({std::fabs(center[0]), std::fabs(center[1]), std::fabs(center[2])});
}

struct ProfileFacts {
  double peak = 0, mean = 0, last = 0;  // `last`: the last vertical angle with light, radians
};

ProfileFacts facts_of(const IesTable& t, int profile) {
  const int nv = t.verticals[profile], nh = t.horizontals[profile];
  const float *v = &t.data[t.first[profile]], *h = v + nv, *c = h + nh;
  const bool about_y = t.about_y[profile];
  ProfileFacts f;
  for (int j = 0; j < nh; ++j)
    for (int i = 0; i < nv; ++i) {
      const double here = c[j * nv + i];
      f.peak = std::max(f.peak, here);
      if (here > 0) f.last = std::max(f.last, double(v[std::min(i + 1, nv - 1)]));
      if (i + 1 == nv || j + 1 == nh) continue;
      const double all = (here + c[j * nv + i + 1] + c[(j + 1) * nv + i] + c[(j + 1) * nv + i + 1]) / 4;
      const double dv = double(v[i + 1]) - v[i], dh = double(h[j + 1]) - h[j];
      const double jacobian = about_y ? std::cos(0.5 * (double(h[j]) + h[j + 1])) : std::sin(0.5 * (double(v[i]) + v[i + 1]));
      f.mean += all * dv * dh * std::fabs(jacobian) / (4 * std::numbers::pi);
    }
  if (about_y) f.last = std::numbers::pi;
  return f;
}

}  // namespace

int add_ies(const IesInput& profile, IesTable& t) {
  const size_t nv = profile.vertical_deg.size(), nh = profile.horizontal_deg.size();
  t.first.push_back(int32_t(t.data.size()));
  t.verticals.push_back(int32_t(nv)), t.horizontals.push_back(int32_t(nh)), t.about_y.push_back(profile.horizontal_pole);
  t.any_about_y |= profile.horizontal_pole;
  t.longest = std::max({t.longest, int(nv), int(nh)});
  for (const auto angles : {profile.vertical_deg, profile.horizontal_deg})
    for (const float a : angles) t.data.push_back(float(double(a) * kRadians));
  t.data.insert(t.data.end(), profile.candela.begin(), profile.candela.end());
  return int(t.first.size()) - 1;
}

void add_shaping(const ShapingInput& s, const daffine& world_from_light, float* light, LightTable& table) {
  float row[kShapingFields] = {};
  const ShapedFrame frame = shaped_frame(world_from_light);
  put(row, kShapedAxis, frame.axis);
  const double softness = std::clamp(s.cone_softness, 0.0, 1.0), cutoff = s.cone_angle_deg * kRadians, fade = softness * cutoff;
  row[kFocus] = float(std::clamp(s.focus, 0.0, 1e30));
  put(row, kFocusTint, dvec3(s.focus_tint));
  row[kConeCutoff] = float(cutoff);
  row[kConeSteepness] = fade > 0 ? float(std::min(1 / fade, kSteepest)) : 0.0f;
  double reach = std::clamp(cutoff, 0.0, std::numbers::pi);
  double peak = s.focus > 0 ? std::max(1.0f, luminance(s.focus_tint)) : 1.0;
  const double lit = s.focus > 0 ? 1 / (s.focus + 1) : 1.0;  // mean of |cos|^focus over all directions
  double mean = lit + (1 - lit) * luminance(s.focus_tint);
  if (s.ies >= 0) {
    put_int(row, kIesProfile, s.ies + 1);
    put(row, kIesFrame, frame.x), put(row, kIesFrame + 3, frame.y), put(row, kIesFrame + 6, frame.z);
    // UsdLux ShapingAPI, inputs:shaping:ies:angleScale: theta / a; theta; (theta - pi) / -a + pi.
    const double a = s.ies_angle_scale, scale = a == 0 ? 1 : std::min(1 / std::fabs(a), kSteepest),
                 origin = a < 0 ? std::numbers::pi : 0;
    row[kIesScale] = float(scale), row[kIesOrigin] = float(origin);
    row[kIesFactor] = float(1 / s.ies_divisor);
    const ProfileFacts f = facts_of(table.shaping.profiles, s.ies);
    peak *= f.peak / s.ies_divisor, mean *= f.mean / s.ies_divisor;
    if (keeps_angles(world_from_light) && f.last < 3.14159)
      reach = std::min(reach, std::max((f.last - origin) / scale + origin, 0.0));
  }
  row[kReach] = float(reach), row[kReachRadius] = float(reach_radius(light));
  row[kPeak] = float(peak);
  row[kMean] = float(std::max(mean * 0.5 * (1 - std::cos(reach * (1 - 0.5 * softness))), 1e-4 * peak));
  table.shaping.rows.insert(table.shaping.rows.end(), row, row + kShapingFields);
  table.has_shaping = true;
  put_int(light, kShaping, int32_t(table.shaping.rows.size() / kShapingFields));
}

}  // namespace primray
