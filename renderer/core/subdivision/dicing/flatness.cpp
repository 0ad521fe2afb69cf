// Bounds of flatness.hpp.
#include "subdivision/dicing/flatness.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace primray::subdivision {
namespace {

constexpr double kNever = 99;
constexpr double kNormalAngle = std::numbers::pi / 180;
// Differences of single-precision numbers that should be 0 are a few units in the last place.
constexpr double kRounding = 3e-7;
// Tolerance of primvars whatever their gradient: a hundredth of a byte's step, 1/25 of a texel of 4096.
constexpr double kValue = 1e-5;

// Second-order errors fall to a quarter with each level.
double second_order(double ratio) {
  if (ratio <= 1) return 0;
  return ratio < 1e30 ? 0.5 * std::log2(ratio) : kNever;
}

}  // namespace

double Flatness::levels_to_flat(const Level& level, int f, const std::vector<double>& points,
                                std::span<const LevelValues> values, double longest) {
  t_ = &level.surface.topology, points_ = &points, face_ = f;
  gather_neighbourhood(*t_, f, linear_, around_);
  if (!look()) return kNever;
  double levels = normal_levels();
  if (levels >= kNever) return kNever;
  measure_views();
  levels = std::max({levels, height_levels(), edge_levels(level, values)});
  if (values.empty()) return levels;
  const double along = position_levels();
  for (const LevelValues& v : values) levels = std::max(levels, value_levels(v, along, longest));
  return levels;
}

// Computes the face's normal and the rounding of the points around; returns whether it has a normal.
bool Flatness::look() {
  const int b = t_->begin(face_);
  const dvec3 p = point(t_->vertex[b]), q = point(t_->vertex[b + 1]), r = point(t_->vertex[b + 2]);
  const dvec3 n = t_->arity == 4 ? cross(r - p, point(t_->vertex[b + 3]) - q) : cross(q - p, r - p);
  const double l = length(n);
  if (!(l > 0) || !std::isfinite(l)) return false;
  normal_ = n * (1 / l);
  double largest = 0;
  for (int g : around_.faces)
    for (int c = t_->begin(g), end = c + t_->size(g); c < end; ++c) {
      const dvec3 v = point(t_->vertex[c]);
      largest = std::max({largest, std::abs(v.x), std::abs(v.y), std::abs(v.z)});
    }
  rounding_ = kRounding * largest;
  return true;
}

// Computes pixels per unit of length where the face is nearest to the camera: that of the bounding sphere of its corners.
void Flatness::measure_views() {
  view_scale_.clear();
  const Projection& p = print_.projection;
  const int b = t_->begin(face_), n = t_->size(face_);
  for (const View& view : print_.views) {
    dvec3 center(0.0), corners[4];
    OutsideTest outside(p);
    for (int k = 0; k < n; ++k) {
      center += corners[k] = view.camera_from_object.point(point(t_->vertex[b + k]));
      outside.add(view, corners[k]);
    }
    center = center * (1.0 / n);
    double radius = 0;
    for (int k = 0; k < n; ++k) radius = std::max(radius, length(corners[k] - center));
    const double distance = p.orthographic ? 1 : std::max(view.distance(center) - radius, 1e-300);
    view_scale_.push_back(p.pixels_per_unit / distance / outside.allowance());
  }
}

double Flatness::pixels(dvec3 d) const {
  double most = print_.density * length(d);
  for (size_t i = 0; i < view_scale_.size(); ++i)
    most = std::max(most, view_scale_[i] * length(print_.views[i].camera_from_object.vector(d)));
  return most;
}

double Flatness::levels_of(dvec3 off) const { return length(off) <= rounding_ ? 0 : second_order(pixels(off) / tolerance_); }

