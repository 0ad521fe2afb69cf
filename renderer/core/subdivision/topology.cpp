// Fans of topology.hpp.
#include "subdivision/topology.hpp"

namespace primray::subdivision {

void finish_topology(Topology& t, int vertices) {
  t.outgoing.assign(vertices, -1);
  for (int c = 0; c < t.corners(); ++c) {
    int32_t& o = t.outgoing[t.vertex[c]];
    if (o < 0 || t.twin[c] < 0) o = c;
  }
  t.is_sharp.assign(vertices, 0);
  for (int v = 0; v < vertices; ++v) t.is_sharp[v] = t.vertex_sharpness[v] > 0;
  for (int e = 0; e < t.edges(); ++e) {
    if (!(t.edge_sharpness[e] > 0)) continue;
    const int c = t.edge_corner[e];
    t.is_sharp[t.vertex[c]] = t.is_sharp[t.vertex[t.next(c)]] = 1;
  }
}

void gather_fan(const Topology& t, int corner, Fan& fan) {
  fan.corners.clear(), fan.spokes.clear(), fan.sharpness.clear();
  int start = corner;
  for (int c = t.clockwise(start); c >= 0 && c != corner; c = t.clockwise(c)) start = c;
  fan.closed = t.twin[start] >= 0;
  if (fan.closed) start = corner;
  int last = start;
  for (int c = start; c >= 0; c = t.counter_clockwise(c)) {
    if (c == start && !fan.corners.empty()) break;
    fan.corners.push_back(c);
    fan.spokes.push_back(t.vertex[t.next(c)]);
    fan.sharpness.push_back(t.edge_sharpness[t.edge[c]]);
    last = c;
  }
  if (fan.closed) return;
  const int p = t.previous(last);
  fan.spokes.push_back(t.vertex[p]);
  fan.sharpness.push_back(t.edge_sharpness[t.edge[p]]);
}

}  // namespace primray::subdivision
