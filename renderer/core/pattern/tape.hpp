// A surface's pattern as a tape: instructions over registers of lanes, in an order in which each reads what is there.
//
// Folder: tape.hpp the data; run_tape.hpp goes through it; elementary.hpp, noise.hpp, worley.hpp and flakes.hpp are the
// functions of it that are not one line. It knows no scene: what a tape asks of the place that it runs at,
// surface/pattern_leaves.hpp answers.
//
// A value of n numbers is n registers in a row. Truth values are 1 and 0, whole numbers are floats that hold them exactly.
// What has no value (a division by 0, the root of a negative number) is 0, as in Open Shading Language's safe functions: no
// infinity comes of a pattern that its inputs did not have.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "texture/lookup.hpp"

namespace primray {

enum class PatternOp : uint8_t {
  // By component: an operand advances with the component, or is one number for all (Instruction::steps).
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
  kSelect,  // where a is not 0: b, else c
  // Of vectors.
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
  // What the place answers.
  kPrimvar,    // `data`: its number and a shift; a: where there is none
  kPosition,   // `data`: 1 object space, 0 world; and a shift
  kNormal,     // unit; world space
  kTangent,    // unit, or 0; world space; `data`: number of the primvar that spans it
  kBitangent,  //
  kView,       // unit, from the camera; world space
  kTransform,  // a, by `data`: a PatternTransform
  kImage,      // a, b, c: coordinates here and at both shifts; d: where there is no image. `data`: index into Tape::images
  kCount
};

constexpr std::array<std::string_view, size_t(PatternOp::kCount)> kPatternOpNames{
    "constant", "move",     "add",      "subtract", "multiply",  "divide", "multiply_add", "mix",     "min",
    "max",      "abs",      "floor",    "sqrt",     "sin",       "cos",    "asin",         "acos",    "atan2",
    "exp",      "ln",       "power",    "less",     "not_above", "equal",  "select",       "dot",     "cross",
    "noise2",   "noise3",   "fractal2", "fractal3", "cell2",     "cell3",  "worley2",      "worley3", "flake",
    "primvar",  "position", "normal",   "tangent",  "bitangent", "view",   "transform",    "image"};
static_assert(!kPatternOpNames.back().empty());

// Derivatives are differences: what an image's coordinates, or a height, are made of is computed again a little way off, along
// two directions at right angles. Shifts 1 and 2 are as long as the footprint, 3 and 4 at least long enough to tell a slope.
constexpr int kShifts = 5;
// `data` of what may be shifted: this many times its own number, and the shift.
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
  bool closest = false;  // a texel as it is
  // Where its coordinates are a primvar's two numbers, moved and turned by 2 x 3 numbers: which, else -1.
  int32_t primvar = -1;
  float st_transform[6] = {1, 0, 0, 0, 1, 0};
};

// Registers that a tape may use.
constexpr int kMostRegisters = 1024;
// Outputs of a tape: one for each input of a surface at most.
constexpr int kMostOutputs = 40;

struct Tape {
  std::vector<Instruction> code;
  std::vector<float> constants;
  std::vector<PatternImage> images;
  struct Output {
    int32_t first = 0, step = 0;  // register of its first number; 0: one number stands for three
    int32_t end = 0;              // instructions before this one make it
  };
  std::vector<Output> outputs;
  bool asks_object_space = false;
  bool is_placed = true;  // asks_place()

  // It needs more of its place than primvars there: corners, edges, matrices.
  bool asks_place() const {
    for (const Instruction& i : code) {
      if (i.op < PatternOp::kPrimvar || i.op == PatternOp::kImage) continue;
      if (i.op != PatternOp::kPrimvar || i.data % kShiftRange != 0) return true;
    }
    return false;
  }
};

}  // namespace primray
