// Implementation of dice.hpp.
#include "subdivision/dicing/dice.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/time_spans.hpp"
#include "subdivision/dicing/flatness.hpp"
#include "subdivision/dicing/level.hpp"
#include "subdivision/dicing/mover.hpp"
#include "subdivision/limit.hpp"
#include "subdivision/masks.hpp"

namespace primray::subdivision {
namespace {

using Values = std::vector<double>;

Values doubles(std::span<const float> values) { return Values(values.begin(), values.end()); }

// Levels that an estimate refines itself, as long as they are small.
constexpr int kEstimatedFrom = 3, kEstimatedFaces = 4096;

// Cosine: faces whose normals differ by more are never flat (flatness.hpp).
constexpr double kTwoDegrees = 0.99939;

// Levels beyond those for the undisplaced face, where a displacement is discontinuous at one of its corners: refinement does
// not remove a discontinuity.
constexpr double kLevelsOfJumps = 2;

class Dicer {
 public:
  explicit Dicer(const DiceInput& in)
      : in_(in),
        how_{in.cage.scheme, in.cage.smooth_triangles},
        limit_(in.cage.scheme),
        linear_(in.cage.scheme == Scheme::kBilinear) {}

  int64_t estimate() {
    for (begin();;) {
      const Level& level = levels_.back();
      const int l = int(levels_.size()) - 1;
      if (has_limits() && (l >= kEstimatedFrom || level.surface.topology.faces() > kEstimatedFaces)) break;
      if (!choose(levels_.back())) break;
      too_many();
      refine();
    }
    return drawn_ + expected();
  }

  Diced run() {
    begin();
    if (in_.displacing) mover_.emplace(*in_.displacing, in_.footprint, in_.pixels, moved());
    for (;;) {
      if (has_limits()) add_new_vertices(levels_.back());
      if (!choose(levels_.back())) break;
      if (too_many()) {
        out_ = {};
        out_.is_complete = false;
        return std::move(out_);
      }
      refine();
    }
    out_.level = int(levels_.size()) - 1;
    out_.triangles = stitch(levels_, mover_ ? mover_->points() : out_.points);
    if (mover_) mover_->finish(out_.triangles);
    return std::move(out_);
  }

 private:
  void begin() {
    Cage cage = build_cage(in_.cage);
    flatness_.emplace(in_.footprint, in_.flatness, linear_, in_.faces_differ, cage.is_hole);
    out_.non_manifold_edges = cage.non_manifold_edges, out_.unknown_creases = cage.unknown_creases;
    Level& level = levels_.emplace_back();
    for (const FaceVarying& channel : in_.face_varying) add_channel(level, cage, channel);
    const Topology& t = level.surface.topology = std::move(cage.topology);
    level.surface.output.assign(t.vertices(), -1);
    level.is_active.resize(t.faces()), level.cage_face.resize(t.faces());
    for (int f = 0; f < t.faces(); ++f) level.is_active[f] = !cage.is_hole[f], level.cage_face[f] = f;
    if (normals_by_corner(t, cage)) level.corner_normal.assign(t.corners(), -1);
    for (size_t at = 0; at < in_.steps.size(); at += in_.points.size())
      steps_.push_back(doubles(in_.steps.subspan(at, in_.points.size())));
    out_.step_points.resize(steps_.size()), out_.step_normals.resize(steps_.size());
    points_ = doubles(in_.points), vertex_ = doubles(in_.vertex_values), varying_ = doubles(in_.varying_values);
  }

  Moved moved() {
    std::vector<int> widths;
    for (const FaceVarying& channel : in_.face_varying) widths.push_back(channel.width);
    return {out_.points,         out_.normals,      out_.step_points, out_.step_normals, out_.vertex_values,
            out_.varying_values, out_.face_varying, in_.vertex_width, in_.varying_width, std::move(widths)};
  }

  void add_channel(Level& level, const Cage& cage, const FaceVarying& channel) {
    ValueTopology made = face_varying_topology(cage, in_.cage.boundary, in_.rule, channel.indices);
    Values& values = face_varying_.emplace_back(made.value.size() * channel.width, 0.0);
    for (size_t v = 0; v < made.value.size(); ++v)
      for (int k = 0; k < channel.width && made.value[v] >= 0; ++k)
        values[v * channel.width + k] = channel.values[size_t(made.value[v]) * channel.width + k];
    Layer& layer = level.values.emplace_back();
    layer.topology = std::move(made.topology);
    layer.output.assign(made.value.size(), -1);
    out_.face_varying.emplace_back();
  }

