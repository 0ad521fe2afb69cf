// Evaluation of masks.hpp.
#include "subdivision/masks.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace primray::subdivision {
namespace {

enum class Rule { kSmooth, kCrease, kCorner };

// DeRose et al. 1998: rule of a vertex by its sharp edges. Darts (one sharp edge) are smooth.
Rule rule_of(float vertex_sharpness, int sharp_edges) {
  if (vertex_sharpness > 0 || sharp_edges > 2) return Rule::kCorner;
  return sharp_edges == 2 ? Rule::kCrease : Rule::kSmooth;
}

void add_rule(VertexMask& m, Rule rule, double weight, Scheme scheme, std::span<const float> sharpness, float above,
              double& crease_weight) {
  if (rule == Rule::kCorner) {
    m.v += weight;
  } else if (rule == Rule::kCrease) {
    m.v += 0.75 * weight, crease_weight = 0.125 * weight;
    for (size_t i = 0; i < sharpness.size() && m.creases < 4; ++i)
      if (sharpness[i] > above) m.crease[m.creases++] = int(i);
  } else if (const double n = double(sharpness.size()); scheme == Scheme::kLoop) {
    const double beta = loop_beta(int(n));
    m.v += weight * (1 - n * beta), m.e += weight * beta;
  } else {
    m.v += weight * (n - 2) / n, m.e += weight / (n * n), m.f += weight / (n * n);
  }
}

template <int N>
struct Rows {
  int width;
  int size() const { return N ? N : width; }

  static void copy(double* to, const double* from, int n) { std::copy(from, from + n, to); }
  void set(double* to, const double* from) const { copy(to, from, size()); }
  void clear(double* to) const { std::fill(to, to + size(), 0.0); }
  void add(double* to, double w, const double* from) const {
    for (int k = 0; k < size(); ++k) to[k] += w * from[k];
  }
  void add(double* to, const double* from) const {
    for (int k = 0; k < size(); ++k) to[k] += from[k];
  }
  void scale(double* to, double w) const {
    for (int k = 0; k < size(); ++k) to[k] *= w;
  }
  void mean(double* to, const double* a, const double* b) const {
    for (int k = 0; k < size(); ++k) to[k] = 0.5 * (a[k] + b[k]);
  }
};

template <int N>
struct Refiner {
  const Topology& t;
  const Split& s;
  Refinement how;
  bool linear;
  const double* in;
  double* out;
  Rows<N> rows;
  Fan fan = {};
  std::vector<double> sum = std::vector<double>(rows.size());

  const double* value(int v) const { return in + size_t(v) * rows.size(); }
  double* made(int v) const { return out + size_t(v) * rows.size(); }

  void face_points() {
    for (int f = 0; f < t.faces(); ++f) {
      if (s.face_point[f] < 0) continue;
      double* p = made(s.face_point[f]);
      rows.clear(p);
      for (int c = t.begin(f), end = c + t.size(f); c < end; ++c) rows.add(p, value(t.vertex[c]));
      rows.scale(p, 1.0 / t.size(f));
    }
  }

  void edge_points() {
    for (int e = 0; e < t.edges(); ++e) {
      if (s.edge_child[e] < 0) continue;
      double* p = made(s.edge_point(e));
      const int c = t.edge_corner[e];
      const double *a = value(t.vertex[c]), *b = value(t.vertex[t.next(c)]);
      rows.mean(p, a, b);
      const float sharpness = t.edge_sharpness[e];
      if (linear || sharpness >= 1 || t.twin[c] < 0) continue;
      if (how.scheme == Scheme::kLoop)
        triangle_edge(p, c, 1 - sharpness);
      else
        quad_edge(p, c, 1 - sharpness);
    }
  }

  // Moves p, the edge's middle, by `weight` towards Loop's 3/8 and 1/8.
  void triangle_edge(double* p, int c, double weight) {
    const double *x = value(t.vertex[t.previous(c)]), *y = value(t.vertex[t.previous(t.twin[c])]);
    for (int k = 0; k < rows.size(); ++k) p[k] += weight * (0.125 * (x[k] + y[k]) - 0.25 * p[k]);
  }

  void quad_edge(double* p, int c, double weight) {
    const int f0 = t.face_of(c), f1 = t.face_of(t.twin[c]);
    if (s.face_point[f0] < 0 || s.face_point[f1] < 0) return;
    const double *x = made(s.face_point[f0]), *y = made(s.face_point[f1]);
    double f = 0.25;
    if (how.smooth_triangles)
      f = 0.5 * ((t.size(f0) == 3 ? kSmoothTriangle : 0.25) + (t.size(f1) == 3 ? kSmoothTriangle : 0.25));
    for (int k = 0; k < rows.size(); ++k) p[k] += weight * f * ((x[k] + y[k]) - 2 * p[k]);
  }

