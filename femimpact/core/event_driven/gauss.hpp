// Gauss-Legendre rule for products of two motions.
#pragma once

#include "motion.hpp"

namespace FEMIMPACT_TARGET {

// Gauss-Legendre points on -1 to 1: where entries do not stand alone, products of motions are summed over them.
constexpr Index GAUSS_POINTS = 10;
constexpr double NODES[GAUSS_POINTS] = {
    -0.9739065285171717, -0.8650633666889845, -0.6794095682990244, -0.4333953941292472, -0.14887433898163122,
    0.14887433898163122, 0.4333953941292472,  0.6794095682990244,  0.8650633666889845,  0.9739065285171717,
};
constexpr double WEIGHTS[GAUSS_POINTS] = {
    0.06667134430868814, 0.1494513491505806,  0.21908636251598204, 0.26926671930999635, 0.29552422471475287,
    0.29552422471475287, 0.26926671930999635, 0.21908636251598204, 0.1494513491505806,  0.06667134430868814,
};

// Decay e^-80, 2e-35, of which nothing is left in any sum; two entries of a block decay by it nearly together.
constexpr double DECAY_EXPONENT = 80.0;

// Next part of a time (s) in which ten Gauss points integrate products of two motions to rounding.
//
// Their error is below 1e-14 where twice the largest |lambda| times the part is below 6. An entry that has decayed
// since the time began is set to zero, and needs no short parts.
[[gnu::noinline]] inline double next_panel(double elapsed, double remaining, const Scalars &scalars,
                                           const Motion &motion) {
    double fastest = scalars.omega;
    for (Index k = 0; k < scalars.exponent.size(); k++) {
        if (k >= scalars.driven && -scalars.exponent(k).real * elapsed > DECAY_EXPONENT)
            motion.entry(k) = {0.0, 0.0};
        else if (motion.entry(k) != 0.0)
            fastest = larger(fastest, scalars.size(k));
    }
    return fastest * remaining <= 3.0 ? remaining : 3.0 / fastest;
}

} // namespace FEMIMPACT_TARGET
