// Detection of pixels with light outlines: outlines are walked in steps of a fraction of a pixel, and each step's pixel is
// recorded if nothing hides the light there.
#include "build/lights/lights.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "accel/query.hpp"
#include "scene/scene.hpp"

namespace primray {
namespace {

// Steps per pixel, and the maximum for one line or circle. Beyond it, pixels are sampled like all others. Pixels beside a step
// are recorded as well: between two steps the outline may cut their corners.
constexpr double kStepsPerPixel = 4, kBeside = 0.5 / kStepsPerPixel + 0.01;
constexpr int kFewest = 8, kMost = 8192;
// Maximum number of lights whose outlines are searched, beyond which it would cost more than it gains; and of outlines in a
// pixel, beyond which it is sampled like all others, since each light has its own rays there.
constexpr int kMostLights = 1 << 14;
constexpr ptrdiff_t kMostInPixel = 6;
// Margin around the computed position of a light on the film, in pixels, more than any rounding.
constexpr double kMargin = 1e-3;

// Range of film positions along one axis.
struct Extent {
  double low, high;
};

// Film sample values for which the filter's offsets from the pixel's centre are in [low, high], slightly extended.
Extent numbers_of(const PixelFilter& filter, const Extent& offsets) {
  const std::vector<float>& table = filter.inverse_cdf;
  if (table.empty()) {
    const auto number = [&](double x) { return std::clamp(x / filter.box_width + 0.5, 0.0, 1.0); };
    return {number(offsets.low), number(offsets.high)};
  }
  const auto end = table.begin() + PixelFilter::kCells + 1;
  const auto below = std::upper_bound(table.begin(), end, float(offsets.low)) - table.begin();
  const auto above = std::lower_bound(table.begin(), end, float(offsets.high)) - table.begin();
  const auto number = [&](ptrdiff_t cell) { return std::clamp(double(cell) / PixelFilter::kCells, 0.0, 1.0); };
  return {number(below - 2), number(above + 1)};
}

struct Pixel {
  int32_t y, x, light;
  auto operator<=>(const Pixel&) const = default;
};

class Walk {
 public:
  explicit Walk(const Scene& scene) : scene_(scene), camera_(scene.camera) {
    const auto& table = camera_.filter.inverse_cdf;
    const float widest = table.empty() ? camera_.filter.box_width : 2 * table[PixelFilter::kCells];
    reach_ = std::clamp(int(std::ceil((widest - 1) / 2)), 0, 2);
  }

  // Appends the pixels with the outline of light number `i` to `found`.
  void light(int i, std::vector<Pixel>& found) {
    light_ = i, found_ = &found;
    const float* row = scene_.lights.row(i);
    with_light_type(row, [&]<class T>(T) {
      if constexpr (requires { T::outline(row, *this); }) T::outline(row, *this);
    });
  }

  // Columns and rows of the film that contain light number `i`; none if it extends behind the camera.
  std::optional<std::array<Extent, 2>> bounds(int i) const {
    const LightBox box = light_box(scene_.lights.row(i));
    std::array<Extent, 2> b{{{1e30, -1e30}, {1e30, -1e30}}};
    for (int corner = 0; corner < 8; ++corner) {
      const auto side = [&](int a) { return double(corner >> a & 1 ? box.high[a] : box.low[a]); };
      const dvec3 c = to_camera({side(0), side(1), side(2)});
      if (!(-c.z > 1e-6 * length(c))) return std::nullopt;
      const double on_film[2] = {column(c), row_of(c)};
      for (size_t a = 0; a < 2; ++a) b[a] = {std::min(b[a].low, on_film[a]), std::max(b[a].high, on_film[a])};
    }
    const float* row = scene_.lights.row(i);
    if (LightType(int_at(row, kType)) == LightType::kSphere && !(int_at(row, kLightFlags) & kSheared)) {
      // Refine by the planes through the camera that touch it.
      const dvec3 c = to_camera(light_vector(row, kOrigin));
      const auto touching = [&](double along, double sign) {
        return std::tan(std::atan2(along, -c.z) + sign * std::asin(std::min(row[kSize0] / std::hypot(along, c.z), 1.0)));
      };
      const auto inside = [](Extent& e, double low, double high) { e = {std::max(e.low, low), std::min(e.high, high)}; };
      inside(b[0], column({touching(c.x, -1), 0, -1}), column({touching(c.x, 1), 0, -1}));
      inside(b[1], row_of({0, touching(c.y, 1), -1}), row_of({0, touching(c.y, -1), -1}));
    }
    for (Extent& e : b) e = {e.low - kMargin, e.high + kMargin};
    return b;
  }

  // Edges of a light in world space; eye(): position of the camera.
  dvec3 eye() const { return dvec3(camera_.world_from_camera.o); }
  void line(const dvec3& a, const dvec3& b) {
    const int n = steps((a + b) * 0.5, length(b - a));
    for (int i = 0; i <= n; ++i) step(a + (b - a) * (double(i) / n));
  }
  void circle(const dvec3& center, const dvec3& u, const dvec3& v) {
    const int n = steps(center, 2 * std::numbers::pi * std::max(length(u), length(v)));
    for (int i = 0; i < n; ++i) {
      const double phi = 2 * std::numbers::pi * i / n;
      step(center + u * std::cos(phi) + v * std::sin(phi));
    }
  }
  // Silhouette of a sphere: the circle of tangent points.
  void sphere(const dvec3& center, double radius) {
    const dvec3 to = eye() - center;
    const double d2 = dot(to, to), r2 = radius * radius;
    if (!(d2 > r2)) return;
    const dvec3 w = to * (1 / std::sqrt(d2)), other = std::fabs(w.x) < 0.5 ? dvec3{1, 0, 0} : dvec3{0, 1, 0};
    const dvec3 u = normalize(cross(w, other)), v = cross(w, u);
    const double ring = radius * std::sqrt(1 - r2 / d2);
    circle(center + to * (r2 / d2), u * ring, v * ring);
  }

