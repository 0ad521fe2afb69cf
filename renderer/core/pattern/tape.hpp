// A surface's pattern as a tape: instructions on registers of lanes, in an order in which each reads only earlier results.
//
// This folder: tape.hpp is the data; run_tape.hpp interprets it; elementary.hpp and noise.hpp have
// those of its functions that take more than a line. It knows no scene: surface/pattern_leaves.hpp evaluates the instructions
// that read the shading point.
//
// A value of n components is n consecutive registers. Truth values are 1 and 0, integers are floats that hold them exactly.
// Undefined values (a division by 0, the root of a negative number) are 0, as in Open Shading Language's safe functions: a
// pattern yields no infinity unless its inputs did.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "texture/lookup.hpp"

namespace primray {

enum class PatternOp : uint8_t {
  // Per component: an operand advances with the component, or is one number for all (Instruction::steps).
  kConstant,  // `data`: first of its numbers in Tape::constants
  kMove,
  kAdd,
  kSubtract,
  kMultiply,
  kDivide,
  kMultiplyAdd,  // a b + c, rounded twice
  kMix,          // a (1 - c) + b c
  kMin,
  kMax,
  kAbs,
  kFloor,
  kSqrt,
  kSin,
  kCos,
  kAsin,
  kAcos,
  kAtan2,  // of (y, x)
  kExp,
  kLn,
  kPower,
  kLess,
  kNotAbove,
  kEqual,
  kSelect,  // where a is not 0: b, otherwise c
  // Vector operations.
  kDot,    // `data` components, to one number
  kCross,  // of three
  // Patterns. The coordinates are operand a.
  kNoise2,
  kNoise3,
  kFractal2,  // b: octaves, c: lacunarity, d: diminish
  kFractal3,
  kCell2,
  kCell3,
  kWorley2,  // b: jitter; `data` 1: the nearest point's cell value, 0: distances, the nearest first
  kWorley3,
  kFlake,  // a: position, b: probability; presence, and four random numbers of the flake, all 0 where there is none
  // Values at the shading point.
  kPrimvar,    // `data`: its number and a shift; a: fallback
  kPosition,   // `data`: 1 object space, 0 world; and a shift
  kNormal,     // unit; world space
  kTangent,    // unit, or 0; world space; `data`: number of the primvar that spans it
  kBitangent,  //
  kView,       // unit, from the camera; world space
  kTransform,  // a, by `data`: a PatternTransform
  kImage,      // a, b, c: coordinates here and at both shifts; d: value if there is no image. `data`: index into Tape::images
  kCount
};

constexpr std::array<std::string_view, size_t(PatternOp::kCount)> kPatternOpNames{
    "constant", "move",     "add",      "subtract", "multiply",  "divide", "multiply_add", "mix",     "min",
    "max",      "abs",      "floor",    "sqrt",     "sin",       "cos",    "asin",         "acos",    "atan2",
    "exp",      "ln",       "power",    "less",     "not_above", "equal",  "select",       "dot",     "cross",
    "noise2",   "noise3",   "fractal2", "fractal3", "cell2",     "cell3",  "worley2",      "worley3", "flake",
    "primvar",  "position", "normal",   "tangent",  "bitangent", "view",   "transform",    "image"};
static_assert(!kPatternOpNames.back().empty());

// Derivatives are differences: an image's coordinates, or a height, are computed again at points shifted along two
// perpendicular directions. Shifts 1 and 2 are as long as the footprint, 3 and 4 at least long enough for a derivative.
constexpr int kShifts = 5;
// `data` of instructions that may be shifted: this many times its own number, plus the shift.
constexpr int kShiftRange = 8;

enum class PatternTransform : int32_t {
  kPointToObject,
  kPointToWorld,
  kVectorToObject,
  kVectorToWorld,
  kNormalToObject,
  kNormalToWorld
};

struct Instruction {
  PatternOp op = PatternOp::kConstant;
  uint8_t width = 1;   // components of the result
  uint16_t steps = 0;  // bit k: operand k advances with the component
  uint16_t out = 0, in[4] = {};
  int32_t data = 0;
};

// One image that a tape reads.
struct PatternImage {
  int32_t color = -1, alpha = -1;  // indices into Scene::textures: of the first three components, and of the fourth
  Wrap wrap_s = Wrap::kRepeat, wrap_t = Wrap::kRepeat;
  bool closest = false;  // reads single texels without filtering
  // Primvar whose two components, transformed by 2 x 3 numbers, are its coordinates; otherwise -1.
  int32_t primvar = -1;
  float st_transform[6] = {1, 0, 0, 0, 1, 0};
};

// Maximum number of registers of a tape.
constexpr int kMostRegisters = 1024;
// Maximum number of outputs of a tape: one for each input of a surface.
constexpr int kMostOutputs = 40;

struct Tape {
  std::vector<Instruction> code;
  std::vector<float> constants;
  std::vector<PatternImage> images;
  struct Output {
    int32_t first = 0, step = 0;  // register of its first number; step 0: one number serves all three
    int32_t end = 0;              // the instructions before this one compute it
  };
  std::vector<Output> outputs;
  bool asks_object_space = false;
  bool is_placed = true;  // asks_place()

  // Whether it needs more than primvars: corners, edges, matrices.
  bool asks_place() const {
    for (const Instruction& i : code) {
      if (i.op < PatternOp::kPrimvar || i.op == PatternOp::kImage) continue;
      if (i.op != PatternOp::kPrimvar || i.data % kShiftRange != 0) return true;
    }
    return false;
  }
};

}  // namespace primray
