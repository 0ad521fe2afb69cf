// Light path expressions as one automaton over what happens to a path: made by renderer/primray/light_paths, read by path/.
//
// A path is in one of up to 256 states, which each scattering takes on to the next. Where it ends at a light, state and light
// give its class: the set of expressions that it matches.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace primray {

// How a path goes on from a vertex: reflected or transmitted, by a lobe that is diffuse, glossy or singular; straight through;
// by a medium.
enum RouteEvent : int32_t {
  kReflectedDiffuse,
  kReflectedGlossy,
  kReflectedSingular,
  kTransmittedDiffuse,
  kTransmittedGlossy,
  kTransmittedSingular,
  kStraight,
  kVolume,
  kRouteEvents
};
// Where it ends: at a light, at a dome, which is a light and the background, or at a surface that glows by itself.
enum RouteEnd : int32_t { kEndLight, kEndDome, kEndObject, kRouteEnds };

// A number for where it ends, with the light's group; 0 is none.
constexpr int32_t end_number(int32_t group, RouteEnd kind) { return group * kRouteEnds + kind; }

struct RouteTables {
  static constexpr int kMostStates = 256, kMostExpressions = 32, kMostEnds = 1 << 10;
  std::array<uint8_t, kMostStates * kRouteEvents> next{};  // state, event
  std::vector<uint8_t> class_of;                           // state, end
  std::vector<uint32_t> members;                           // by class: a bit for each expression
  int ends = 0, expressions = 0;
  int leaves_out = -1;           // a bit of `members`: light that matches it is no part of the picture; -1: none
  bool counts_straight = false;  // some state is left straight through a surface

  bool is_left_out(int of_class) const { return leaves_out >= 0 && (members[size_t(of_class)] >> leaves_out & 1); }
  uint8_t class_at(int32_t state, int32_t end) const { return class_of[size_t(state) * size_t(ends) + size_t(end)]; }
};

}  // namespace primray
