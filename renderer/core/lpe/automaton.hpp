// Light path expressions compiled to one automaton over scattering events: built by renderer/primray/light_paths, evaluated in
// integrator/.
//
// A path is in one of up to 256 states, and each scattering event moves it to the next. When it ends at a light, the state and
// the light determine its class: the set of expressions that it matches.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace primray {

// Scattering events: reflected or transmitted, by a diffuse, glossy or singular lobe; straight through a surface; in a medium.
enum LpeEvent : int32_t {
  kReflectedDiffuse,
  kReflectedGlossy,
  kReflectedSingular,
  kTransmittedDiffuse,
  kTransmittedGlossy,
  kTransmittedSingular,
  kStraight,
  kVolume,
  kLpeEvents
};
// Ends of a path: a light, a dome (both a light and the background), or an emissive surface.
enum LpeEnd : int32_t { kEndLight, kEndDome, kEndObject, kLpeEnds };

// Number of an end: its kind, with the light's group; group 0 is none.
constexpr int32_t end_number(int32_t group, LpeEnd kind) { return group * kLpeEnds + kind; }

struct LpeAutomaton {
  static constexpr int kMostStates = 256, kMostExpressions = 32, kMostEnds = 1 << 10;
  std::array<uint8_t, kMostStates * kLpeEvents> next{};  // indexed by state, event
  std::vector<uint8_t> class_of;                         // indexed by state, end
  std::vector<uint32_t> members;                         // by class: one bit per expression
  int ends = 0, expressions = 0;
  int leaves_out = -1;           // bit of `members` whose light is left out of the image; -1: none
  bool counts_straight = false;  // some state changes at a straight transmission

  bool is_left_out(int of_class) const { return leaves_out >= 0 && (members[size_t(of_class)] >> leaves_out & 1); }
  uint8_t class_at(int32_t state, int32_t end) const { return class_of[size_t(state) * size_t(ends) + size_t(end)]; }
};

}  // namespace primray