  // Along a crease the surface has one normal on each side.
  bool normals_by_corner(const Topology& t, const Cage& cage) const {
    if (linear_) return true;
    for (int e = 0; e < t.edges(); ++e)
      if (t.edge_sharpness[e] >= kInfinite && t.twin[t.edge_corner[e]] >= 0) return true;
    return std::any_of(cage.is_singular.begin(), cage.is_singular.end(), [](uint8_t s) { return s; });
  }

  // Limit masks require faces that are all alike; other cages get there with their first refinement.
  bool has_limits() const { return levels_.back().surface.topology.arity == (in_.cage.scheme == Scheme::kLoop ? 3 : 4); }

  // Adds vertices of active faces that are not yet in the output, with their normals and values.
  void add_new_vertices(Level& level) {
    const Topology& t = level.surface.topology;
    std::vector<uint8_t> is_new(t.vertices(), 0);
    for (int f = 0; f < t.faces(); ++f)
      for (int c = t.begin(f), end = c + t.size(f); level.is_active[f] && c < end; ++c)
        is_new[t.vertex[c]] = level.surface.output[t.vertex[c]] < 0;
    const size_t more = size_t(std::count(is_new.begin(), is_new.end(), 1));
    out_.points.reserve(out_.points.size() + 3 * more);
    if (level.corner_normal.empty()) out_.normals.reserve(out_.normals.size() + 3 * more);
    for (int v = 0; v < t.vertices(); ++v)
      if (is_new[v]) add_vertex(level, v);
    for (size_t k = 0; k < level.values.size(); ++k) add_new_values(level, int(k), is_new);
    if (!level.corner_normal.empty())
      for (int c = 0; c < t.corners(); ++c)
        if (is_new[t.vertex[c]] && level.corner_normal[c] < 0) add_corner_normals(level, c);
    if (mover_) mover_->add(level, is_new);
  }

  void add_new_values(Level& level, int channel, const std::vector<uint8_t>& is_new) {
    Layer& layer = level.values[channel];
    const bool linear = linear_ || in_.rule == LinearRule::kAll;
    std::vector<uint8_t> wanted(layer.topology.vertices(), 0);
    for (int c = 0; c < layer.topology.corners(); ++c)
      if (is_new[level.surface.topology.vertex[c]]) wanted[layer.topology.vertex[c]] = 1;
    for (int v = 0; v < layer.topology.vertices(); ++v)
      if (wanted[v] && layer.output[v] < 0)
        layer.output[v] = add_value(layer.topology, v, face_varying_[channel], in_.face_varying[channel].width, linear,
                                    out_.face_varying[channel]);
  }

  void add_vertex(Level& level, int v) {
    const Topology& t = level.surface.topology;
    level.surface.output[v] = add_point(level, v, points_, out_.points, out_.normals);
    for (size_t k = 0; k < steps_.size(); ++k) add_point(level, v, steps_[k], out_.step_points[k], out_.step_normals[k]);
    if (in_.vertex_width) add_value(t, v, vertex_, in_.vertex_width, linear_, out_.vertex_values);
    if (in_.varying_width) add_value(t, v, varying_, in_.varying_width, true, out_.varying_values);
  }

  // Adds a vertex's limit position, and its normal unless corners have their own; returns its index.
  int add_point(const Level& level, int v, const Values& from, std::vector<float>& points, std::vector<float>& normals) {
    const Topology& t = level.surface.topology;
    if (level.corner_normal.empty() && !t.is_sharp[v]) {
      double p[3];
      add_normal(limit_.smooth_point(t, v, from, p), normals);
      points.insert(points.end(), p, p + 3);
      return int(points.size() / 3) - 1;
    }
    const int number = add_value(t, v, from, 3, linear_, points);
    if (level.corner_normal.empty()) {
      limit_.normals(t, t.outgoing[v], from, fan_);
      add_normal(fan_.normals[0], normals);
    }
    return number;
  }

  int add_value(const Topology& t, int v, const Values& values, int width, bool linear, std::vector<float>& out) {
    row_.resize(width);
    if (linear)
      std::copy_n(values.data() + size_t(v) * width, width, row_.data());
    else
      limit_.position(t, v, values, width, row_.data());
    const int n = int(out.size() / width);
    out.insert(out.end(), row_.begin(), row_.end());
    return n;
  }

