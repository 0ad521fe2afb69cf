// Extents of parts, one thread a part: the bounds of a part do not depend on the order; and their surfaces.
#include "aov/extents.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <thread>

namespace primray {

namespace {

constexpr int kOutlinePoints = 256;  // of a sphere: its box is 0.00008 of a radius too small at most
constexpr int kCurvePoints = 9;      // along a segment of a curve
constexpr int kDiscPoints = 32;      // of a disc across it
constexpr int kMostEdgePoints = 32;  // on a bent edge
constexpr double kEdgePixels = 8;    // between two of them
constexpr int kRounds = 5;           // of finding the time at which a point is seen
constexpr double kPi = 3.14159265358979323846;

int32_t group_of_triangle(const Scene& scene, uint32_t triangle) {
  int32_t found = 0;
  for (size_t g = 0; g < scene.groups.size(); ++g)
    if (triangle - scene.groups[g].triangle_base < scene.groups[g].all_triangles()) found = int32_t(g);
  return found;
}

// Triangles and vertices of a row of the MeshTable; vertices are indices within the group.
struct MeshRow {
  int32_t group = 0;
  std::vector<uint32_t> triangles, vertices;
};

std::map<int32_t, MeshRow> mesh_rows(const Scene& scene, const std::vector<ScenePart>& parts) {
  std::map<int32_t, MeshRow> rows;
  for (const ScenePart& part : parts)
    if (part.shape >= 0) rows[part.shape];
  if (rows.empty()) return rows;
  std::vector<MeshRow*> wanted(scene.meshes.surface.size());
  for (auto& [row, own] : rows) wanted[size_t(row)] = &own;
  for (uint32_t t = 0; t < scene.triangle_mesh.size(); ++t)
    if (MeshRow* row = wanted[size_t(scene.triangle_mesh[t])]) row->triangles.push_back(t);
  for (auto& [number, row] : rows) {
    if (row.triangles.empty()) continue;
    row.group = group_of_triangle(scene, row.triangles[0]);
    for (const uint32_t t : row.triangles)
      row.vertices.insert(row.vertices.end(), &scene.indices[3 * t], &scene.indices[3 * t] + 3);
    std::sort(row.vertices.begin(), row.vertices.end());
    row.vertices.erase(std::unique(row.vertices.begin(), row.vertices.end()), row.vertices.end());
  }
  return rows;
}

// Segments of curves, with their groups, by row.
using CurveSegments = std::map<int32_t, std::vector<std::pair<int32_t, size_t>>>;

CurveSegments curve_segments(const Scene& scene) {
  CurveSegments segments;
  for (size_t g = 0; g < scene.groups.size(); ++g)
    for (const CurveRange* range : {&scene.groups[g].curves.still, &scene.groups[g].curves.moving})
      for (uint32_t i = 0; i < range->segments; ++i) {
        const size_t segment = range->segment + i;
        segments[scene.curves.row[size_t(scene.curves.run[segment])]].emplace_back(int32_t(g), segment);
      }
  return segments;
}

// Measures one part.
class PartMeasure {
 public:
  PartMeasure(const Scene& scene, const ScenePart& part, const daffine& axes)
      : scene_(scene),
        part_(part),
        axes_(axes),
        frame_(scene.motion.frame),
        camera_(camera_at(frame_)),
        moves_(scene.moves()),
        rolls_(moves_ && scene.motion.rolls),
        world_from_group_(matrix(frame_)) {}

  void mesh(const MeshRow& row) {
    const Group& group = scene_.groups[size_t(row.group)];
    const auto at = [&](uint32_t v, float time) { return vertex(group, v, time); };
    const auto place = [&](uint32_t v) { return [&, v](float time) { return at(v, time); }; };
    std::vector<Seen> seen;
    for (const uint32_t v : row.vertices) {
      bound_in_axes(at(v, frame_));
      seen.push_back(see(place(v)));
      add(seen.back());
    }
    const bool bends = camera_.distortion || rolls_;
    if (!bends && std::all_of(seen.begin(), seen.end(), [](const Seen& s) { return s.is; })) return;
    const auto seen_at = [&](uint32_t v) -> const Seen& {
      return seen[size_t(std::lower_bound(row.vertices.begin(), row.vertices.end(), v) - row.vertices.begin())];
    };
    for (const uint32_t t : row.triangles)
      for (int k = 0; k < 3; ++k) {
        const uint32_t a = scene_.indices[3 * t + uint32_t(k)], b = scene_.indices[3 * t + uint32_t((k + 1) % 3)];
        const auto between = [&](double s) { return [&, s](float time) { return at(a, time) * (1 - s) + at(b, time) * s; }; };
        const Seen &from = seen_at(a), &to = seen_at(b);
        if (bends && from.is && to.is) {
          const double length = std::hypot(to.x - from.x, to.y - from.y);
          const int count = int(std::min(std::ceil(length / kEdgePixels), double(kMostEdgePoints)));
          for (int i = 1; i < count; ++i) add(see(between(double(i) / count)));
        } else if (!camera_.distortion && from.is != to.is) {
          const double da = depth_of(camera_, at(a, frame_)), db = depth_of(camera_, at(b, frame_));
          add(see_cut(between((near() * (1 + 1e-9) - da) / (db - da))));
        }
      }
  }

