// Columns of the tables that a run fills, in the order of femimpact/response/impacts.py.
#pragma once

#include "array.hpp"

namespace FEMIMPACT_TARGET {

// Of the statistics of a cycle; the first two are extremes of the motion, the others sums over samples.
enum : Index { MAXIMUM, MINIMUM, SQUARE, SINE_SUM, COSINE_SUM, SAMPLES, CYCLE_COLUMNS };

// Of energies (J) and how many these are; losses of the modes follow.
constexpr Index ENERGY_COLUMNS = 7;

// Of impacts, and how many these are; what the modes are given follows.
constexpr Index IMPACT_COLUMNS = 9;

// Sums over the impacts of a window: the first four count impacts that end within it, the last two every force in it.
enum : Index { COUNT, APPROACH_SUM, LARGEST_APPROACH, IMPULSE_SUM, PEAK_FORCE, FORCE_TIME };

} // namespace FEMIMPACT_TARGET