  static void add_normal(const dvec3& n, std::vector<float>& to) { to.insert(to.end(), {float(n.x), float(n.y), float(n.z)}); }

  void add_corner_normals(Level& level, int corner) {
    const Topology& t = level.surface.topology;
    const int first = int(out_.normals.size() / 3);
    if (linear_) {
      level.corner_normal[corner] = first;
      if (in_.displacing && in_.displacing->normals >= 0) return add_given_normals(level, corner, in_.displacing->normals);
      add_normal(bilinear_normal(t, corner, points_), out_.normals);
      for (size_t k = 0; k < steps_.size(); ++k) add_normal(bilinear_normal(t, corner, steps_[k]), out_.step_normals[k]);
      return;
    }
    for (size_t k = 0; k < steps_.size(); ++k) {
      limit_.normals(t, corner, steps_[k], fan_);
      for (const dvec3& n : fan_.normals) add_normal(n, out_.step_normals[k]);
    }
    limit_.normals(t, corner, points_, fan_);
    for (const dvec3& n : fan_.normals) add_normal(n, out_.normals);
    for (size_t i = 0; i < fan_.of_corner.size(); ++i) level.corner_normal[limit_.fan().corners[i]] = first + fan_.of_corner[i];
  }

  // Adds the normals along which the surface is displaced, given as a primvar: of the frame, then of the steps, if they rotate.
  void add_given_normals(const Level& level, int corner, int channel) {
    const Layer& layer = level.values[channel];
    const int width = in_.face_varying[channel].width;
    const float* row = &out_.face_varying[channel][size_t(layer.output[layer.topology.vertex[corner]]) * width];
    const auto given = [&](size_t time) {
      const float* n = row + (int(3 * time) < width ? 3 * time : 0);
      const dvec3 v(n[0], n[1], n[2]);
      const double l = length(v);
      return l > 1e-12 ? v * (1 / l) : bilinear_normal(level.surface.topology, corner, time ? steps_[time - 1] : points_);
    };
    add_normal(given(0), out_.normals);
    for (size_t k = 0; k < steps_.size(); ++k) add_normal(given(k + 1), out_.step_normals[k]);
  }

  static dvec3 point(const Values& from, int v) {
    return {from[size_t(v) * 3], from[size_t(v) * 3 + 1], from[size_t(v) * 3 + 2]};
  }

  // Normal of the bilinear patch: its edges are lines of it. Where they vanish, the face's own.
  static dvec3 bilinear_normal(const Topology& t, int c, const Values& from) {
    const auto at = [&](int corner) { return point(from, t.vertex[corner]); };
    dvec3 n = cross(at(t.next(c)) - at(c), at(t.previous(c)) - at(c));
    if (!(length(n) > 0)) n = cross(at(c ^ 2) - at(c), at(t.previous(c)) - at(t.next(c)));
    const double l = length(n);
    return l > 0 ? n * (1 / l) : dvec3(0, 0, 1);
  }

  // Chooses the faces that are refined further; returns whether there are any.
  bool choose(Level& level) {
    const Topology& t = level.surface.topology;
    const int l = int(levels_.size()) - 1;
    const bool must = l < in_.min_level || !has_limits();
    level.is_refined.assign(t.faces(), 0);
    gather_values(level);
    bool any = false;
    for (int f = 0; f < t.faces(); ++f) {
      if (!level.is_active[f]) continue;
      const bool wants = must || wanted_levels(level, f) > 0;
      if (wants && !must && l >= in_.max_level) out_.is_level_limited = true;
      level.is_refined[f] = must || (wants && l < in_.max_level);
      any |= level.is_refined[f] != 0;
    }
    return any;
  }

  // Maximum over all times.
  double wanted_levels(const Level& level, int f) {
    if (mover_) return moved_levels(level, f);
    double levels = wanted_levels(level, f, points_);
    for (const Values& step : steps_) levels = std::max(levels, wanted_levels(level, f, step));
    return levels;
  }