  // A unit ball in a space of its own.
  void ball(const daffine& group_from_ball) {
    constexpr int count = kOutlinePoints;
    const daffine m = world_from_group_ * group_from_ball;
    const auto half = [&](const daffine& to) {
      return dvec3{std::hypot(to.x.x, to.y.x, to.z.x), std::hypot(to.x.y, to.y.y, to.z.y), std::hypot(to.x.z, to.y.z, to.z.z)};
    };
    const daffine own = axes_ * world_of(m);
    const dvec3 r = half(own);
    bound(own.o - r), bound(own.o + r);
    if (!is_regular(m)) return;
    // Its outline from the camera is a circle of the ball's own space.
    const Affine<float>& c = camera_.world_from_camera;
    const daffine to_ball = inverse(m);
    const dvec3 eye = to_ball.point(dvec3(c.o)), along = to_ball.vector(dvec3(c.z));
    const dvec3 towards = camera_.orthographic ? along : eye;
    const double far = std::sqrt(dot(towards, towards));
    const dvec3 z(c.z);
    const double radius = std::hypot(dot(m.x, z), dot(m.y, z), dot(m.z, z)), middle = depth_of(camera_, m.o);
    if (middle + radius > 0) extent_.nearest = std::min(extent_.nearest, std::max(middle - radius, 0.0) / scene_.scale);
    bool whole = far > (camera_.orthographic ? 0.0 : 1.0);
    if (whole) {
      const dvec3 n = towards * (1 / far);
      const double offset = camera_.orthographic ? 0.0 : 1 / far, circle = std::sqrt(1 - offset * offset);
      const dvec3 any = std::abs(n.x) < 0.6 ? dvec3{1, 0, 0} : dvec3{0, 1, 0};
      dvec3 s = cross(n, any);
      s = s * (1 / std::sqrt(dot(s, s)));
      const dvec3 t = cross(n, s);
      for (int i = 0; i < count; ++i) {
        const double phi = 2 * kPi * i / count;
        whole &= add_of_ball(group_from_ball, n * offset + (s * std::cos(phi) + t * std::sin(phi)) * circle);
      }
    }
    if (whole) return;
    for (int i = 0; i < count; ++i)
      for (int k = 0; k <= count / 2; ++k) {
        const double phi = 2 * kPi * i / count, theta = 2 * kPi * k / count;
        add_of_ball(group_from_ball, {std::sin(theta) * std::cos(phi), std::cos(theta), std::sin(theta) * std::sin(phi)});
      }
  }

  void curve(const Group& group, size_t segment) {
    for_rings(group, segment, kDiscPoints, [&](const dvec3& at) {
      bound_in_axes(world_from_group_.point(at));
      add(see([&](float time) { return (time == frame_ ? world_from_group_ : matrix(time)).point(at); }));
    });
  }

  void mesh_surface(const MeshRow& row, PartSurface& to) const {
    const Group& group = scene_.groups[size_t(row.group)];
    const uint32_t first = uint32_t(to.points.size());
    for (const uint32_t v : row.vertices) to.points.push_back(world_point(vertex(group, v, frame_)));
    const auto number = [&](uint32_t v) {
      return first + uint32_t(std::lower_bound(row.vertices.begin(), row.vertices.end(), v) - row.vertices.begin());
    };
    for (const uint32_t t : row.triangles) {
      const uint32_t* v = &scene_.indices[3 * t];
      add_triangle(to, number(v[0]), number(v[1]), number(v[2]));
    }
  }

