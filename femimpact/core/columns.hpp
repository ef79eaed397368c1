// Columns of the tables that a run fills, in the order of femimpact/response/impacts.py.
#pragma once

#include "array.hpp"
#include "fields.hpp"

namespace FEMIMPACT_TARGET {

// Of the statistics of a cycle; the first two are extremes of the motion, the others sums over samples.
ENUMERATION(CYCLE_NAMES, MAXIMUM, MINIMUM, SQUARE, SINE_SUM, COSINE_SUM, SAMPLES);
constexpr Index CYCLE_COLUMNS = SAMPLES + 1;

// Of energies (J); losses of the modes follow.
ENUMERATION(ENERGY_NAMES, ENERGY_KINETIC, ENERGY_STRAIN, ENERGY_BALL, ENERGY_CONTACT, ENERGY_WORK,
            ENERGY_STRUCTURE_LOSS, ENERGY_CONTACT_LOSS);
constexpr Index ENERGY_COLUMNS = ENERGY_CONTACT_LOSS + 1;

// Of impacts (s, 1, 1, m/s, m/s, N s, N, s, J); the energies given to the modes follow.
ENUMERATION(IMPACT_NAMES, IMPACT_TIME, IMPACT_PAIR, IMPACT_SIDE, IMPACT_APPROACH_SPEED, IMPACT_REBOUND_SPEED,
            IMPACT_IMPULSE, IMPACT_PEAK_FORCE, IMPACT_DURATION, IMPACT_ENERGY_LOSS);
constexpr Index IMPACT_COLUMNS = IMPACT_ENERGY_LOSS + 1;

// Of events (s, 1, 1, 1, 1); contact states of all pairs, displacements and velocities of all coordinates follow.
ENUMERATION(EVENT_NAMES, EVENT_TIME, EVENT_KIND, EVENT_PAIR, EVENT_SIDE, EVENT_IMPACTS);
constexpr Index EVENT_COLUMNS = EVENT_IMPACTS + 1;

// What an event does to its pair; see `kind_of_event`.
ENUMERATION(EVENT_KIND_NAMES, KIND_IMPACT, KIND_CAPTURE, KIND_LET_GO, KIND_TOUCH, KIND_RELEASE, KIND_PRESS_AGAIN,
            KIND_SEPARATE);

// Of sticking phases (1, 1, s, s, N s).
enum : Index { STICKING_PAIR, STICKING_SIDE, STICKING_START, STICKING_END, STICKING_IMPULSE };

// Sums over the impacts of a window: the first four count impacts that end within it, the last two every force in it.
ENUMERATION(TOTAL_NAMES, COUNT, APPROACH_SUM, LARGEST_APPROACH, IMPULSE_SUM, PEAK_FORCE, FORCE_TIME);

} // namespace FEMIMPACT_TARGET