  // Number of further levels for a displaced surface, of which no level proves that finer ones are flat.
  double moved_levels(const Level& level, int f) {
    const Topology& t = level.surface.topology;
    double longest = 0, as_it_lies = 0;
    bool jumps = false;
    for (size_t k = 0; k <= steps_.size(); ++k) {
      const std::vector<float>& points = k ? out_.step_points[k - 1] : out_.points;
      const auto measured = [&](const auto& point) {
        corners_.clear();
        for (int c = t.begin(f), end = c + t.size(f); c < end; ++c)
          corners_.push_back(point(level.surface.output[t.vertex[c]]));
        return face_pixels(in_.footprint, corners_);
      };
      longest = std::max(longest, measured([&](int v) {
                           jumps |= mover_->is_torn(v);
                           return mover_->point(points, v);
                         }));
      if (jumps) as_it_lies = std::max(as_it_lies, measured([&](int v) { return vector_at(points, v); }));
    }
    const auto levels = [&](double pixels) { return pixels > in_.pixels ? std::log2(pixels / in_.pixels) : 0; };
    return jumps ? std::min(levels(longest), levels(as_it_lies * std::exp2(kLevelsOfJumps))) : levels(longest);
  }

  // Number of further levels that the length of a face's edges requires, limited by the number until it is flat; 0 if it is
  // drawn as it is.
  double wanted_levels(const Level& level, int f, const Values& points) {
    const Topology& t = level.surface.topology;
    corners_.clear();
    for (int c = t.begin(f), end = c + t.size(f); c < end; ++c) corners_.push_back(point(points, t.vertex[c]));
    const double longest = face_pixels(in_.footprint, corners_);
    if (!(longest > in_.pixels)) return 0;
    const double levels = std::log2(longest / in_.pixels);
    if (!(in_.flatness > 0) || is_plainly_curved(level, f)) return levels;
    return std::min(levels, flatness_->levels_to_flat(level, f, points, level_values_, longest));
  }

  // Shortcut for most faces that are not flat: normals that have been computed already differ too much.
  bool is_plainly_curved(const Level& level, int f) const {
    const Topology& t = level.surface.topology;
    const int b = t.begin(f), n = t.size(f);
    dvec3 normals[4];
    for (int k = 0; k < n; ++k) {
      const int at = level.corner_normal.empty() ? level.surface.output[t.vertex[b + k]] : level.corner_normal[b + k];
      if (at < 0) return false;  // an estimate computes none
      const float* p = &out_.normals[size_t(at) * 3];
      normals[k] = {p[0], p[1], p[2]};
    }
    const auto differ = [&](int i, int j) { return dot(normals[i], normals[j]) < kTwoDegrees; };
    return differ(0, 1) || differ(1, 2) || differ(0, n - 1) || (n == 4 && differ(2, 3));
  }

  // Gathers the primvars of a level's faces, for flatness_.
  void gather_values(const Level& level) {
    level_values_.clear();
    const Topology* t = &level.surface.topology;
    if (in_.vertex_width) level_values_.push_back({t, &vertex_, in_.vertex_width, linear_, false});
    if (in_.varying_width) level_values_.push_back({t, &varying_, in_.varying_width, true, false});
    for (size_t k = 0; k < level.values.size(); ++k)
      level_values_.push_back({&level.values[k].topology, &face_varying_[k], in_.face_varying[k].width,
                               linear_ || in_.rule == LinearRule::kAll, true});
  }

  // Number of triangles of the last level's faces and of all that they will be split into.
  int64_t expected() {
    const Level& level = levels_.back();
    const Topology& t = level.surface.topology;
    const int l = int(levels_.size()) - 1;
    gather_values(level);
    double n = 0;
    for (int f = 0; f < t.faces(); ++f) {
      if (!level.is_active[f]) continue;
      const double wanted = std::ceil(wanted_levels(level, f));
      const double more = std::max(std::min(wanted, double(in_.max_level - l)), double(std::max(in_.min_level - l, 0)));
      n += (t.size(f) - 2) * std::pow(4.0, more);
    }
    return int64_t(n);
  }

  bool too_many() {
    const Level& level = levels_.back();
    const Topology& t = level.surface.topology;
    int64_t next = 0;
    for (int f = 0; f < t.faces(); ++f) {
      if (!level.is_active[f]) continue;
      if (level.is_refined[f])
        next += in_.cage.scheme == Scheme::kLoop ? 4 : 2 * t.size(f);
      else
        drawn_ += t.size(f) - 2;
    }
    return has_limits() && drawn_ + next > in_.max_triangles;
  }

