// Log of the samples of one pixel, for `primray render --debug-pixel`: what happens at each vertex of their paths, as events
// with named values. The integrator is the one of any render.
//
// Only the path loop for one lane records. For more lanes path_log() is a constant null pointer, so that no code of theirs
// remains.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "integrator/tile_task.hpp"

namespace primray {

struct PathLog {
  struct Value {
    const char* name;
    int width;  // 1 or 3
    double v[3];
  };
  struct Event {
    const char* kind;
    int sample;     // number in the log
    uint32_t part;  // index in the sample sequence, by which the parts of a split path are distinguished
    int vertex, depth;
    const char* why = "";
    std::vector<Value> values;

    Event& put(const char* name, double x) { return values.push_back({name, 1, {x, 0, 0}}), *this; }
    Event& put(const char* name, const dvec3& a) { return values.push_back({name, 3, {a.x, a.y, a.z}}), *this; }
    template <int W>
    Event& put(const char* name, vfloat<W> a) {
      return put(name, double(a[0]));
    }
    template <int W>
    Event& put(const char* name, vint<W> a) {
      return put(name, double(a[0]));
    }
    template <int W>
    Event& put(const char* name, const vvec3<W>& a) {
      return put(name, dvec3{double(a.x[0]), double(a.y[0]), double(a.z[0])});
    }
    template <int W>
    Event& put(const char* name, vbool<W> m) {
      return put(name, m[0] ? 1.0 : 0.0);
    }
  };

  // world = origin + p / scale, in scene units.
  dvec3 origin{0.0, 0.0, 0.0};
  double scale = 1;
  std::vector<Event> events;
  int first_sample = 0;                          // number of the block's first sample
  std::vector<size_t> shadows, special_shadows;  // events of the queued shadow rays
  size_t cause = 0;                              // event of the next contribution

  template <int W>
  dvec3 point(const vvec3<W>& p) const {
    return origin + dvec3{double(p.x[0]), double(p.y[0]), double(p.z[0])} * (1 / scale);
  }
  template <int W>
  double length(vfloat<W> t) const {
    return double(t[0]) / scale;
  }

  Event& add(const char* kind, int slot, uint32_t part, int vertex, int depth) {
    cause = events.size();
    return events.emplace_back(Event{kind, first_sample + slot % Worker::kSlots, part, vertex, depth, "", {}});
  }
  template <int W>
  Event& add(const char* kind, const PathLanes<W>& p) {
    return add(kind, p.slot[0], reverse_bits(p.sampler.reversed_index)[0], p.vertex[0], p.depth[0]);
  }
  template <int W>
  void end(const PathLanes<W>& p, const char* why) {
    add("end", p).why = why;
  }
  // Ends a path, unless the last event says so.
  template <int W>
  void end_if_open(const PathLanes<W>& p, const char* why) {
    const std::string last = events.back().kind;
    if (last != "end" && last != "roulette") end(p, why);
  }
  // Notes that the last event sends a shadow ray.
  void queue(bool special = false) { (special ? special_shadows : shadows).push_back(events.size() - 1); }
  // Notes what arrives of the shadow ray at `at` of a queue, whose contribution follows.
  template <int W>
  void arrive(const std::vector<size_t>& queue, int at, const vvec3<W>& visible) {
    cause = queue[size_t(at)];
    events[cause].put("visible", visible);
  }
  void contribute(float r, float g, float b) { events[cause].put("contribution", dvec3{double(r), double(g), double(b)}); }
  void clear_queues() { shadows.clear(), special_shadows.clear(); }
};

}  // namespace primray
