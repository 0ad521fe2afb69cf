// Limit masks of limit.hpp.
#include "subdivision/limit.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace primray::subdivision {
namespace {

// Refinements of a ring without a closed form (a dart, where one sharp edge ends): its points contract by at least a factor of
// 0.61 per step up to valence 6 (the subdominant eigenvalues of both schemes), and more slowly for higher ones.
constexpr int kDartSteps = 96;
constexpr int kDartNormalSteps = 12;

dvec3 at(std::span<const double> values, int v) {
  const double* p = values.data() + size_t(v) * 3;
  return {p[0], p[1], p[2]};
}

// The unit vector along cross(a, b); zero where they are (almost) parallel or vanish.
dvec3 unit_cross(dvec3 a, dvec3 b) {
  const dvec3 n = cross(a, b);
  const double l = length(n);
  return l > 1e-9 * length(a) * length(b) && l > 0 ? (1 / l) * n : dvec3(0.0);
}

bool is_zero(dvec3 a) { return a.x == 0 && a.y == 0 && a.z == 0; }

dvec3 unit_or_up(dvec3 a) {
  const double l = length(a);
  return l > 0 && std::isfinite(l) ? (1 / l) * a : dvec3(0, 0, 1);
}

// Weight of the spokes against the diagonals in Catmull-Clark's tangents, c = cos of the mode's angle: from the left
// eigenvector for (5 + c + sqrt((9 + c)(1 + c))) / 16 (Halstead et al. 1993, appendix A).
double spoke_weight(double c) { return 1 + c + std::sqrt((9 + c) * (1 + c)); }

}  // namespace

const Limit::Turn& Limit::turn(int n) {
  Turn& t = turns_[n];
  if (t.empty())
    for (int i = 0; i < n; ++i) {
      const double angle = 2 * std::numbers::pi * i / n;
      t.emplace_back(std::cos(angle), std::sin(angle));
    }
  return t;
}

dvec3 Limit::spoke(int i) const { return at(ring_.e, i % ring_.spokes); }
dvec3 Limit::diagonal(int i) const { return at(ring_.f, i % ring_.faces); }

void Limit::load(const Topology& t, int corner, std::span<const double> values, int width) {
  gather_fan(t, corner, fan_);
  ring_.width = width, ring_.spokes = int(fan_.spokes.size()), ring_.faces = int(fan_.corners.size());
  ring_.closed = fan_.closed, ring_.sharpness = fan_.sharpness;
  ring_.vertex_sharpness = t.vertex_sharpness[t.vertex[corner]];
  const auto copy = [&](std::vector<double>& to, int k, int v) {
    std::copy_n(values.data() + size_t(v) * width, width, to.data() + size_t(k) * width);
  };
  ring_.v.resize(width), ring_.e.resize(size_t(ring_.spokes) * width);
  copy(ring_.v, 0, t.vertex[corner]);
  for (int i = 0; i < ring_.spokes; ++i) copy(ring_.e, i, fan_.spokes[i]);
  ring_.f.resize(t.arity == 4 ? size_t(ring_.faces) * width : 0);
  if (t.arity == 4)
    for (int i = 0; i < ring_.faces; ++i) copy(ring_.f, i, t.vertex[fan_.corners[i] ^ 2]);
}

// One step of the scheme on the ring alone, which depends on nothing else.
void Limit::refine() {
  Ring& r = ring_;
  const int w = r.width, n = r.spokes;
  const VertexMask mask = vertex_mask(scheme_, r.closed, r.vertex_sharpness, r.sharpness);
  next_v_.assign(w, 0), next_e_.resize(r.e.size()), next_f_.resize(r.f.size());
  for (int k = 0; k < w; ++k) {
    const auto e = [&](int i) { return r.e[size_t(i < 0 ? i + n : (i < n ? i : i - n)) * w + k]; };
    const double v = r.v[k];
    double edges = 0, faces = 0;
    if (!r.f.empty())
      for (int i = 0; i < r.faces; ++i)
        faces += next_f_[size_t(i) * w + k] = 0.25 * ((v + r.f[size_t(i) * w + k]) + (e(i) + e(i + 1)));
    for (int i = 0; i < n; ++i) {
      edges += e(i);
      double p = 0.5 * (v + e(i));
      const bool inside = r.closed || (i > 0 && i + 1 < n);
      if (inside && r.sharpness[i] < 1) {
        const double soft = 1 - r.sharpness[i];
        if (scheme_ == Scheme::kLoop) {
          p += soft * (0.125 * (e(i - 1) + e(i + 1)) - 0.25 * p);
        } else {
          const size_t before = size_t(i ? i - 1 : r.faces - 1);
          p += soft * 0.25 * ((next_f_[before * w + k] + next_f_[size_t(i) * w + k]) - 2 * p);
        }
      }
      next_e_[size_t(i) * w + k] = p;
    }
    double p = mask.v * v + mask.e * edges + mask.f * faces;
    for (int i = 0; i + 1 < mask.creases; i += 2)
      p += (i == 0 && mask.crease_weight > 0 ? mask.crease_weight : mask.soft_crease_weight) *
           (e(mask.crease[i]) + e(mask.crease[i + 1]));
    next_v_[k] = p;
  }
  std::swap(r.v, next_v_), std::swap(r.e, next_e_), std::swap(r.f, next_f_);
  r.vertex_sharpness = child_sharpness(r.vertex_sharpness);
  for (float& s : r.sharpness) s = child_sharpness(s);
}

