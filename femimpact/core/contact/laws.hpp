// The contact laws in the loop over steps. A rigid law has no force: the step computes its impulse.
#pragma once

#include "../fields.hpp"
#include "formulas.hpp"

namespace FEMIMPACT_TARGET {

// Force (N) of a custom law, for a depth (m), its rate and the approach speed (m/s).
using CustomForce = double (*)(double depth, double rate, double approach_speed);

// Numbers of one pair's law, and of its contact in progress.
struct Law {
    FIELDS_BEGIN;
    NUMBER(kind, Index);
    NUMBER(gap_plus, double);    // m
    NUMBER(gap_minus, double);   // m
    NUMBER(stiffness, double);   // N/m, or N/m^n
    NUMBER(damping, double);     // N s/m; of a power law its loss factor, 1
    NUMBER(exponent, double);    // 1
    NUMBER(restitution, double); // 1
    NUMBER(spring, double);      // N/m, of the centring spring
    NUMBER(dashpot, double);     // N s/m, of the dashpot beside it
    NUMBER(approach, double);    // m/s, speed at which the contact opened
    NUMBER(address, Index);      // of a custom law's function
    FIELDS_END;
    double *refused; // (3,) what a custom law was given first for a force that is no number; written once
};

// A law that needs no function, by its numbers alone; of another kind one without force.
inline Law compiled_law(double kind, double stiffness, double damping, double exponent, double approach) {
    Index number = kind >= 0.0 && kind < static_cast<double>(KINDS) ? static_cast<Index>(kind) : RIGID;
    Law law = {};
    law.kind = number == CUSTOM ? RIGID : number;
    law.stiffness = stiffness;
    law.damping = damping;
    law.exponent = exponent;
    law.approach = approach;
    return law;
}

// Depths (m) as a share, and weights, of the Gauss rule of eight points on 0 to 1.
constexpr int LAW_POINTS = 8;
constexpr double LAW_NODES[LAW_POINTS] = {0.019855071751231912, 0.10166676129318664, 0.2372337950418355,
                                          0.4082826787521751,   0.5917173212478248,  0.7627662049581645,
                                          0.8983332387068134,   0.9801449282487681};
constexpr double LAW_WEIGHTS[LAW_POINTS] = {0.05061426814518853, 0.11119051722668721, 0.15685332293894344,
                                            0.18134189168918083, 0.18134189168918083, 0.15685332293894344,
                                            0.11119051722668721, 0.05061426814518853};

// Travel over depth below which a mean of forces is taken by quadrature: differences of potentials would cancel.
constexpr double SHORT_TRAVEL = 0.02;

// Depth (m) and rate (m/s) beyond which a motion has diverged, whatever the law.
constexpr double BEYOND_ANY = 1e100;

// Force of a custom law, never pulling. One that is no finite number is kept in `refused`, and ends the run.
[[gnu::noinline]] inline double custom_force(const Law &law, double depth, double rate) {
    double force = reinterpret_cast<CustomForce>(law.address)(depth, rate, law.approach);
    if (magnitude(force) < INFINITE || !(depth < BEYOND_ANY && magnitude(rate) < BEYOND_ANY))
        return force > 0.0 ? force : 0.0;
    if (law.refused[0] == 0.0) {
        law.refused[0] = depth;
        law.refused[1] = rate;
        law.refused[2] = law.approach;
    }
    return 0.0;
}

// Normal force of a law (N, never pulling).
[[gnu::always_inline]] inline double normal_force(const Law &law, double depth, double rate) {
    if (depth <= 0.0)
        return 0.0;
    if (law.kind == KELVIN_VOIGT)
        return kelvin_voigt_force(depth, rate, law.stiffness, law.damping);
    if (law.kind == POWER)
        return power_force(depth, rate, law.stiffness, law.exponent, law.damping, law.approach);
    if (law.kind == CUSTOM)
        return custom_force(law, depth, rate);
    return 0.0;
}

// Its part without damping: that at rate zero.
[[gnu::always_inline]] inline double elastic_force(Law law, double depth) {
    law.damping = 0.0;
    return normal_force(law, depth, 0.0);
}

// Energy (J) that a law has stored at a depth: the integral of its force at rate zero.
inline double elastic_potential(const Law &law, double depth) {
    if (depth <= 0.0)
        return 0.0;
    if (law.kind == KELVIN_VOIGT)
        return spring_potential(depth, law.stiffness);
    if (law.kind == POWER)
        return power_potential(depth, law.stiffness, law.exponent);
    if (law.kind == CUSTOM) {
        // depth s^2 for the integration variable: half powers of the depth are integrated exactly
        double total = 0.0;
        for (int i = 0; i < LAW_POINTS; i++)
            total += 2.0 * LAW_WEIGHTS[i] * LAW_NODES[i] * elastic_force(law, depth * LAW_NODES[i] * LAW_NODES[i]);
        return depth * total;
    }
    return 0.0;
}

struct MeanForces {
    double elastic, normal;
};

// Elastic part of the normal force (N), and all of it, of a step, as means over its displacement.
//
// mean = (1/travel) integral of N(p, travel/dt) dp from before to after: depths at both ends of the step, no less than
// 0; the travel is that of the pair, between contacts too. The elastic part is [V(after) - V(before)]/travel: its work
// is what the potential changes by.
inline MeanForces mean_forces(const Law &law, double before, double after, double travel, double dt) {
    double increment = after - before;
    // in contact at both ends both are the same; their quotient would be noise where the pair rests
    double inside = travel != 0.0 && (before == 0.0 || after == 0.0) ? increment / travel : 1.0;
    double rate = travel / dt, middle = 0.5 * (before + after);
    if (law.kind == KELVIN_VOIGT) {
        double elastic = law.stiffness * middle * inside;
        return {elastic, larger(elastic + law.damping * rate * inside, 0.0)};
    }
    double elastic = 0.0;
    if (magnitude(increment) <= SHORT_TRAVEL * middle) {
        for (int i = 0; i < LAW_POINTS; i++)
            elastic += LAW_WEIGHTS[i] * elastic_force(law, before + LAW_NODES[i] * increment);
        elastic *= inside;
    } else {
        double gained = elastic_potential(law, after);
        gained -= elastic_potential(law, before);
        elastic = gained / travel;
    }
    double normal = elastic;
    if (law.kind == POWER)
        normal += law.damping > 0.0 ? elastic * law.damping * rate / law.approach : 0.0;
    else
        for (int i = 0; i < LAW_POINTS; i++) {
            double depth = before + LAW_NODES[i] * increment, share = LAW_WEIGHTS[i] * inside;
            normal += share * normal_force(law, depth, rate);
            normal -= share * elastic_force(law, depth);
        }
    return {elastic, larger(normal, 0.0)};
}

// The same of both walls over the displacement of a step from one place of the pair to another (m), positive at the +
// wall: a coarse step may reach from one wall to the other.
inline MeanForces mean_forces_of_walls(const Law &law, double x_before, double x, double dt) {
    MeanForces total = {0.0, 0.0};
    for (int k = 0; k < 2; k++) {
        double side = k == 0 ? 1.0 : -1.0, gap = k == 0 ? law.gap_plus : law.gap_minus;
        double before = larger(side * x_before - gap, 0.0), after = larger(side * x - gap, 0.0);
        if (before > 0.0 || after > 0.0) {
            auto mean = mean_forces(law, before, after, side * (x - x_before), dt);
            total.elastic += side * mean.elastic;
            total.normal += side * mean.normal;
        }
    }
    return total;
}

} // namespace FEMIMPACT_TARGET