// Bound from the normals of the control points' faces at all their corners: those of the patch are between them.
double Flatness::normal_levels() const {
  double sine = 0;
  for (int g : around_.faces)
    for (int c = t_->begin(g), end = c + t_->size(g); c < end; ++c) {
      const dvec3 v = point(t_->vertex[c]), a = point(t_->vertex[t_->next(c)]) - v, b = point(t_->vertex[t_->previous(c)]) - v;
      const dvec3 n = cross(a, b);
      const double l = length(n);
      if (l <= 1e-9 * length(a) * length(b)) continue;  // no normal: a point or a line
      if (!(dot(n, normal_) > 0)) return kNever;
      const bool is_exact = std::max(std::abs(dot(a, normal_)), std::abs(dot(b, normal_))) <= rounding_;
      if (!is_exact) sine = std::max(sine, length(cross(n, normal_)) / l);
    }
  const double ratio = sine / std::sin(kNormalAngle);
  return ratio <= 1 ? 0 : std::log2(ratio);
}

// Bound of the distance of the patch from its triangles, perpendicular to the surface.
double Flatness::height_levels() const {
  double off = 0;
  if (around_.is_regular) {
    double bends[2] = {0, 0}, twists = 0;
    for (int k = 0; k < 2; ++k)
      for (const auto& d : around_.bends[k]) bends[k] = std::max(bends[k], std::abs(dot(bend(d), normal_)));
    for (const auto& d : around_.twists) twists = std::max(twists, std::abs(dot(twist(d), normal_)));
    off = (bends[0] + bends[1]) / 8 + twists / (t_->arity == 4 ? 4 : 3);
  } else {
    double low = 0, high = 0;
    const dvec3 o = point(t_->vertex[t_->begin(face_)]);
    for (int g : around_.faces)
      for (int c = t_->begin(g), end = c + t_->size(g); c < end; ++c) {
        const double h = dot(point(t_->vertex[c]) - o, normal_);
        low = std::min(low, h), high = std::max(high, h);
      }
    off = high - low;
  }
  return levels_of(normal_ * off);
}

// Edges at which something ends must be straight lines.
double Flatness::edge_levels(const Level& level, std::span<const LevelValues> values) const {
  double levels = 0;
  for (int k = 0; k < t_->arity && !linear_; ++k) {
    const int c = t_->begin(face_) + k;
    if (t_->edge_sharpness[t_->edge[c]] >= kInfinite)
      levels = std::max(levels, crease_levels(k));
    else if (is_line_wanted(level, values, c))
      levels = std::max(levels, around_.is_regular ? smooth_edge_levels(k) : kNever);
  }
  return levels;
}

bool Flatness::is_line_wanted(const Level& level, std::span<const LevelValues> values, int c) const {
  const int across = level.cage_face[t_->face_of(t_->twin[c])], own = level.cage_face[face_];
  if (cage_holes_[across] || (faces_differ_ && across != own)) return true;
  return std::any_of(values.begin(), values.end(), [&](const LevelValues& v) { return v.topology->twin[c] < 0; });
}

// A crease is a cubic B-spline.
double Flatness::crease_levels(int k) const {
  const int c = t_->begin(face_) + k, a = t_->vertex[c], b = t_->vertex[t_->next(c)];
  const dvec3 e = point(b) - point(a);
  double levels = 0;
  for (const int v : {a, b}) {
    const Sector s = around_.sectors[v == a ? k : (k + 1) % t_->arity];
    if (s == Sector::kCorner) continue;
    const int before = s == Sector::kOther ? -1 : crease_neighbour(*t_, c, v);
    if (before < 0) return kNever;
    const dvec3 d = bend({before, v, v == a ? b : a});
    levels = std::max(levels, levels_of((d - e * (dot(d, e) / dot(e, e))) * 0.125));
  }
  return levels;
}

double Flatness::smooth_edge_levels(int k) const {
  const int c = t_->begin(face_) + k;
  const dvec3 e = point(t_->vertex[t_->next(c)]) - point(t_->vertex[c]);
  double levels = 0;
  const auto add = [&](dvec3 d) { levels = std::max(levels, levels_of(d - e * (dot(d, e) / dot(e, e)))); };
  if (t_->arity == 4)
    for (const auto& d : around_.bends[k & 1]) add(bend(d) * 0.125);
  else
    for (const auto& d : around_.twists) add(twist(d) * 0.25);
  return levels;
}