  // The refined faces and all that share a vertex with them: their masks, and those of their children, depend on no others.
  std::vector<uint8_t> with_neighbours(Level& level) {
    const Topology& t = level.surface.topology;
    std::vector<uint8_t> touched(t.vertices(), 0), chosen(t.faces(), 0);
    level.is_split_edge.assign(t.edges(), 0);
    for (int f = 0; f < t.faces(); ++f)
      for (int c = t.begin(f), end = c + t.size(f); level.is_refined[f] && c < end; ++c)
        touched[t.vertex[c]] = level.is_split_edge[t.edge[c]] = 1;
    for (int c = 0; c < t.corners(); ++c)
      if (touched[t.vertex[c]]) chosen[t.face_of(c)] = 1;
    return chosen;
  }

  void refine() {
    levels_.emplace_back();
    Level &parent = levels_[levels_.size() - 2], &child = levels_.back();
    const std::vector<uint8_t> chosen = with_neighbours(parent);
    refine_layer(parent.surface, child.surface, chosen);
    refine_array(parent.surface, points_, 3, linear_);
    for (Values& step : steps_) refine_array(parent.surface, step, 3, linear_);
    if (in_.vertex_width) refine_array(parent.surface, vertex_, in_.vertex_width, linear_);
    if (in_.varying_width) refine_array(parent.surface, varying_, in_.varying_width, true);
    child.values.resize(parent.values.size());
    for (size_t k = 0; k < parent.values.size(); ++k) {
      refine_layer(parent.values[k], child.values[k], chosen);
      refine_array(parent.values[k], face_varying_[k], in_.face_varying[k].width, in_.rule == LinearRule::kAll);
    }
    hand_down_faces(parent, child);
    parent.keep_numbers_only();
  }

  void refine_layer(Layer& parent, Layer& child, const std::vector<uint8_t>& chosen) {
    child.topology = split_faces(parent.topology, in_.cage.scheme, chosen, parent.split);
    child.output.assign(child.topology.vertices(), -1);
    for (int v = 0; v < parent.topology.vertices(); ++v)
      if (const int c = parent.split.vertex_child[v]; c >= 0) child.output[c] = parent.output[v];
  }

  void refine_array(const Layer& parent, Values& values, int width, bool linear) {
    const Split& s = parent.split;
    const size_t n = s.edge_points + std::count_if(s.edge_child.begin(), s.edge_child.end(), [](int e) { return e >= 0; }) +
                     std::count_if(s.face_point.begin(), s.face_point.end(), [](int f) { return f >= 0; });
    Values next(n * width);
    refine_values(parent.topology, s, how_, linear, values, width, next);
    values = std::move(next);
  }

  void hand_down_faces(const Level& parent, Level& child) {
    const Topology &t = parent.surface.topology, &d = child.surface.topology;
    child.is_active.assign(d.faces(), 0), child.cage_face.assign(d.faces(), 0);
    if (!parent.corner_normal.empty()) child.corner_normal.assign(d.corners(), -1);
    for (int f = 0; f < t.faces(); ++f) {
      const int first = parent.surface.split.face_child[f];
      if (first < 0) continue;
      const int n = in_.cage.scheme == Scheme::kLoop ? 4 : t.size(f);
      for (int k = 0; k < n; ++k)
        child.is_active[first + k] = parent.is_refined[f], child.cage_face[first + k] = parent.cage_face[f];
      for (int k = 0; k < t.size(f) && !parent.corner_normal.empty(); ++k)
        child.corner_normal[d.arity * (first + k)] = parent.corner_normal[t.begin(f) + k];
    }
  }

  const DiceInput& in_;
  Refinement how_;
  Limit limit_;
  bool linear_;
  std::vector<Level> levels_;
  Values points_, vertex_, varying_;
  std::vector<Values> steps_;
  std::vector<Values> face_varying_;
  Diced out_;
  int64_t drawn_ = 0;
  std::optional<Flatness> flatness_;
  std::optional<Mover> mover_;
  std::vector<LevelValues> level_values_;
  FanNormals fan_;
  Values row_;
  std::vector<dvec3> corners_;
};

}  // namespace

Diced dice(const DiceInput& input) {
  const TimeSpan span("dice a cage");
  return Dicer(input).run();
}

int64_t estimated_triangles(const DiceInput& input) { return Dicer(input).estimate(); }

}  // namespace primray::subdivision
