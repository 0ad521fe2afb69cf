// Evaluation of mover.hpp.
#include "subdivision/dicing/mover.hpp"

#include <algorithm>
#include <cmath>

namespace primray::subdivision {
namespace {

constexpr double kAligned = 0.999;           // a cosine
constexpr double kTorn = 1e-2;               // relative difference of corners' vectors that counts as torn
constexpr double kTurned = 0.1;              // relative difference if their tangents differ: those of large faces do
constexpr size_t kAtOnce = size_t(1) << 14;  // corners that are evaluated at a time

// Directions in which st grows, summed over a vertex's corners.
struct TangentSum {
  dvec3 s{0.0}, t{0.0};

  void add(const dvec3& e1, const dvec3& e2, const float* st0, const float* st1, const float* st2, double weight) {
    const double s1 = double(st1[0]) - st0[0], t1 = double(st1[1]) - st0[1];
    const double s2 = double(st2[0]) - st0[0], t2 = double(st2[1]) - st0[1];
    const double area = s1 * t2 - s2 * t1;
    if (area == 0) return;
    const dvec3 ds = (e1 * t2 - e2 * t1) * (1 / area), dt = (e2 * s1 - e1 * s2) * (1 / area);
    const double ls = length(ds), lt = length(dt);
    if (ls > 0 && lt > 0) s += ds * (weight / ls), t += dt * (weight / lt);
  }
  // Like tangents of surfaces: perpendicular to the normal and to each other, of unit length; 0 where undefined.
  void at_right_angles(const dvec3& n, dvec3& tangent, dvec3& bitangent) const {
    tangent = s - n * dot(n, s);
    const double l = length(tangent);
    tangent = l > 1e-12 ? tangent * (1 / l) : dvec3(0.0);
    bitangent = cross(n, tangent);
    if (dot(bitangent, t) < 0) bitangent = -bitangent;
  }
};

}  // namespace

Mover::Mover(const Displacing& how, const Footprint& print, double pixels, Moved mesh)
    : how_(how), print_(print), pixels_(pixels), mesh_(std::move(mesh)) {
  for (const View& view : print_.views) stretches_.push_back(std::cbrt(std::fabs(view.camera_from_object.determinant())));
}

// Expected distance of vertices there, unless levels end before: textures are averaged alike whatever the level.
double Mover::spacing(const dvec3& p) const {
  double density = print_.density;
  const Projection& projection = print_.projection;
  for (size_t i = 0; i < print_.views.size(); ++i) {
    const View& view = print_.views[i];
    const double distance = projection.orthographic ? 1 : view.distance(view.camera_from_object.point(p));
    density = std::max(density, projection.pixels_per_unit * stretches_[i] / std::max(distance, 1e-300));
  }
  return density > 0 ? pixels_ / density : 0;
}

int Mover::normal_of(const Level& level, int c) const {
  return level.corner_normal.empty() ? level.surface.output[level.surface.topology.vertex[c]] : level.corner_normal[c];
}

// Whether two corners of one vertex have the same displacement.
bool Mover::are_aligned(const Level& level, int a, int b) const {
  const int n = normal_of(level, a), m = normal_of(level, b);
  return n == m || dot(vector_at(mesh_.normals, n), vector_at(mesh_.normals, m)) > kAligned;
}

bool Mover::says_the_same(const Level& level, int a, int b) const {
  const Topology& t = level.surface.topology;
  if (how_.faces_differ && level.cage_face[t.face_of(a)] != level.cage_face[t.face_of(b)]) return false;
  for (size_t k = 0; k < level.values.size(); ++k) {
    const Layer& layer = level.values[k];
    if (int(k) != how_.normals && layer.output[layer.topology.vertex[a]] != layer.output[layer.topology.vertex[b]])
      return false;
  }
  return true;
}

// Chooses one of the corners with the same displacement.
void Mover::choose_corners(const Level& level, const std::vector<uint8_t>& is_new) {
  const Topology& t = level.surface.topology;
  corners_.clear();
  std::vector<int32_t> last(t.vertices(), -1), before;  // of the chosen corners at a vertex, linked from the last one back
  for (int f = 0; f < t.faces(); ++f) {
    if (!level.is_active[f]) continue;
    for (int c = t.begin(f), end = c + t.size(f); c < end; ++c) {
      const int v = t.vertex[c];
      if (!is_new[v]) continue;
      int i = last[v];
      while (i >= 0 && !says_the_same(level, corners_[size_t(i)], c)) i = before[size_t(i)];
      if (i >= 0) {
        if (!are_aligned(level, corners_[size_t(i)], c)) is_torn_[size_t(level.surface.output[v])] = 1;
        continue;
      }
      before.push_back(last[v]), last[v] = int(corners_.size());
      corners_.push_back(c);
    }
  }
}

void Mover::add(const Level& level, const std::vector<uint8_t>& is_new) {
  const size_t vertices = mesh_.points.size() / 3;
  is_torn_.resize(vertices, 0);
  choose_corners(level, is_new);
  counts_.assign(size_t(level.surface.topology.vertices()), 0);
  moved_.resize(kMovedNumbers * vertices, 0.0f), shift_.resize(3 * vertices, 0.0f);
  for (size_t first = 0; first < corners_.size(); first += kAtOnce)
    ask(level, first, std::min(kAtOnce, corners_.size() - first));
  // Means: corners of a vertex may have been evaluated in different passes.
  const Topology& t = level.surface.topology;
  for (int v = 0; v < t.vertices(); ++v) {
    const float count = float(counts_[size_t(v)]);
    if (count < 2) continue;
    const size_t at = size_t(level.surface.output[v]);
    for (size_t k = 0; k < kMovedNumbers; ++k) moved_[kMovedNumbers * at + k] /= count;
    for (size_t k = 0; k < 3; ++k) shift_[3 * at + k] /= count;
  }
  if (is_tangential_) turn(level);
}

void Mover::ask(const Level& level, size_t first, size_t count) {
  const Topology& t = level.surface.topology;
  std::vector<float> points(9 * count), normals(3 * count), footprints(count), moved(kMovedNumbers * count, 0.0f);
  std::vector<int32_t> faces(count), vertices(3 * count);
  std::vector<std::vector<int32_t>> channels(level.values.size(), std::vector<int32_t>(3 * count));
  for (size_t i = 0; i < count; ++i) {
    const int c = corners_[first + i], corners[3] = {c, t.next(c), t.previous(c)};
    for (size_t k = 0; k < 3; ++k) {
      const int v = vertices[3 * i + k] = level.surface.output[t.vertex[corners[k]]];
      std::copy_n(&mesh_.points[3 * size_t(v)], 3, &points[9 * i + 3 * k]);
      for (size_t j = 0; j < channels.size(); ++j) {
        const Layer& layer = level.values[j];
        channels[j][3 * i + k] = layer.output[layer.topology.vertex[corners[k]]];
      }
    }
    std::copy_n(&mesh_.normals[3 * size_t(normal_of(level, c))], 3, &normals[3 * i]);
    footprints[i] = float(spacing(vector_at(points, int(3 * i))));
    faces[i] = level.cage_face[t.face_of(c)];
  }
  CornerRows rows{points, normals, footprints, faces, vertices, mesh_.vertex_values, mesh_.varying_values, {}, {}};
  for (size_t j = 0; j < channels.size(); ++j)
    rows.channels.push_back(channels[j]), rows.channel_values.push_back(mesh_.face_varying[j]);
  how_.displace(rows, moved);
  take(level, first, count, moved);
}

void Mover::take(const Level& level, size_t first, size_t count, const std::vector<float>& moved) {
  const Topology& t = level.surface.topology;
  for (size_t i = 0; i < count; ++i) {
    const int c = corners_[first + i];
    const size_t v = size_t(level.surface.output[t.vertex[c]]);
    const float* m = &moved[kMovedNumbers * i];
    for (size_t k = 0; k < kMovedNumbers; ++k) moved_[kMovedNumbers * v + k] += m[k];
    const dvec3 n = vector_at(mesh_.normals, normal_of(level, c));
    dvec3 by = n * double(m[2]) + dvec3(m[3], m[4], m[5]);
    if (m[0] != 0 || m[1] != 0) {
      is_tangential_ = true;
    }
    int32_t& asked = counts_[size_t(t.vertex[c])];
    if (asked > 0) {
      const dvec3 mean = vector_at(shift_, int(v)) * (1.0 / asked);
      if (length(by - mean) > kTorn * std::max(length(by), length(mean))) is_torn_[v] = 1;
    }
    ++asked;
    shift_[3 * v] += float(by.x), shift_[3 * v + 1] += float(by.y), shift_[3 * v + 2] += float(by.z);
  }
}

const std::vector<float>& Mover::st_values() const {
  if (how_.st.kind == ValuePlace::Kind::kFaceVarying) return mesh_.face_varying[size_t(how_.st.at)];
  return how_.st.kind == ValuePlace::Kind::kVertex ? mesh_.vertex_values : mesh_.varying_values;
}

size_t Mover::st_width() const {
  if (how_.st.kind == ValuePlace::Kind::kFaceVarying) return size_t(mesh_.channel_widths[size_t(how_.st.at)]);
  return size_t(how_.st.kind == ValuePlace::Kind::kVertex ? mesh_.vertex_width : mesh_.varying_width);
}

const float* Mover::st_of(const Level& level, int c) const {
  if (how_.st.kind != ValuePlace::Kind::kFaceVarying)
    return &st_values()[size_t(level.surface.output[level.surface.topology.vertex[c]]) * st_width() + size_t(how_.st.at)];
  const Layer& layer = level.values[size_t(how_.st.at)];
  return &st_values()[size_t(layer.output[layer.topology.vertex[c]]) * st_width()];
}

// Tangents of a level's faces approach those of the final mesh with every level, also at the vertices of earlier levels.
void Mover::turn(const Level& level) {
  const Topology& t = level.surface.topology;
  const size_t vertices = mesh_.points.size() / 3;
  struct Frame {
    TangentSum sum;
    dvec3 n{0.0};
  };
  std::vector<Frame> frames(vertices);
  is_turned_.assign(vertices, 0);
  const auto at = [&](int c) { return vector_at(mesh_.points, level.surface.output[t.vertex[c]]); };
  const auto sum_at = [&](int c) {
    TangentSum sum;
    const int next = t.next(c), previous = t.previous(c);
    if (how_.st.kind != ValuePlace::Kind::kNone)
      sum.add(at(next) - at(c), at(previous) - at(c), st_of(level, c), st_of(level, next), st_of(level, previous), 1);
    return sum;
  };
  const auto for_corners = [&](const auto& f) {
    for (int face = 0; face < t.faces(); ++face)
      for (int c = t.begin(face), end = c + t.size(face); level.is_active[face] && c < end; ++c)
        f(c, size_t(level.surface.output[t.vertex[c]]));
  };
  for_corners([&](int c, size_t v) {
    const TangentSum sum = sum_at(c);
    frames[v].sum.s += sum.s, frames[v].sum.t += sum.t, frames[v].n += vector_at(mesh_.normals, normal_of(level, c));
  });
  const auto vector_of = [&](const TangentSum& sum, const dvec3& n, size_t v) {
    const float* m = &moved_[kMovedNumbers * v];
    dvec3 tangent, bitangent;
    sum.at_right_angles(n, tangent, bitangent);
    return tangent * double(m[0]) + bitangent * double(m[1]) + n * double(m[2]) + dvec3(m[3], m[4], m[5]);
  };
  for (size_t v = 0; v < vertices; ++v) {
    const double l = length(frames[v].n);
    if (!(l > 0)) continue;
    frames[v].n = frames[v].n * (1 / l);
    const dvec3 by = vector_of(frames[v].sum, frames[v].n, v);
    shift_[3 * v] = float(by.x), shift_[3 * v + 1] = float(by.y), shift_[3 * v + 2] = float(by.z);
  }
  for_corners([&](int c, size_t v) {
    const dvec3 mean = vector_at(shift_, int(v)), own = vector_of(sum_at(c), frames[v].n, v);
    if (length(own - mean) > kTurned * std::max(length(own), length(mean))) is_turned_[v] = 1;
  });
}

dvec3 Mover::point(const std::vector<float>& points, int vertex) const {
  return vector_at(points, vertex) + vector_at(shift_, vertex);
}

std::vector<float> Mover::points() const {
  std::vector<float> made(mesh_.points.size());
  for (size_t i = 0; i < made.size(); ++i) made[i] = mesh_.points[i] + shift_[i];
  return made;
}

// Moves points of the frame or of a step, along the normals (one per vertex) that they have at that time.
void Mover::move(const Triangles& t, std::vector<float>& points, const std::vector<float>& normals) const {
  const size_t vertices = points.size() / 3;
  std::vector<TangentSum> sums(is_tangential_ ? vertices : 0);
  if (is_tangential_ && how_.st.kind != ValuePlace::Kind::kNone) {
    const bool by_corner = how_.st.kind == ValuePlace::Kind::kFaceVarying;
    const std::vector<float>& values = st_values();
    const size_t width = st_width();
    const std::vector<int32_t>& rows = by_corner ? t.values[size_t(how_.st.at)] : t.points;
    const size_t column = by_corner ? 0 : size_t(how_.st.at);
    for (size_t i = 0; i < t.points.size(); ++i) {
      const size_t triangle = i - i % 3, k = i % 3;
      const auto corner = [&](size_t j) { return triangle + (k + j) % 3; };
      const auto at = [&](size_t j) { return vector_at(points, t.points[corner(j)]); };
      const auto st = [&](size_t j) { return &values[size_t(rows[corner(j)]) * width + column]; };
      const dvec3 p = at(0);
      sums[size_t(t.points[i])].add(at(1) - p, at(2) - p, st(0), st(1), st(2), corner_angle(p, at(1), at(2)));
    }
  }
  for (size_t v = 0; v < vertices; ++v) {
    const float* m = &moved_[kMovedNumbers * v];
    const dvec3 n = vector_at(normals, int(v));
    dvec3 p = vector_at(points, int(v)) + n * double(m[2]) + dvec3(m[3], m[4], m[5]);
    if (is_tangential_) {
      dvec3 tangent, bitangent;
      sums[v].at_right_angles(n, tangent, bitangent);
      p += tangent * double(m[0]) + bitangent * double(m[1]);
    }
    points[3 * v] = float(p.x), points[3 * v + 1] = float(p.y), points[3 * v + 2] = float(p.z);
  }
}

void Mover::finish(Triangles& t) {
  const NormalGroups groups(t, int(mesh_.points.size() / 3), mesh_.normals);
  const auto finish_at = [&](std::vector<float>& points, std::vector<float>& normals) {
    const std::vector<float> before = normals_by_vertex(t, points, normals);
    move(t, points, before);
    normals = groups.normals(t, points, before);
  };
  finish_at(mesh_.points, mesh_.normals);
  for (size_t k = 0; k < mesh_.step_points.size(); ++k) finish_at(mesh_.step_points[k], mesh_.step_normals[k]);
  if (groups.is_by_vertex)
    t.normals.clear();
  else
    t.normals = groups.of_corner;
}

}  // namespace primray::subdivision
