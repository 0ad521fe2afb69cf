// Flatness bounds of faces, and the neighbourhoods that they are computed from.

#include <algorithm>
#include <cmath>
#include <numbers>

#include "subdivision/dicing/flatness.hpp"

namespace primray::subdivision {
namespace {

bool is_cut(const Topology& t, int c) { return t.twin[c] < 0 || t.edge_sharpness[t.edge[c]] >= kInfinite; }

// Walks a face's sector at one of its corners.
struct SectorWalk {
  const Topology& t;
  std::vector<int32_t>& faces;
  int count = 1;
  bool closed = false, semi_sharp = false;

  void step(int side, int corner) {
    ++count, faces.push_back(t.face_of(corner));
    semi_sharp |= t.edge_sharpness[t.edge[side]] > 0;
  }
  void run(int corner) {
    int c = corner;
    while (!is_cut(t, t.previous(c))) {
      const int side = t.previous(c);
      c = t.twin[side];
      if (c == corner) {
        closed = true, semi_sharp |= t.edge_sharpness[t.edge[side]] > 0;
        return;
      }
      step(side, c);
    }
    for (c = corner; !is_cut(t, c);) {
      const int side = c;
      c = t.next(t.twin[c]);
      step(side, c);
    }
  }
};

int infinite_spokes(const Topology& t, int corner) {
  static thread_local Fan fan;
  gather_fan(t, corner, fan);
  return int(std::count_if(fan.sharpness.begin(), fan.sharpness.end(), [](float s) { return s >= kInfinite; }));
}

Sector sector_at(const Topology& t, int corner, std::vector<int32_t>& faces) {
  SectorWalk walk{t, faces};
  walk.run(corner);
  const float sharpness = t.vertex_sharpness[t.vertex[corner]];
  const int regular = t.arity == 4 ? 4 : 6;
  if (sharpness >= kInfinite) return Sector::kCorner;
  if (sharpness > 0 || walk.semi_sharp) return Sector::kOther;
  if (walk.closed) return walk.count == regular ? Sector::kSmooth : Sector::kOther;
  const int sharp = infinite_spokes(t, corner);
  if (sharp > 2) return Sector::kCorner;
  if (sharp < 2) return Sector::kOther;
  return walk.count == regular / 2 ? Sector::kCrease : Sector::kBentCrease;
}

// The 4 x 4 points of a regular quad's B-spline, -1 where the surface has ended: its own in the middle, corner 0 at (1, 1) and
// corner 1 at (2, 1).
struct Lattice {
  int32_t at[4][4];  // [y][x]

  int32_t& rotated(int k, int x, int y) {
    for (; k > 0; --k) {
      const int turned = 3 - y;
      y = x, x = turned;
    }
    return at[y][x];
  }
  void fill(const Topology& t, int f, const std::array<Sector, 4>& sectors) {
    for (auto& row : at) std::fill(row, row + 4, -1);
    for (int k = 0; k < 4; ++k) {
      const int c = 4 * f + k;
      rotated(k, 1, 1) = t.vertex[c];
      if (is_cut(t, c)) continue;
      const int o = t.twin[c], below = t.next(o);
      rotated(k, 1, 0) = t.vertex[t.next(below)];
      rotated(k, 2, 0) = t.vertex[t.previous(o)];
      if (sectors[k] == Sector::kSmooth) rotated(k, 0, 0) = t.vertex[t.previous(t.twin[below])];
    }
  }
};

void add_quad_differences(const Lattice& l, Neighbourhood& out) {
  for (int i = 0; i < 4; ++i)
    for (int k = 0; k < 2; ++k) {
      const std::array<int32_t, 3> along{l.at[i][k], l.at[i][k + 1], l.at[i][k + 2]};
      const std::array<int32_t, 3> across{l.at[k][i], l.at[k + 1][i], l.at[k + 2][i]};
      if (std::min({along[0], along[1], along[2]}) >= 0) out.bends[0].push_back(along);
      if (std::min({across[0], across[1], across[2]}) >= 0) out.bends[1].push_back(across);
    }
  for (int y = 0; y < 3; ++y)
    for (int x = 0; x < 3; ++x) {
      const std::array<int32_t, 4> cell{l.at[y][x], l.at[y][x + 1], l.at[y + 1][x + 1], l.at[y + 1][x]};
      if (*std::min_element(cell.begin(), cell.end()) >= 0) out.twists.push_back(cell);
    }
}

// Adds differences for every edge around the triangle's vertices that is inside the surface.
void add_triangle_differences(const Topology& t, Neighbourhood& out) {
  const int f = out.faces[0];
  const auto is_own = [&](int v) { return v == t.vertex[3 * f] || v == t.vertex[3 * f + 1] || v == t.vertex[3 * f + 2]; };
  for (int g : out.faces)
    for (int c = 3 * g; c < 3 * g + 3; ++c) {
      const int a = t.vertex[c], b = t.vertex[t.next(c)];
      if (is_cut(t, c) || t.twin[c] < c || !(is_own(a) || is_own(b))) continue;
      out.twists.push_back({a, t.vertex[t.previous(c)], b, t.vertex[t.previous(t.twin[c])]});
    }
}

void add_own_twist(const Topology& t, int f, Neighbourhood& out) {
  if (t.arity == 4) out.twists.push_back({t.vertex[4 * f], t.vertex[4 * f + 1], t.vertex[4 * f + 2], t.vertex[4 * f + 3]});
}

}  // namespace

void gather_neighbourhood(const Topology& t, int f, bool linear, Neighbourhood& out) {
  out.faces.assign(1, f), out.bends[0].clear(), out.bends[1].clear(), out.twists.clear();
  out.sectors.fill(Sector::kCorner), out.is_regular = true;
  if (linear) {
    add_own_twist(t, f, out);
    return;
  }
  for (int k = 0; k < t.arity; ++k) {
    out.sectors[k] = sector_at(t, t.arity * f + k, out.faces);
    out.is_regular &= out.sectors[k] != Sector::kOther && out.sectors[k] != Sector::kBentCrease;
  }
  std::sort(out.faces.begin() + 1, out.faces.end());
  out.faces.erase(std::unique(out.faces.begin() + 1, out.faces.end()), out.faces.end());
  if (!out.is_regular) return;
  if (t.arity == 3) {
    add_triangle_differences(t, out);
    return;
  }
  Lattice lattice;
  lattice.fill(t, f, out.sectors);
  add_quad_differences(lattice, out);
}

int crease_neighbour(const Topology& t, int corner, int v) {
  static thread_local Fan fan;
  const int other = t.vertex[corner] == v ? t.vertex[t.next(corner)] : t.vertex[corner];
  gather_fan(t, t.vertex[corner] == v ? corner : t.next(corner), fan);
  for (size_t i = 0; i < fan.spokes.size(); ++i)
    if (fan.sharpness[i] >= kInfinite && fan.spokes[i] != other) return fan.spokes[i];
  return -1;
}

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
