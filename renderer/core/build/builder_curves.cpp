// Part of SceneBuilder that adds curves: their control points, segments, and ends.
#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "base/error.hpp"
#include "build/builder.hpp"
#include "motion/clock.hpp"

namespace primray {
namespace {

constexpr size_t kMostNumbers = size_t(1) << 31;
// Sine of the angle from which on two segments have a joint between them.
constexpr double kLeastBend = 1e-4;

// Extends a segment by kBeyond where another one precedes or follows it: Ramshaw 1989, "Blossoms are polar forms".
struct Longer {
  double of[4][4];

  Longer(bool before, bool after) {
    const double t[2] = {before ? -double(kBeyond) : 0.0, after ? 1 + double(kBeyond) : 1.0};
    for (int k = 0; k < 4; ++k)
      for (int j = 0; j < 4; ++j) {
        of[k][j] = 0;
        for (int chosen = 0; chosen < 8; ++chosen) {
          if (__builtin_popcount(unsigned(chosen)) != j) continue;
          double product = 1;
          for (int a = 0; a < 3; ++a) product *= chosen >> a & 1 ? t[a < k] : 1 - t[a < k];
          of[k][j] += product;
        }
      }
  }
};

// Control points of one curve, as given.
struct Points {
  const float* p;
  uint32_t last;

