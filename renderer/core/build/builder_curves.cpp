// The part of SceneBuilder that takes curves: their control points, segments, and what closes them.
#include <cmath>
#include <unordered_map>

#include "base/error.hpp"
#include "build/builder.hpp"
#include "motion/clock_of_times.hpp"

namespace primray {
namespace {

constexpr size_t kMostNumbers = size_t(1) << 31;
// Sine of the angle from which on two segments have a joint between them.
constexpr double kLeastBend = 1e-4;

// Some control points, counted within their group from `first` on.
struct Points {
  const float* p;
  uint32_t first;

  const float* at(uint32_t i) const { return p + 4 * size_t(i - first); }
  bool same(uint32_t i, uint32_t k) const {
    const float *a = at(i), *b = at(k);
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
  }
  dvec3 way(uint32_t from, uint32_t to) const {
    const float *a = at(from), *b = at(to);
    const dvec3 d{double(b[0]) - a[0], double(b[1]) - a[1], double(b[2]) - a[2]};
    return d * (1 / length(d));
  }
  // The nearest point from `i` on towards `last` that is elsewhere; `i` where there is none.
  uint32_t beyond(uint32_t i, uint32_t last) const {
    for (uint32_t k = i; k != last;) {
      k = last > i ? k + 1 : k - 1;
      if (!same(i, k)) return k;
    }
    return i;
  }
  bool is_seen(uint32_t i) const {  // of the segment from there on
    bool wide = false, long_enough = false;
    for (uint32_t k = i; k < i + 4; ++k) wide |= at(k)[3] > 0, long_enough |= !same(i, k);
    return wide && long_enough;
  }
  bool bends(const CurveEnd& e) const {
    const dvec3 a = way(e.before, e.at), b = way(e.at, e.after);
    return length(cross(a, b)) > kLeastBend || dot(a, b) < 0;
  }
};

// The ends of one curve between control points `from` and `to`, whose drawn segments are [first, end) of the scene's.
void add_ends(CurveTable& table, const CurvesInput& input, const Points& points, uint32_t from, uint32_t to, size_t first,
              size_t end) {
  std::vector<CurveEnd>& ends = table.ends;
  const auto put = [&](size_t segment, CurveEndKind kind, uint32_t at, uint32_t before, uint32_t after) {
    if (points.at(at)[3] > 0) ends.push_back({int32_t(segment), kind, at, before, after});
  };
  const auto join = [&](size_t segment, uint32_t at, uint32_t before_from, uint32_t before) {
    const CurveEnd e{int32_t(segment), CurveEndKind::kJoint, at, before, points.beyond(at, to)};
    if (points.same(at, before_from) && e.before != before_from && e.after != at && points.bends(e))
      put(segment, e.kind, at, e.before, e.after);
  };
  if (input.closed) {
    join(first, from, to, points.beyond(to, from));
  } else {
    const uint32_t after = points.beyond(from, to), before = points.beyond(to, from);
    if (after != from) put(first, CurveEndKind::kStart, from, from, after);
    if (before != to) put(end - 1, CurveEndKind::kEnd, to, before, to);
  }
  if (!input.joined) return;
  for (size_t s = first + 1; s < end; ++s) {
    const uint32_t at = uint32_t(table.first_point[s]);
    join(s, at, at, points.beyond(at, from));
  }
}

}  // namespace

void SceneBuilder::add_curves(const CurvesInput& input, const daffine& group_from_object) {
  Scene& s = *scene_;
  CurveTable& table = s.curves;
  Group& group = s.groups.back();
  CurveGroup& curves = group.curves;
  const size_t count = input.points.size() / 4;
  if (table.points.size() + input.points.size() >= kMostNumbers)
    throw Error("too-large", "more than 536 million control points");
  const bool moves = !input.times.empty();
  if (!moves && curves.moving.segments > 0) throw Error("internal", "curves that stand still come after moving ones");

  last_is_curved_ = true, last_curved_taken_ = false, last_curved_rows_ = s.curved.rows();
  if (table.row.empty()) table.first_row = uint32_t(s.curved.rows());
  if (curves.point_count == 0) curves.point_base = uint32_t(table.points.size() / 4);
  const Points points{nullptr, curves.point_count};
  std::unordered_map<int32_t, int32_t> row_of_surface;
  const auto row_of = [&](int32_t surface) {
    const auto [found, is_new] = row_of_surface.try_emplace(surface, int32_t(s.curved.rows()));
    if (!is_new) return found->second;
    add_curved_row(surface);
    note_object_space(s.object_spaces.of_curved, size_t(found->second), surface, group_from_object);
    table.set_point.resize(s.curved.rows() - table.first_row, int32_t(points.first));
    return found->second;
  };
  const size_t at = table.points.size();
  table.points.resize(at + input.points.size());
  place_controls((moves ? input.step_points : input.points).first(input.points.size()), group_from_object, &table.points[at]);
  curves.point_count += uint32_t(count);

  CurveRange& range = moves ? curves.moving : curves.still;
  if (range.segments == 0) range.segment = uint32_t(table.first_point.size()), range.end = uint32_t(table.ends.size());
  const Points placed{&table.points[at], points.first};
  uint32_t from = points.first;
  const int32_t* surface = input.surfaces.data();
  const bool varies = input.surfaces.size() > 1;
  for (size_t c = 0; c < input.segments.size(); ++c) {
    const uint32_t to = from + 3 * uint32_t(input.segments[c]);
    const size_t first = table.first_point.size();
    int32_t worn = -1;
    for (uint32_t p = from; p < to; p += 3, surface += varies) {
      if (*surface < 0 || !(placed.is_seen(p) || moves)) continue;
      if (first == table.first_point.size() || *surface != worn)
        table.row.push_back(row_of(worn = *surface)), table.curve.push_back(int32_t(c));
      table.first_point.push_back(int32_t(p)), table.run.push_back(int32_t(table.row.size()) - 1);
    }
    const size_t end = table.first_point.size();
    if (end > first) add_ends(table, input, placed, from, to, first, end);
    from = to + 1;
  }
  range.segments = uint32_t(table.first_point.size()) - range.segment;
  range.ends = uint32_t(table.ends.size()) - range.end;
  s.curves.any |= range.segments > 0;
  if (moves) add_curve_steps(input, group_from_object);
}

void SceneBuilder::place_controls(std::span<const float> points, const daffine& group_from_object, float* to) const {
  const double size = std::cbrt(std::fabs(group_from_object.determinant())) * group_scale_;
  for (size_t i = 0; i + 4 <= points.size(); i += 4) {
    const dvec3 p = to_group(group_from_object.point({points[i], points[i + 1], points[i + 2]}));
    to[i] = float(p.x), to[i + 1] = float(p.y), to[i + 2] = float(p.z), to[i + 3] = float(points[i + 3] * size);
  }
}

void SceneBuilder::add_curve_steps(const CurvesInput& input, const daffine& group_from_object) {
  Scene& s = *scene_;
  Group& group = s.groups.back();
  const size_t size = input.points.size();
  take_clock(input.times);
  group.curves.moving_points += uint32_t(size / 4);
  later_controls_.resize(input.times.size() - 1);
  for (size_t k = 0; k < later_controls_.size(); ++k) {
    std::vector<float>& to = later_controls_[k];
    to.resize(to.size() + size);
    place_controls(input.step_points.subspan((k + 1) * size, size), group_from_object, to.data() + to.size() - size);
  }
}

}  // namespace primray
