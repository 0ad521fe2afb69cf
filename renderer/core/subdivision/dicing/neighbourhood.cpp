// Construction of neighbourhood.hpp.
#include "subdivision/dicing/neighbourhood.hpp"

#include <algorithm>

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

}  // namespace primray::subdivision