  void ball_surface(const daffine& group_from_ball, PartSurface& to) const {
    constexpr uint32_t rings = PartSurface::kSphereRings, around = 2 * rings;
    const uint32_t first = uint32_t(to.points.size());
    const auto put = [&](const dvec3& p) {
      to.points.push_back(world_point(world_from_group_.point(group_from_ball.point(p))));
    };
    put({0, -1, 0}), put({0, 1, 0});
    for (uint32_t k = 1; k < rings; ++k)
      for (uint32_t i = 0; i < around; ++i) {
        const double phi = 2 * kPi * i / around, theta = kPi * k / rings;
        put({std::sin(theta) * std::cos(phi), -std::cos(theta), std::sin(theta) * std::sin(phi)});
      }
    const auto at = [&](uint32_t k, uint32_t i) {
      return k == 0 ? first : k == rings ? first + 1 : first + 2 + (k - 1) * around + i % around;
    };
    for (uint32_t k = 0; k < rings; ++k)
      for (uint32_t i = 0; i < around; ++i) {
        if (k > 0) add_triangle(to, at(k, i), at(k + 1, i), at(k, i + 1));
        if (k + 1 < rings) add_triangle(to, at(k, i + 1), at(k + 1, i), at(k + 1, i + 1));
      }
  }

  void curve_surface(const Group& group, size_t segment, PartSurface& to) const {
    constexpr uint32_t sides = PartSurface::kTubeSides;
    const uint32_t first = uint32_t(to.points.size());
    for_rings(group, segment, sides, [&](const dvec3& p) { to.points.push_back(world_point(world_from_group_.point(p))); });
    for (uint32_t k = 0; k + 1 < kCurvePoints; ++k)
      for (uint32_t i = 0; i < sides; ++i) {
        const uint32_t a = first + k * sides + i, b = first + k * sides + (i + 1) % sides;
        add_triangle(to, a, b, a + sides), add_triangle(to, b, b + sides, a + sides);
      }
  }

  ProjectedPoint point(const dvec3& world) const {
    const dvec3 p = (world - scene_.origin) * scene_.scale;
    const Seen seen = see([&](float) { return p; });
    return {seen.is, seen.x, seen.y, depth_of(camera_, p) / scene_.scale};
  }

  const Extent& extent() const { return extent_; }

 private:
  struct Seen {
    bool is;
    double x, y;
  };

  Camera camera_at(float time) const { return scene_.camera.moves ? scene_.camera.at(time) : scene_.camera; }

  // Matrix from the part's group to the core's world at a time.
  daffine matrix(float time) const {
    const auto of = [&](int32_t row) {
      if (const MovingInstances* in = scene_.motion.find(row)) return scene_.motion.at(*in, uint32_t(row - in->first), time);
      return affine_from_columns(&scene_.world_from_group[12 * size_t(row)]);
    };
    if (part_.instance < 0) return {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, dvec3(0.0)};
    return part_.outer < 0 ? of(part_.instance) : of(part_.outer) * of(part_.instance);
  }
  daffine world_of(const daffine& m) const {
    const double unit = 1 / scene_.scale;
    return {m.x * unit, m.y * unit, m.z * unit, scene_.origin + m.o * unit};
  }

  // Position of a vertex, given by its index in the group, in the core's world at a time.
  dvec3 vertex(const Group& group, uint32_t v, float time) const {
    const auto read = [&](size_t at) {
      const float* p = &scene_.positions[3 * (size_t(group.vertex_base) + at)];
      return dvec3{p[0], p[1], p[2]};
    };
    dvec3 p;
    if (group.moving_vertex_count > 0 && v >= group.vertex_count - group.moving_vertex_count) {
      const Moment now = scene_.motion.clocks[size_t(group.clock)].at(time);
      const size_t a = v + size_t(now.segment) * group.moving_vertex_count;
      p = read(a) * (1.0 - now.within) + read(a + group.moving_vertex_count) * double(now.within);
    } else {
      p = read(v);
    }
    return (time == frame_ ? world_from_group_ : matrix(time)).point(p);
  }
  void control_point(const Group& group, uint32_t at, dvec3& p, double& r) const {
    const CurveGroup& g = group.curves;
    const auto read = [&](size_t i, double (&to)[4]) {
      for (int k = 0; k < 4; ++k) to[k] = scene_.curves.points[4 * (size_t(g.point_base) + i) + size_t(k)];
    };
    double a[4], b[4];
    read(at, a);
    if (g.moving_points > 0 && at >= g.point_count - g.moving_points) {
      const Moment now = scene_.motion.clocks[size_t(group.clock)].at(frame_);
      const size_t first = at + size_t(now.segment) * g.moving_points;
      read(first, a), read(first + g.moving_points, b);
      for (int k = 0; k < 4; ++k) a[k] += (b[k] - a[k]) * double(now.within);
    }
    p = {a[0], a[1], a[2]}, r = a[3];
  }

  double depth_of(const Camera& camera, const dvec3& p) const {
    const Affine<float>& c = camera.world_from_camera;
    return -dot(p - dvec3(c.o), dvec3(c.z));
  }
  double near() const { return std::max(double(camera_.near), 1e-6); }