  void vertex_points() {
    for (int v = 0; v < t.vertices(); ++v) {
      if (s.vertex_child[v] < 0) continue;
      double* p = made(s.vertex_child[v]);
      rows.set(p, value(v));
      if (linear || t.vertex_sharpness[v] >= kInfinite) continue;
      if (t.is_sharp[v])
        sharp_vertex(p, v);
      else
        smooth_vertex(p, v);
    }
  }

  // Adds sums of spokes and of face points, as far as the faces around are split; returns whether all of them are.
  bool add_around(double* p, int v, double e, double f, int* valence) {
    int n = 0;
    rows.clear(sum.data());
    double* faces = sum.data();
    const int start = t.outgoing[v];
    for (int c = start;;) {
      rows.add(p, e, value(t.vertex[t.next(c)]));
      if (how.scheme != Scheme::kLoop) {
        const int m = s.face_point[t.face_of(c)];
        if (m < 0) return false;
        rows.add(faces, made(m));
      }
      ++n;
      c = t.counter_clockwise(c);
      if (c < 0) return false;
      if (c == start) break;
    }
    if (f != 0) rows.add(p, f, faces);
    if (valence) *valence = n;
    return true;
  }

  void smooth_vertex(double* p, int v) {
    rows.clear(p);
    int n = 0;
    if (!add_around(p, v, 1, 1, &n) || n < 2) {
      rows.set(p, value(v));
      return;
    }
    if (how.scheme == Scheme::kLoop) {
      const double beta = loop_beta(n);
      rows.scale(p, beta);
      rows.add(p, 1 - n * beta, value(v));
    } else {
      rows.scale(p, 1.0 / (double(n) * n));
      rows.add(p, (n - 2.0) / n, value(v));
    }
  }

  void sharp_vertex(double* p, int v) {
    gather_fan(t, t.outgoing[v], fan);
    const VertexMask m = vertex_mask(how.scheme, fan.closed, t.vertex_sharpness[v], fan.sharpness);
    rows.scale(p, m.v);
    for (int i = 0; i + 1 < m.creases; i += 2) {
      const double *a = value(fan.spokes[m.crease[i]]), *b = value(fan.spokes[m.crease[i + 1]]);
      const double w = i == 0 && m.crease_weight > 0 ? m.crease_weight : m.soft_crease_weight;
      for (int k = 0; k < rows.size(); ++k) p[k] += w * (a[k] + b[k]);
    }
    if ((m.e != 0 || m.f != 0) && !add_around(p, v, m.e, m.f, nullptr)) rows.set(p, value(v));
  }
};

template <int N>
void refine(const Topology& t, const Split& s, Refinement how, bool linear, std::span<const double> values, int width,
            std::span<double> out) {
  Refiner<N> r{t, s, how, linear || how.scheme == Scheme::kBilinear, values.data(), out.data(), {width}};
  if (how.scheme != Scheme::kLoop) r.face_points();
  r.edge_points();
  r.vertex_points();
}

}  // namespace

double loop_beta(int valence) {
  if (valence == 6) return 1.0 / 16;
  const double c = 3.0 / 8 + std::cos(2 * std::numbers::pi / valence) / 4;
  return (5.0 / 8 - c * c) / valence;
}

VertexMask vertex_mask(Scheme scheme, bool closed, float vertex_sharpness, std::span<const float> sharpness) {
  int sharp = 0, still_sharp = 0, changing = 0;
  double change = 0;
  const auto count = [&](float s, int& now, int& later) {
    const bool later_too = child_sharpness(s) > 0;
    now += s > 0, later += later_too;
    if (s > 0 && !later_too) ++changing, change += s;
  };
  for (float s : sharpness) count(s, sharp, still_sharp);
  int unused = 0;
  count(vertex_sharpness, unused, unused);
  Rule now = rule_of(vertex_sharpness, sharp), later = rule_of(child_sharpness(vertex_sharpness), still_sharp);
  if (!closed && now == Rule::kSmooth) now = Rule::kCorner;
  if (!closed && later == Rule::kSmooth) later = Rule::kCorner;
  VertexMask m;
  m.v = 0;
  // DeRose et al. 1998, section 3, as OpenSubdiv interprets it: blends two rules by the mean of the sharpnesses that end.
  const double w = now == later ? 1 : (changing ? std::min(1.0, change / changing) : 0);
  add_rule(m, now, w, scheme, sharpness, 0, m.crease_weight);
  if (w < 1) add_rule(m, later, 1 - w, scheme, sharpness, 1, m.soft_crease_weight);
  return m;
}

void refine_values(const Topology& t, const Split& s, Refinement how, bool linear, std::span<const double> values, int width,
                   std::span<double> out) {
  if (width == 3)
    refine<3>(t, s, how, linear, values, width, out);
  else if (width == 2)
    refine<2>(t, s, how, linear, values, width, out);
  else
    refine<0>(t, s, how, linear, values, width, out);
}

}  // namespace primray::subdivision
