// Triangulation of faces one by one: fans where they serve, ears clipped where not.
#include "polygon/triangulate.hpp"

#include <algorithm>
#include <cmath>

#include "polygon/ear_clip.hpp"

namespace primray {
namespace {

// Corners this close to straight are within the rounding of single-precision points.
constexpr double kStraight = 1e-12;

dvec3 point(const PolygonMesh& mesh, int32_t corner) {
  const float* p = &mesh.points[3 * size_t(mesh.indices[size_t(corner)])];
  return {p[0], p[1], p[2]};
}

// The corners of one face at a time, in arrays that are used again.
class Face {
 public:
  // Reads a face; returns how many of its corners turn against its normal, or not at all.
  int read(const PolygonMesh& mesh, int32_t start, int n) {
    p_.resize(size_t(n)), own_.resize(size_t(n)), bent_.resize(size_t(n));
    for (int i = 0; i < n; ++i) p_[size_t(i)] = point(mesh, start + i);
    for (int i = 0; i < n; ++i) {
      const dvec3 &here = p_[size_t(i)], &before = p_[size_t((i + n - 1) % n)], &after = p_[size_t((i + 1) % n)];
      own_[size_t(i)] = cross(here - before, after - here);
    }
    const dvec3 normal = n == 4 ? own_[1] + own_[3] : newell();
    const double least = kStraight * dot(normal, normal);
    int bends = 0;
    for (size_t i = 0; i < own_.size(); ++i) bends += bent_[i] = dot(own_[i], normal) <= least;
    return bends;
  }

  int first_bend() const { return int(std::find(bent_.begin(), bent_.end(), 1) - bent_.begin()); }
  std::span<const dvec3> points() const { return p_; }

 private:
  dvec3 newell() const {
    dvec3 sum = cross(p_[1] - p_[0], p_[2] - p_[0]);
    for (size_t i = 2; i + 1 < p_.size(); ++i) sum += cross(p_[i] - p_[0], p_[i + 1] - p_[0]);
    return sum;
  }

  std::vector<dvec3> p_, own_;  // places; normals of the corners
  std::vector<uint8_t> bent_;
};

bool has_area(const PolygonMesh& mesh, const int32_t* corners) {
  const dvec3 a = point(mesh, corners[0]);
  const dvec3 n = cross(point(mesh, corners[1]) - a, point(mesh, corners[2]) - a);
  return !(n.x == 0 && n.y == 0 && n.z == 0);
}

void add_fan(int32_t start, int n, int pivot, std::vector<int32_t>& corners) {
  for (int j = 1; j + 1 < n; ++j)
    corners.insert(corners.end(), {start + pivot, start + (pivot + j) % n, start + (pivot + j + 1) % n});
}

// Appends the face's triangles; returns whether a fan from its first corner serves.
bool add_face(const PolygonMesh& mesh, int32_t start, int n, Face& face, std::vector<int32_t>& corners) {
  if (n == 3) {
    add_fan(start, n, 0, corners);
    return true;
  }
  const int bends = face.read(mesh, start, n);
  if (bends == 0) {
    add_fan(start, n, 0, corners);
  } else if (n == 4 && bends == 1) {  // a fan from the one reflex vertex of a quad is correct
    add_fan(start, n, face.first_bend(), corners);
  } else {
    const size_t first = corners.size();
    clip_ears(face.points(), corners);
    for (size_t i = first; i < corners.size(); ++i) corners[i] += start;
  }
  return bends == 0;
}

}  // namespace

bool is_usable(const PolygonMesh& mesh, float largest) {
  const int64_t points = int64_t(mesh.points.size() / 3);
  return std::ranges::all_of(mesh.counts, [](int32_t n) { return n >= 3; }) &&
         std::ranges::all_of(mesh.indices, [&](int32_t i) { return i >= 0 && i < points; }) &&
         std::ranges::all_of(mesh.points, [&](float x) { return std::fabs(x) <= largest; });
}

PolygonTriangles triangulate(const PolygonMesh& mesh) {
  PolygonTriangles made;
  Face face;
  std::vector<int32_t> ends;  // of each kept face among the corners, and the face
  made.corners.reserve(3 * mesh.indices.size()), ends.reserve(2 * mesh.counts.size());
  bool solid = true;  // a convex quad's triangles have the area of two of its corners
  int32_t start = 0;
  for (size_t f = 0; f < mesh.counts.size(); start += mesh.counts[f], ++f) {
    if (!mesh.keep.empty() && !mesh.keep[f]) continue;
    const int n = mesh.counts[f];
    solid &= add_face(mesh, start, n, face, made.corners) && n == 4;
    ends.push_back(int32_t(made.corners.size())), ends.push_back(int32_t(f));
  }
  size_t kept = 0, next = 0;
  for (size_t k = 0; k < ends.size(); k += 2) {
    const size_t before = kept;
    for (; next < size_t(ends[k]); next += 3) {
      const int32_t* corners = &made.corners[next];
      if (!solid && !has_area(mesh, corners)) continue;
      std::copy_n(corners, 3, &made.corners[kept]);
      kept += 3;
      made.faces.push_back(ends[k + 1]);
    }
    made.lost_faces += kept == before;
  }
  made.corners.resize(kept), made.points.resize(kept);
  for (size_t i = 0; i < kept; ++i) made.points[i] = mesh.indices[size_t(made.corners[i])];
  return made;
}

}  // namespace primray
