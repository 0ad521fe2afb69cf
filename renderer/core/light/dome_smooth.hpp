// Whether rays that leave surfaces anyway find a dome's light as well as samples of the dome would.
#pragma once

#include <span>

namespace primray {

// `luminance`: of rows x columns cells in lat-long order, the first row about a pole; `solid_angle`: of a row's cells.
bool is_smooth_dome(std::span<const double> luminance, std::span<const double> solid_angle, int columns);

}  // namespace primray