bool Limit::is_settled() const {
  const auto ends = [](float s) { return s > 0 && s < kInfinite; };
  return !ends(ring_.vertex_sharpness) && std::none_of(ring_.sharpness.begin(), ring_.sharpness.end(), ends);
}

void Limit::settle() {
  while (!is_settled()) refine();
}

int Limit::infinite_spokes() const {
  return int(std::count_if(ring_.sharpness.begin(), ring_.sharpness.end(), [](float s) { return s > 0; }));
}

void Limit::smooth_position(double* out) const {
  const Ring& r = ring_;
  const double n = r.spokes;
  for (int k = 0; k < r.width; ++k) {
    double e = 0, f = 0;
    for (int i = 0; i < r.spokes; ++i) e += r.e[size_t(i) * r.width + k];
    if (scheme_ == Scheme::kLoop) {
      const double omega = 1 / (n + 3 / (8 * loop_beta(r.spokes)));  // Loop 1987, section 3
      out[k] = (1 - n * omega) * r.v[k] + omega * e;
      continue;
    }
    for (int i = 0; i < r.faces; ++i) f += r.f[size_t(i) * r.width + k];
    out[k] = (n * n * r.v[k] + 4 * e + f) / (n * (n + 5));  // Halstead et al. 1993, section 3
  }
}

void Limit::ring_position(double* out) {
  settle();
  Ring& r = ring_;
  const int sharp = infinite_spokes();
  if (r.vertex_sharpness > 0 || sharp > 2 || (!r.closed && sharp < 2) || r.spokes < 2) {
    std::copy(r.v.begin(), r.v.end(), out);
  } else if (sharp == 2) {
    int end[2], found = 0;
    for (int i = 0; i < r.spokes; ++i)
      if (r.sharpness[i] > 0) end[found++] = i;
    for (int k = 0; k < r.width; ++k)  // the cubic B-spline's 1/6, 4/6, 1/6
      out[k] = (4 * r.v[k] + (r.e[size_t(end[0]) * r.width + k] + r.e[size_t(end[1]) * r.width + k])) / 6;
  } else if (sharp == 1) {
    for (int i = 0; i < kDartSteps; ++i) refine();
    std::copy(r.v.begin(), r.v.end(), out);
  } else {
    smooth_position(out);
  }
}

void Limit::position(const Topology& t, int v, std::span<const double> values, int width, double* out) {
  if (t.vertex_sharpness[v] >= kInfinite) {
    std::copy_n(values.data() + size_t(v) * width, width, out);
    return;
  }
  load(t, t.outgoing[v], values, width);
  if (t.is_sharp[v])
    ring_position(out);
  else if (ring_.closed && ring_.spokes > 1)
    smooth_position(out);
  else
    std::copy(ring_.v.begin(), ring_.v.end(), out);
}

// Spokes and the sums of adjacent ones for the faces between, by cos and sin: the tangents of Halstead et al. 1993 and Loop
// 1987.
dvec3 Limit::smooth_ring_normal() {
  const int n = ring_.spokes;
  const Turn& angle = turn(n);
  const double a = n > 1 ? spoke_weight(angle[1 % n].first) : 1;
  dvec3 t0(0.0), t1(0.0);
  for (int i = 0; i < n; ++i) {
    const auto [c, s] = angle[i];
    const dvec3 e = spoke(i);
    if (scheme_ == Scheme::kLoop) {
      t0 = t0 + c * e, t1 = t1 + s * e;
    } else {
      const auto [c1, s1] = angle[i + 1 < n ? i + 1 : 0];
      const dvec3 f = diagonal(i);
      t0 = t0 + (a * c) * e + (c + c1) * f, t1 = t1 + (a * s) * e + (s + s1) * f;
    }
  }
  const dvec3 normal = unit_cross(t0, t1);
  return is_zero(normal) ? unit_or_up(area_normal(0, n)) : normal;
}

dvec3 Limit::area_normal(int first, int faces) const {
  const dvec3 v = at(ring_.v, 0);
  dvec3 sum(0.0);
  for (int i = first; i < first + faces; ++i) {
    const dvec3 a = spoke(i) - v, b = spoke(i + 1) - v;
    if (ring_.f.empty()) {
      sum = sum + cross(a, b);
    } else {
      const dvec3 d = diagonal(i) - v;
      sum = sum + cross(a, d) + cross(d, b);
    }
  }
  return sum;
}