 private:
  // In the camera's axes, relative to it.
  dvec3 to_camera(const dvec3& p) const {
    const Affine<float>& m = camera_.world_from_camera;
    const dvec3 d = p - eye();
    return {dot(d, dvec3(m.x)), dot(d, dvec3(m.y)), dot(d, dvec3(m.z))};
  }
  double column(const dvec3& c) const {
    return (c.x / -c.z - camera_.left) * (camera_.width / (double(camera_.right) - camera_.left));
  }
  double row_of(const dvec3& c) const {
    return (camera_.top - c.y / -c.z) * (camera_.height / (double(camera_.top) - camera_.bottom));
  }

  void step(const dvec3& p) {
    const dvec3 c = to_camera(p);
    if (!(-c.z > camera_.near)) return;
    const double x = column(c), y = row_of(c);
    if (!(x >= -reach_ && y >= -reach_ && x < camera_.width + reach_ && y < camera_.height + reach_)) return;
    const auto pixel = [](double at) { return int32_t(std::floor(at)); };
    const Pixel first{pixel(y - kBeside), pixel(x - kBeside), light_}, last{pixel(y + kBeside), pixel(x + kBeside), light_};
    if (first == first_ && last == last_) return;
    const dvec3 d = p - eye();
    const double distance = length(d), from = distance * camera_.near / -c.z;
    const Rays<1> ray{vvec3<1>(eye()), vvec3<1>(d * (1 / distance)), vfloat<1>(float(from)),
                      vfloat<1>(float(distance * 0.9999))};
    if (any(occluded(scene_, false, vbool<1>(true), ray))) return;
    first_ = first, last_ = last;
    for (int j = std::max(first.y - reach_, 0); j <= std::min(last.y + reach_, camera_.height - 1); ++j)
      for (int i = std::max(first.x - reach_, 0); i <= std::min(last.x + reach_, camera_.width - 1); ++i)
        found_->push_back({j, i, light_});
  }
  int steps(const dvec3& near, double length_of_path) const {
    const double pixels = length_of_path * camera_.width / (double(camera_.right) - camera_.left);
    return int(std::clamp(pixels / std::max(-to_camera(near).z, 1e-20) * kStepsPerPixel, double(kFewest), double(kMost)));
  }
  const Scene& scene_;
  const Camera& camera_;
  int reach_;  // pixels by which the filter extends beyond its own
  int light_ = 0;
  std::vector<Pixel>* found_ = nullptr;
  Pixel first_{-9, -9, -9}, last_ = first_;  // those of the last step that counted
};

}  // namespace

LightOutlines find_light_outlines(const Scene& scene) {
  LightOutlines made;
  const Camera& camera = scene.camera;
  // Defocused lights have no outline. Through a pane only paths see lights as bodies.
  if (!scene.lights.needs_hit_test || camera.orthographic || camera.lens_radius > 0 || scene.has_thin) return made;
  if (scene.interiors.around_camera()) return made;
  // Moving lights have no fixed outline.
  if (camera.moves || scene.lights.motion.any()) return made;
  if (camera.distortion || camera.flawed) return made;  // its pixels are not those of a pinhole, or not as bright
  if (scene.lights.analytic_count > kMostLights) return made;
  std::vector<Pixel> found;
  Walk walk(scene);
  for (int i = 0; i < scene.lights.analytic_count; ++i)
    if (!(int_at(scene.lights.row(i), kLightFlags) & kHidden)) walk.light(i, found);
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  if (found.empty()) return made;
  made.rows.assign(size_t(camera.height) + 1, 0);
  const auto crowded = [&](const Pixel& p) {
    const auto [a, b] = std::equal_range(found.begin(), found.end(), p,
                                         [](auto& q, auto& r) { return std::pair(q.y, q.x) < std::pair(r.y, r.x); });
    return b - a > kMostInPixel;
  };
  for (const Pixel& p : found) {
    if (crowded(p)) continue;
    const auto bounds = walk.bounds(p.light);
    if (!bounds) continue;
    const Extent u = numbers_of(camera.filter, {(*bounds)[0].low - p.x - 0.5, (*bounds)[0].high - p.x - 0.5});
    const Extent v = numbers_of(camera.filter, {(*bounds)[1].low - p.y - 0.5, (*bounds)[1].high - p.y - 0.5});
    if (!(u.high > u.low && v.high > v.low)) continue;
    made.parts.push_back({p.x, p.light, float(u.low), float(v.low), float(u.high - u.low), float(v.high - v.low)});
    ++made.rows[size_t(p.y) + 1];
  }
  for (size_t y = 1; y < made.rows.size(); ++y) made.rows[y] += made.rows[y - 1];
  return made;
}

}  // namespace primray
