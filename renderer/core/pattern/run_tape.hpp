// Interpreter of tapes: runs each instruction once, for all lanes of a group.
#pragma once

#include "pattern/elementary.hpp"
#include "pattern/noise.hpp"
#include "pattern/tape.hpp"

namespace primray::pattern {

template <int W>
PRIMRAY_INLINE vfloat<W> truth(vbool<W> b) {
  return select(b, vfloat<W>(1.0f), 0.0f);
}

template <int N, int W>
PRIMRAY_RARE void put_noise(const vfloat<W>* at, int channels, vfloat<W>* out) {
  vfloat<W> p[N];
  for (int k = 0; k < N; ++k) p[k] = at[k];
  noise<N>(p, channels, out);
}
template <int N, int W>
PRIMRAY_RARE void put_fractal(const Instruction& i, const vfloat<W>* r, vfloat<W>* out) {
  fractal<N>(r + i.in[0], r[i.in[1]], r[i.in[2]], r[i.in[3]], i.width, out);
}
template <int N, int W>
PRIMRAY_RARE void put_worley(const Instruction& i, const vfloat<W>* r, vfloat<W>* out) {
  i.data == 1 ? worley_cells<N>(r + i.in[0], r[i.in[1]], i.width, out)
              : worley_distances<N>(r + i.in[0], r[i.in[1]], i.width, out);
}
template <int W>
PRIMRAY_RARE void put_flake(const Instruction& i, const vfloat<W>* r, vfloat<W>* out) {
  flake(r + i.in[0], r[i.in[1]], out);
}

// `r`: kMostRegisters; `leaves(instruction, r)` evaluates instructions that read the shading point. Results never overlap an
// operand of the same instruction.
template <int W, class Leaves>
PRIMRAY_INLINE void run_tape(const Tape& tape, int end, Leaves& leaves, vfloat<W>* r) {
  using F = vfloat<W>;
  const F zero(0.0f);
  for (const Instruction *at = tape.code.data(), *last = at + end; at != last; ++at) {
    const Instruction& i = *at;
    F* out = r + i.out;
    const auto in = [&](int k, int c) { return r[i.in[k] + (i.steps >> k & 1) * c]; };
    const auto each = [&](auto f) {
      for (int c = 0; c < i.width; ++c) out[c] = f(c);
    };
    const auto unary = [&](auto f) { each([&](int c) { return f(in(0, c)); }); };
    const auto binary = [&](auto f) { each([&](int c) { return f(in(0, c), in(1, c)); }); };
    const auto ternary = [&](auto f) { each([&](int c) { return f(in(0, c), in(1, c), in(2, c)); }); };
    switch (i.op) {
      case PatternOp::kConstant:
        each([&](int c) { return F(tape.constants[size_t(i.data) + size_t(c)]); });
        break;
      case PatternOp::kMove:
        unary([](F a) { return a; });
        break;
      case PatternOp::kAdd:
        binary([](F a, F b) { return a + b; });
        break;
      case PatternOp::kSubtract:
        binary([](F a, F b) { return a - b; });
        break;
      case PatternOp::kMultiply:
        binary([](F a, F b) { return a * b; });
        break;
      case PatternOp::kDivide:
        binary([](F a, F b) { return divide(a, b); });
        break;
      case PatternOp::kMultiplyAdd:
        ternary([](F a, F b, F c) { return a * b + c; });
        break;
      case PatternOp::kMix:
        ternary([](F a, F b, F c) { return a * (1.0f - c) + b * c; });
        break;
      case PatternOp::kMin:
        binary([](F a, F b) { return min(a, b); });
        break;
      case PatternOp::kMax:
        binary([](F a, F b) { return max(a, b); });
        break;
      case PatternOp::kAbs:
        unary([](F a) { return abs(a); });
        break;
      case PatternOp::kFloor:
        unary([](F a) { return floor(a); });
        break;
      case PatternOp::kSqrt:
        unary([](F a) { return safe_sqrt(a); });
        break;
      case PatternOp::kSin:
        unary([](F a) { return sincos(a).sin; });
        break;
      case PatternOp::kCos:
        unary([](F a) { return sincos(a).cos; });
        break;
      case PatternOp::kAsin:
        unary([](F a) { return asin(a); });
        break;
      case PatternOp::kAcos:
        unary([](F a) { return acos(a); });
        break;
      case PatternOp::kAtan2:
        binary([](F y, F x) { return atan2(y, x); });
        break;
      case PatternOp::kExp:
        unary([](F a) { return exp(a); });
        break;
      case PatternOp::kLn:
        unary([](F a) { return ln(a); });
        break;
      case PatternOp::kPower:
        binary([](F a, F b) { return power(a, b); });
        break;
      case PatternOp::kLess:
        binary([](F a, F b) { return truth(a < b); });
        break;
      case PatternOp::kNotAbove:
        binary([](F a, F b) { return truth(a <= b); });
        break;
      case PatternOp::kEqual:
        binary([](F a, F b) { return truth(a == b); });
        break;
      case PatternOp::kSelect:
        ternary([&](F a, F b, F c) { return select(a != zero, b, c); });
        break;
      case PatternOp::kDot: {
        F sum = in(0, 0) * in(1, 0);
        for (int c = 1; c < i.data; ++c) sum += in(0, c) * in(1, c);
        out[0] = sum;
        break;
      }
      case PatternOp::kCross:
        for (int c = 0; c < 3; ++c) {
          const int n = (c + 1) % 3, m = (c + 2) % 3;
          out[c] = in(0, n) * in(1, m) - in(0, m) * in(1, n);
        }
        break;
      case PatternOp::kNoise2:
        put_noise<2>(r + i.in[0], i.width, out);
        break;
      case PatternOp::kNoise3:
        put_noise<3>(r + i.in[0], i.width, out);
        break;
      case PatternOp::kFractal2:
        put_fractal<2>(i, r, out);
        break;
      case PatternOp::kFractal3:
        put_fractal<3>(i, r, out);
        break;
      case PatternOp::kCell2:
        out[0] = cell_noise<2>(r + i.in[0]);
        break;
      case PatternOp::kCell3:
        out[0] = cell_noise<3>(r + i.in[0]);
        break;
      case PatternOp::kWorley2:
        put_worley<2>(i, r, out);
        break;
      case PatternOp::kWorley3:
        put_worley<3>(i, r, out);
        break;
      case PatternOp::kFlake:
        put_flake(i, r, out);
        break;
      default:
        leaves(i, r);
    }
  }
}

}  // namespace primray::pattern