  const float* at(uint32_t i) const { return p + 4 * size_t(i); }
  bool same(uint32_t i, uint32_t k) const {
    const float *a = at(i), *b = at(k);
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
  }
  dvec3 way(uint32_t from, uint32_t to) const {
    const float *a = at(from), *b = at(to);
    const dvec3 d{double(b[0]) - a[0], double(b[1]) - a[1], double(b[2]) - a[2]};
    return d * (1 / length(d));
  }
  // Nearest distinct point from `i` towards `to`; `i` if there is none.
  uint32_t beyond(uint32_t i, uint32_t to) const {
    for (uint32_t k = i; k != to;) {
      k = to > i ? k + 1 : k - 1;
      if (!same(i, k)) return k;
    }
    return i;
  }
  bool is_seen(uint32_t i) const {  // of the segment from there on
    bool wide = false, long_enough = false;
    for (uint32_t k = i; k < i + 4; ++k) wide |= at(k)[3] > 0, long_enough |= !same(i, k);
    return wide && long_enough;
  }
  bool bends(uint32_t before_from, uint32_t before, uint32_t at, uint32_t after) const {
    const dvec3 a = way(before, before_from), b = way(at, after);
    return length(cross(a, b)) > kLeastBend || dot(a, b) < 0;
  }
  // Index of point `i` among those of the extended segments.
  uint32_t placed(uint32_t i) const { return i == last ? last / 3 * 4 - 1 : i / 3 * 4 + i % 3; }
};

// Adds the ends of one curve, whose drawn segments are [first, end) of the scene; its extended segments begin at point `base`
// of the group.
void add_ends(CurveTable& table, const CurvesInput& input, const Points& points, uint32_t base, size_t first, size_t end) {
  const auto put = [&](size_t segment, CurveEndKind kind, uint32_t at, uint32_t before, uint32_t after) {
    if (points.at(at)[3] > 0 || !input.times.empty())
      table.ends.push_back(
          {int32_t(segment), kind, base + points.placed(at), base + points.placed(before), base + points.placed(after)});
  };
  // Adds the joint of a segment that begins at `at`, while the one before ends at `from`.
  const auto join = [&](size_t segment, uint32_t at, uint32_t from) {
    const uint32_t before = points.beyond(from, 0), after = points.beyond(at, points.last);
    if (points.same(at, from) && before != from && after != at && points.bends(from, before, at, after))
      put(segment, CurveEndKind::kJoint, at, before, after);
  };
  if (input.closed) {
    join(first, 0, points.last);
  } else {
    const uint32_t after = points.beyond(0, points.last), before = points.beyond(points.last, 0);
    if (after != 0) put(first, CurveEndKind::kStart, 0, 0, after);
    if (before != points.last) put(end - 1, CurveEndKind::kEnd, points.last, before, points.last);
  }
  if (!input.joined) return;
  for (size_t s = first + 1; s < end; ++s) {
    const uint32_t at = (uint32_t(table.first_point[s]) - base) / 4 * 3;
    join(s, at, at);
  }
}

}  // namespace

void SceneBuilder::add_curves(const CurvesInput& input, const daffine& group_from_object) {
  Scene& s = *scene_;
  CurveTable& table = s.curves;
  Group& group = s.groups.back();
  CurveGroup& curves = group.curves;
  size_t count = 0;
  for (const int32_t n : input.segments) count += 4 * size_t(n);
  if (table.points.size() + 4 * count >= kMostNumbers) throw Error("too-large", "more than 536 million control points");
  const bool moves = !input.times.empty();
  if (!moves && curves.moving.segments > 0) throw Error("internal", "static curves must precede moving ones");

  last_is_curved_ = true, last_curved_taken_ = false, last_curved_rows_ = s.curved.rows();
  if (table.row.empty()) table.first_row = uint32_t(s.curved.rows());
  if (curves.point_count == 0) curves.point_base = uint32_t(table.points.size() / 4);
  const uint32_t set_base = curves.point_count;
  std::unordered_map<int32_t, int32_t> row_of_surface;
  const auto row_of = [&](int32_t surface) {
    const auto [found, is_new] = row_of_surface.try_emplace(surface, int32_t(s.curved.rows()));
    if (!is_new) return found->second;
    add_curved_row(surface);
    record_object_space(s.object_spaces.of_curved, size_t(found->second), surface, group_from_object);
    table.set_point.resize(s.curved.rows() - table.first_row, int32_t(set_base));
    return found->second;
  };
  const size_t at = table.points.size();
  table.points.resize(at + 4 * count);
  const std::span<const float> given = moves ? input.step_points : input.points;
  place_controls(given.first(input.points.size()), input.segments, input.closed, group_from_object, &table.points[at]);
  curves.point_count += uint32_t(count);

  CurveRange& range = moves ? curves.moving : curves.still;
  if (range.segments == 0) range.segment = uint32_t(table.first_point.size()), range.end = uint32_t(table.ends.size());
  const float* from = given.data();
  uint32_t base = set_base;
  const int32_t* surface = input.surfaces.data();
  const bool varies = input.surfaces.size() > 1;
  for (size_t c = 0; c < input.segments.size(); ++c) {
    const uint32_t segments = uint32_t(input.segments[c]);
    const Points points{from, 3 * segments};
    const size_t first = table.first_point.size();
    int32_t worn = -1;
    for (uint32_t k = 0; k < segments; ++k, surface += varies) {
      if (*surface < 0 || !(points.is_seen(3 * k) || moves)) continue;
      if (first == table.first_point.size() || *surface != worn)
        table.row.push_back(row_of(worn = *surface)), table.curve.push_back(int32_t(c));
      table.first_point.push_back(int32_t(base + 4 * k)), table.run.push_back(int32_t(table.row.size()) - 1);
    }
    const size_t end = table.first_point.size();
    if (end > first) add_ends(table, input, points, base, first, end);
    from += 4 * (3 * size_t(segments) + 1), base += 4 * segments;
  }
  range.segments = uint32_t(table.first_point.size()) - range.segment;
  range.ends = uint32_t(table.ends.size()) - range.end;
  s.curves.any |= range.segments > 0;
  if (moves) add_curve_steps(input, group_from_object);
}

void SceneBuilder::place_controls(std::span<const float> points, std::span<const int32_t> segments, bool closed,
                                  const daffine& group_from_object, float* to) const {
  static const Longer variants[2][2] = {{{false, false}, {false, true}}, {{true, false}, {true, true}}};
  const double size = std::cbrt(std::fabs(group_from_object.determinant())) * group_scale_;
  const float* p = points.data();
  for (const int32_t count : segments) {
    for (int32_t s = 0; s < count; ++s, p += 12) {
      const Longer& longer = variants[closed || s > 0][closed || s + 1 < count];
      dvec3 own[4];
      for (int k = 0; k < 4; ++k) own[k] = to_group(group_from_object.point({p[4 * k], p[4 * k + 1], p[4 * k + 2]}));
      // Radii between the ends may have negative control values; otherwise 0 is only passed where the segment is extended.
      const bool dips = std::min(p[7], p[11]) < 0;
      for (int k = 0; k < 4; ++k, to += 4) {
        const double* m = longer.of[k];
        // Differences, so that nothing is lost where coordinates are large.
        const dvec3 q =
            own[k] + (own[0] - own[k]) * m[0] + (own[1] - own[k]) * m[1] + (own[2] - own[k]) * m[2] + (own[3] - own[k]) * m[3];
        const double r = p[3] * m[0] + p[7] * m[1] + p[11] * m[2] + p[15] * m[3];
        to[0] = float(q.x), to[1] = float(q.y), to[2] = float(q.z),
        to[3] = float(dips && k % 3 ? r * size : std::max(r * size, 0.0));
      }
    }
    p += 4;
  }
}

void SceneBuilder::add_curve_steps(const CurvesInput& input, const daffine& group_from_object) {
  Scene& s = *scene_;
  Group& group = s.groups.back();
  const size_t given = input.points.size();
  size_t size = 0;
  for (const int32_t n : input.segments) size += 16 * size_t(n);
  take_clock(input.times);
  group.curves.moving_points += uint32_t(size / 4);
  later_controls_.resize(input.times.size() - 1);
  for (size_t k = 0; k < later_controls_.size(); ++k) {
    std::vector<float>& to = later_controls_[k];
    to.resize(to.size() + size);
    place_controls(input.step_points.subspan((k + 1) * given, given), input.segments, input.closed, group_from_object,
                   to.data() + to.size() - size);
  }
}

}  // namespace primray
