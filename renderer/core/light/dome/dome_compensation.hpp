// How much of a dome's light is left to the rays that leave surfaces anyway.
#pragma once

#include <span>

namespace primray {

// The radiance that is left to those rays everywhere; light samples go where there is more of it ("MIS compensation": Karlik et
// al. 2019). Infinity: under a soft sky they are not worth their cost. `luminance`: of rows x columns cells in lat-long order,
// the first row about a pole, and its mean; `solid_angle`: of a row's cells.
double dome_compensation(std::span<const double> luminance, std::span<const double> solid_angle, int columns, double mean);

}  // namespace primray
