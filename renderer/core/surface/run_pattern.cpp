// Compiled instances of run_pattern.hpp.
#include "surface/run_pattern.hpp"

#include "pattern/run_tape.hpp"
#include "surface/pattern_leaves.hpp"

namespace primray {

template <int W>
void run_pattern(const PatternPlace<W>& place, const Tape& tape, int end, vvec3<W>* outputs) {
  vfloat<W> r[kMostRegisters];
  PatternLeaves<W> leaves(place, tape);
  pattern::run_tape(tape, end, leaves, r);
  for (size_t k = 0; k < tape.outputs.size(); ++k) {
    const Tape::Output& o = tape.outputs[k];
    if (o.end <= end) outputs[k] = {r[o.first], r[o.first + o.step], r[o.first + 2 * o.step]};
  }
}

template void run_pattern<1>(const PatternPlace<1>&, const Tape&, int, vvec3<1>*);
template void run_pattern<4>(const PatternPlace<4>&, const Tape&, int, vvec3<4>*);
#if PRIMRAY_MAX_LANES >= 8
template void run_pattern<8>(const PatternPlace<8>&, const Tape&, int, vvec3<8>*);
#endif
#if PRIMRAY_MAX_LANES >= 16
template void run_pattern<16>(const PatternPlace<16>&, const Tape&, int, vvec3<16>*);
#endif

}  // namespace primray