// Normal of the faces between two infinitely sharp spokes.
//
// A crease's first tangent runs along it. The second is the left eigenvector of the fan's matrix for the mode in which spokes
// move by sin(i theta), theta = pi / faces: with lambda its eigenvalue, weights sin(i theta) for Loop's spokes, those of smooth
// vertices for Catmull-Clark's, and for the vertex and the ends the solution of the remaining columns of the matrix. For
// regular boundaries these are the tangents of the box spline and of the B-spline.
// Where a corner has several faces its limit has in general no tangent plane (Biermann, Levin and Zorin 2000, section 3):
// there, the mean of its faces' normals by area.
dvec3 Limit::sector_normal(int first, int faces, bool is_corner) const {
  const dvec3 v = at(ring_.v, 0), e0 = spoke(first), e1 = spoke(first + faces);
  dvec3 normal(0.0);
  if (is_corner) {
    if (faces == 1) normal = unit_cross(e0 - v, e1 - v);
  } else if (faces == 1) {
    normal = unit_cross(e0 - e1, (e0 - v) + (e1 - v));
  } else {
    const double theta = std::numbers::pi / faces, c = std::cos(theta), half_cot = 1 / std::tan(theta / 2);
    dvec3 t(0.0);
    double wv, we;
    if (scheme_ == Scheme::kLoop) {
      const double lambda = 3.0 / 8 + c / 4;
      // (lambda - 1/2) we = sin/8 + wv/8 and (lambda - 3/4) wv = we + 3/8 sum of sin(i theta), which is half_cot.
      const double determinant = (lambda - 0.5) * (lambda - 0.75) - 0.125;
      wv = (std::sin(theta) / 8 + (lambda - 0.5) * 3 / 8 * half_cot) / determinant;
      we = (lambda - 0.75) * wv - 3.0 / 8 * half_cot;
      for (int i = 1; i < faces; ++i) t = t + std::sin(i * theta) * (spoke(first + i) - v);
    } else {
      const double a = spoke_weight(c), lambda = (a + 4) / 16;
      // (lambda - 1/2) we = wv/8 + (a/16 + 1/4) sin and (lambda - 3/4) wv = we + (3a/8 + 1/2) half_cot.
      const double determinant = (lambda - 0.5) * (lambda - 0.75) - 0.125, b = 3 * a / 8 + 0.5;
      wv = ((a / 16 + 0.25) * std::sin(theta) + (lambda - 0.5) * b * half_cot) / determinant;
      we = (lambda - 0.75) * wv - b * half_cot;
      for (int i = 1; i < faces; ++i) t = t + (a * std::sin(i * theta)) * (spoke(first + i) - v);
      for (int i = 0; i < faces; ++i) t = t + (std::sin(i * theta) + std::sin((i + 1) * theta)) * (diagonal(first + i) - v);
    }
    // All weights sum to 0, so that differences to v need no weight of it.
    t = t + we * ((e0 - v) + (e1 - v));
    normal = unit_cross(e0 - e1, t);
  }
  return is_zero(normal) ? unit_or_up(area_normal(first, faces)) : normal;
}

dvec3 Limit::smooth_point(const Topology& t, int v, std::span<const double> positions, double* out) {
  load(t, t.outgoing[v], positions, 3);
  if (!ring_.closed || ring_.spokes < 2) {
    std::copy(ring_.v.begin(), ring_.v.end(), out);
    return unit_or_up(area_normal(0, ring_.faces));
  }
  smooth_position(out);
  return smooth_ring_normal();
}

void Limit::normals(const Topology& t, int corner, std::span<const double> positions, FanNormals& out) {
  load(t, corner, positions, 3);
  settle();
  out.normals.clear(), out.of_corner.assign(ring_.faces, 0);
  const int sharp = infinite_spokes();
  const bool is_corner = ring_.vertex_sharpness > 0 || sharp > 2;
  if (sharp == 0 || (sharp == 1 && !is_corner) || (!ring_.closed && sharp < 2)) {
    for (int i = 0; sharp == 1 && i < kDartNormalSteps; ++i) refine();
    const bool smooth = ring_.closed && sharp == 0 && !is_corner;
    out.normals.push_back(smooth ? smooth_ring_normal() : unit_or_up(area_normal(0, ring_.faces)));
    return;
  }
  int start = 0;
  while (ring_.closed && !(ring_.sharpness[start] > 0)) ++start;
  for (int i = start; i < start + ring_.faces;) {
    int end = i + 1;
    while (end < start + ring_.faces && !(ring_.sharpness[end % ring_.spokes] > 0)) ++end;
    for (int k = i; k < end; ++k) out.of_corner[k % ring_.faces] = int32_t(out.normals.size());
    out.normals.push_back(sector_normal(i, end - i, is_corner));
    i = end;
  }
}

}  // namespace primray::subdivision