// Bound of the distance of points of the patch from those of the triangles for the same parameters, in all directions.
double Flatness::position_levels() const {
  if (!around_.is_regular) return kNever;
  double levels = 0;
  for (int k = 0; k < 2; ++k)
    for (const auto& d : around_.bends[k]) levels = std::max(levels, levels_of(bend(d) * 0.25));
  for (const auto& d : around_.twists) levels = std::max(levels, levels_of(twist(d) * (t_->arity == 4 ? 0.25 : 1.0 / 3)));
  return levels;
}

// `along`: position_levels(). Primvars follow either the parameters, as positions do, or the positions.
double Flatness::value_levels(const LevelValues& v, double along, double longest) {
  gather_neighbourhood(*v.topology, face_, v.linear, around_values_);
  const bool by_position = is_like_surface(v);
  const int b = t_->begin(face_), n = t_->size(face_);
  double levels = 0;
  for (int k = 0; k < v.width; ++k) {
    double low = 1e300, high = -1e300;
    for (int c = b; c < b + n; ++c) {
      const double x = (*v.values)[size_t(v.topology->vertex[c]) * v.width + k];
      low = std::min(low, x), high = std::max(high, x);
    }
    const double allowed =
        std::max({tolerance_ * (high - low) / longest, kValue, kRounding * std::abs(low), kRounding * std::abs(high)});
    double needed = high == low && around_values_.faces.size() == 1 ? 0 : std::max(along, lattice_levels(v, k, allowed));
    if (needed > 0 && by_position) needed = std::min(needed, joint_levels(v, k, allowed));
    levels = std::max(levels, needed);
  }
  return levels;
}

double Flatness::lattice_levels(const LevelValues& v, int component, double allowed) const {
  const Neighbourhood& r = around_values_;
  if (!r.is_regular) return kNever;
  const auto at = [&](int i) { return (*v.values)[size_t(i) * v.width + component]; };
  double bends[2] = {0, 0}, twists = 0;
  for (int k = 0; k < 2; ++k)
    for (const auto& d : r.bends[k]) bends[k] = std::max(bends[k], std::abs(at(d[0]) - 2 * at(d[1]) + at(d[2])));
  for (const auto& d : r.twists) twists = std::max(twists, std::abs(at(d[0]) - at(d[1]) + (at(d[2]) - at(d[3]))));
  return second_order(((bends[0] + bends[1]) / 8 + twists / (t_->arity == 4 ? 4 : 3)) / allowed);
}

// Compares with the affine function of position through the values of three corners: both go through the same masks.
double Flatness::joint_levels(const LevelValues& v, int component, double allowed) const {
  const int b = t_->begin(face_), last = b + t_->size(face_) - 1;
  const auto at = [&](int c) { return (*v.values)[size_t(v.topology->vertex[c]) * v.width + component]; };
  const dvec3 o = point(t_->vertex[b]), e = point(t_->vertex[b + 1]) - o, g = point(t_->vertex[last]) - o;
  const double ee = dot(e, e), eg = dot(e, g), gg = dot(g, g), determinant = ee * gg - eg * eg;
  if (!(determinant > 1e-12 * ee * gg)) return kNever;
  double off = 0;
  for (int face : around_.faces)
    for (int c = t_->begin(face), end = c + t_->size(face); c < end; ++c) {
      const dvec3 d = point(t_->vertex[c]) - o;
      const double x = (gg * dot(d, e) - eg * dot(d, g)) / determinant, y = (ee * dot(d, g) - eg * dot(d, e)) / determinant;
      off = std::max(off, std::abs(at(c) - (at(b) + x * (at(b + 1) - at(b)) + y * (at(last) - at(b)))));
    }
  return second_order(off / allowed);
}

// Whether the values go through the masks of the points.
bool Flatness::is_like_surface(const LevelValues& v) const {
  if (v.linear || linear_) return v.linear && linear_;
  if (!v.is_channel) return true;
  if (around_values_.faces != around_.faces || around_values_.sectors != around_.sectors) return false;
  const Topology& d = *v.topology;
  for (int f : around_.faces)
    for (int c = t_->begin(f), end = c + t_->size(f); c < end; ++c)
      if (d.edge_sharpness[d.edge[c]] != t_->edge_sharpness[t_->edge[c]] ||
          d.vertex_sharpness[d.vertex[c]] != t_->vertex_sharpness[t_->vertex[c]])
        return false;
  return true;
}

}  // namespace primray::subdivision
