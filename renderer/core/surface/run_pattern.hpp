// Runs a surface's tape at W points: compiled apart from all that has no patterns (run_pattern.cpp).
#pragma once

#include "pattern/tape.hpp"
#include "surface/surface_point.hpp"

namespace primray {

// What is known of W points. Pointers are null where no ray met them: then they are points of triangles.
template <int W>
struct PatternPlace {
  const Scene& scene;
  vbool<W> active;
  const SurfacePoint<W>& point;
  vfloat<W> footprint;  // area, in world space
  const Hits<W>* hits = nullptr;
  const vvec3<W>* p = nullptr;   // where they are
  const vvec3<W>* ns = nullptr;  // the shading normal
};

// The outputs of which no instruction stands at `end` or beyond.
template <int W>
void run_pattern(const PatternPlace<W>& place, const Tape& tape, int end, vvec3<W>* outputs);

// The instructions that those outputs need which `wants(field)` names, of a surface's inputs.
template <class Wants>
inline int tape_end(const SurfaceInputs& inputs, const Tape& tape, const Wants& wants) {
  int end = 0;
  for (const InputSource& s : inputs.sources)
    if (s.output >= 0 && wants(s.field)) end = std::max(end, int(tape.outputs[size_t(s.output)].end));
  return end;
}

}  // namespace primray
