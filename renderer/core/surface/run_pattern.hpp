// Interface to pattern evaluation: runs a surface's tape at W points. Compiled separately from code without patterns
// (run_pattern.cpp).
#pragma once

#include "pattern/tape.hpp"
#include "surface/surface_point.hpp"

namespace primray {

// The W points. Pointers are null if no ray hit them: then they are points of triangles.
template <int W>
struct PatternPlace {
  const Scene& scene;
  vbool<W> active;
  const SurfacePoint<W>& point;
  vfloat<W> footprint;  // area, in world space
  const Hits<W>* hits = nullptr;
  const vvec3<W>* p = nullptr;   // positions
  const vvec3<W>* ns = nullptr;  // shading normals
};

// Evaluates the outputs all of whose instructions are before `end`.
template <int W>
void run_pattern(const PatternPlace<W>& place, const Tape& tape, int end, vvec3<W>* outputs);

// Evaluates the instructions needed by those outputs of a surface's inputs that `wants(field)` selects.
template <class Wants>
inline int tape_end(const SurfaceInputs& inputs, const Tape& tape, const Wants& wants) {
  int end = 0;
  for (const InputSource& s : inputs.sources)
    if (s.output >= 0 && wants(s.field)) end = std::max(end, int(tape.outputs[size_t(s.output)].end));
  return end;
}

}  // namespace primray
