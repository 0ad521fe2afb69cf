// Tables of what lobes send on: make_tables.py makes them and says what they hold; fuzz_table.cpp has its own.
#pragma once

namespace primray {

// Nodes along the axes, the last one nearest to each other in memory.
constexpr int kReflectionEtas = 11, kReflectionRoughnesses = 20, kReflectionCosines = 28;
constexpr int kPassingEtas = 25, kPassingRoughnesses = 14, kPassingCosines = 24;
constexpr int kBrushedAnisotropies = 10, kBrushedRoughnesses = 14, kBrushedCosines = 20, kBrushedAzimuths = 9;
constexpr int kFuzzNodes = 32;
constexpr float kMostAnisotropy = 0.98f;
// What 0 and 65535 in a table stand for.
constexpr float kReflectionLow = -1, kReflectionHigh = 1, kBrushedHigh = 2;
constexpr float kPerStep = 1.0f / 65535;

extern const float kReflectionTable[], kPassingTable[], kBrushedTable[], kFuzzTable[];

}  // namespace primray