  void bound(const dvec3& p) {
    dvec3 &low = extent_.low, &high = extent_.high;
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  void bound_in_axes(const dvec3& p) {
    bound(axes_.point(scene_.origin + p * (1 / scene_.scale)));
    const double depth = depth_of(camera_, p);
    if (depth > 0) extent_.nearest = std::min(extent_.nearest, depth / scene_.scale);
  }

  bool add_of_ball(const daffine& group_from_ball, const dvec3& p) {
    const dvec3 at = group_from_ball.point(p);
    const Seen seen = see([&](float time) { return (time == frame_ ? world_from_group_ : matrix(time)).point(at); });
    add(seen);
    return seen.is;
  }
  void add(const Seen& seen) {
    extent_.unseen += !seen.is;
    if (!seen.is) return;
    double (&f)[4] = extent_.film;
    f[0] = std::min(f[0], seen.x), f[1] = std::min(f[1], seen.y), f[2] = std::max(f[2], seen.x), f[3] = std::max(f[3], seen.y);
  }

  // Calls f(point) for the points of discs across a tube, in the part's group, one disc after the other.
  template <class F>
  void for_rings(const Group& group, size_t segment, int sides, const F& f) const {
    const CurveTable& curves = scene_.curves;
    dvec3 p[4];
    double r[4];
    for (int k = 0; k < 4; ++k) control_point(group, uint32_t(curves.first_point[segment]) + uint32_t(k), p[k], r[k]);
    for (int i = 0; i < kCurvePoints; ++i) {
      const double t = double(i) / (kCurvePoints - 1), s = 1 - t;
      const double w[4] = {s * s * s, 3 * s * s * t, 3 * s * t * t, t * t * t};
      dvec3 at(0.0);
      double radius = 0;
      for (int k = 0; k < 4; ++k) at = at + p[k] * w[k], radius += r[k] * w[k];
      const dvec3 tangent = (p[1] - p[0]) * (s * s) + (p[2] - p[1]) * (2 * s * t) + (p[3] - p[2]) * (t * t);
      for_disc(at, tangent, radius, sides, f);
    }
  }
  template <class F>
  void for_disc(const dvec3& middle, const dvec3& tangent, double radius, int sides, const F& f) const {
    const double length = std::sqrt(dot(tangent, tangent));
    const dvec3 n = length > 0 ? tangent * (1 / length) : dvec3{0, 0, 1};
    const dvec3 any = std::abs(n.x) < 0.6 ? dvec3{1, 0, 0} : dvec3{0, 1, 0};
    dvec3 u = cross(n, any);
    u = u * (1 / std::sqrt(dot(u, u)));
    const dvec3 v = cross(n, u);
    for (int i = 0; i < sides; ++i) {
      const double phi = 2 * kPi * i / sides;
      f(middle + (u * std::cos(phi) + v * std::sin(phi)) * radius);
    }
  }

  dvec3 world_point(const dvec3& p) const { return scene_.origin + p * (1 / scene_.scale); }
  // Adds a triangle that is counterclockwise from outside in the part's group.
  void add_triangle(PartSurface& to, uint32_t a, uint32_t b, uint32_t c) const {
    const daffine& m = world_from_group_;
    if (dot(m.x, cross(m.y, m.z)) < 0) std::swap(b, c);
    to.corners.insert(to.corners.end(), {a, b, c});
  }

  // Where the camera sees what is at place(time): with a rolling shutter at the time of the row and column that it is seen in.
  template <class Place>
  Seen see(const Place& place) const {
    double at[2];
    if (!rolls_) return project(camera_, place(frame_), at);
    float time = rolled(0.5 * camera_.width, 0.5 * camera_.height);
    Seen seen{};
    for (int i = 0; i < kRounds; ++i) {
      seen = project(camera_at(time), place(time), at);
      if (!seen.is) return seen;
      time = rolled(seen.x, seen.y);
    }
    return seen;
  }
  // A point on the near plane at the frame's time.
  template <class Place>
  Seen see_cut(const Place& place) const {
    double at[2] = {0.5 * camera_.width, 0.5 * camera_.height};
    if (!camera_.project(place(frame_), at)) return {};
    return {true, at[0], at[1]};
  }
  Seen project(const Camera& camera, const dvec3& p, double (&at)[2]) const {
    at[0] = 0.5 * camera.width, at[1] = 0.5 * camera.height;
    if (!camera.distortion && !camera.orthographic && !(depth_of(camera, p) >= near())) return {};
    if (!camera.project(p, at)) return {};
    return {true, at[0], at[1]};
  }
  float rolled(double x, double y) const {
    const MotionTable& m = scene_.motion;
    const double column = std::clamp(std::floor(x), 0.0, double(camera_.width - 1));
    const double row = std::clamp(std::floor(y), 0.0, double(camera_.height - 1));
    return std::clamp(float(m.opens + 0.5 * m.length + column * m.per_column + row * m.per_row), 0.0f, 1.0f);
  }

  const Scene& scene_;
  const ScenePart part_;
  const daffine axes_;
  const float frame_;
  const Camera camera_;
  const bool moves_, rolls_;
  const daffine world_from_group_;
  Extent extent_;
};

}  // namespace

std::vector<std::pair<int32_t, int32_t>> shapes_of_groups(const Scene& scene) {
  std::vector<std::pair<int32_t, int32_t>> found;
  for (size_t g = 0; g < scene.groups.size(); ++g) {
    const Group& group = scene.groups[g];
    const size_t first = found.size();
    for (uint32_t t = 0; t < group.all_triangles(); ++t) {
      const int32_t row = scene.triangle_mesh[group.triangle_base + t];
      if (found.size() == first || found.back().second != row) found.emplace_back(int32_t(g), row);
    }
    for (const CurvedRange& range : group.curved.all)
      for (uint32_t i = 0; i < range.count; ++i) found.emplace_back(int32_t(g), -2 - int32_t(range.first_row + i));
    for (const CurveRange* range : {&group.curves.still, &group.curves.moving})
      for (uint32_t i = 0; i < range->segments; ++i) {
        const int32_t row = scene.curves.row[size_t(scene.curves.run[range->segment + i])];
        if (found.size() == first || found.back().second != -2 - row) found.emplace_back(int32_t(g), -2 - row);
      }
    std::sort(found.begin() + ptrdiff_t(first), found.end());
    found.erase(std::unique(found.begin() + ptrdiff_t(first), found.end()), found.end());
  }
  return found;
}

std::vector<Extent> find_extents(const Scene& scene, int threads, const std::vector<ScenePart>& parts,
                                 const std::vector<daffine>& axes) {
  const std::map<int32_t, MeshRow> rows = mesh_rows(scene, parts);
  const CurveSegments segments = curve_segments(scene);
  std::vector<Extent> found(parts.size());
  std::atomic<size_t> next{0};
  const auto work = [&] {
    for (size_t i; (i = next++) < parts.size();) {
      PartMeasure measure(scene, parts[i], axes[size_t(parts[i].axes)]);
      if (parts[i].shape >= 0) {
        measure.mesh(rows.at(parts[i].shape));
      } else {
        const int32_t row = -2 - parts[i].shape;
        if (const auto of = segments.find(row); of != segments.end())
          for (const auto& [g, segment] : of->second) measure.curve(scene.groups[size_t(g)], segment);
        for (const Group& group : scene.groups)
          for_curved_kinds([&]<class K>(K) {
            const CurvedRange& range = group.curved.of<K>();
            if (range.has_row(row)) measure.ball(scene.curved.records<K>()[range.record_of(row)].to_group());
          });
      }
      found[i] = measure.extent();
    }
  };
  std::vector<std::thread> pool;
  for (size_t i = 0; i < std::min(parts.size(), size_t(std::max(threads, 1))); ++i) pool.emplace_back(work);
  for (std::thread& t : pool) t.join();
  return found;
}

PartSurface find_surface(const Scene& scene, const ScenePart& part) {
  const PartMeasure measure(scene, part, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, dvec3(0.0)});
  PartSurface found;
  if (part.shape >= 0) {
    measure.mesh_surface(mesh_rows(scene, {part}).at(part.shape), found);
    return found;
  }
  const int32_t row = -2 - part.shape;
  const CurveSegments segments = curve_segments(scene);
  if (const auto of = segments.find(row); of != segments.end())
    for (const auto& [g, segment] : of->second) measure.curve_surface(scene.groups[size_t(g)], segment, found);
  for (const Group& group : scene.groups)
    for_curved_kinds([&]<class K>(K) {
      const CurvedRange& range = group.curved.of<K>();
      if (range.has_row(row)) measure.ball_surface(scene.curved.records<K>()[range.record_of(row)].to_group(), found);
    });
  return found;
}

std::vector<ProjectedPoint> project_points(const Scene& scene, const std::vector<dvec3>& world) {
  const PartMeasure measure(scene, {-1, -1, -1, 0}, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, dvec3(0.0)});
  std::vector<ProjectedPoint> found;
  for (const dvec3& p : world) found.push_back(measure.point(p));
  return found;
}

}  // namespace primray
