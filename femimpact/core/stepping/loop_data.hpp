// What the loop over steps works on: the arrays that it is handed, by name.
//
// The functions `fields` are the table of names, types and shapes that Python hands arrays over by; a type in View<...>
// that is const is only read. The case axis comes last: cases lie side by side, one alone or in packs. In shapes n
// degrees of freedom, R places that are read in every step, P pairs, C cases, m modes whose losses are kept apart (n or
// none), B and b lower bands, K cycles; any other letter is a separate length.
#pragma once

#include "../array.hpp"
#include "../contact/laws.hpp"

namespace FEMIMPACT_TARGET::stepping {

using GivenBlock = View<const double, 3>;
using Block = View<double, 3>;

// Rows of Cycles.last: displacement (m) and velocity (m/s) of the observed place.
enum : Index { LAST, LAST_RATE };
// Rows of Motion.ball; y and x = y - w are relative to the base, FORCE acts on the structure; RATE and RATE_BEFORE are
// kept only where a method looks ahead.
enum : Index { Y, Y_RATE, Y_ACCELERATION, X, X_BEFORE, FORCE, Y_BEFORE, RATE, RATE_BEFORE };
// Rows of Motion.drive; the drive's history is SCALE times the sine; BASE is its value at the step's end, ACTING that
// in the balance of the step; TRAVEL is its amplitude as a displacement of the base (m), TRAVEL_RATE as a velocity
// (m/s), and OBSTACLE_RATE(_BEFORE) the velocity of stops fixed in space.
enum : Index {
    SINE,
    COSINE,
    TURN_SINE,
    TURN_COSINE,
    PHASE,
    PHASE_STEP,
    SCALE,
    BASE,
    BASE_BEFORE,
    ACTING,
    TRAVEL,
    TRAVEL_RATE,
    OBSTACLE_RATE,
    OBSTACLE_RATE_BEFORE
};
// Rows of Motion.ledger; LOAD_BEFORE is load @ q at the last step; REFINED to OWN_LOSS set aside what a refined case
// has summed by itself; HELD is the potential of the constant load at the start.
enum : Index { WORK, STRUCTURE_LOSS, CONTACT_LOSS, LOAD_BEFORE, REFINED, OWN_WORK, OWN_LOSS, HELD };
// Rows of Pairs.constants; a stop has no mass (its energy) and no mobility (1/m); SHARE of the drive that acts as an
// acceleration of the base on the ball.
enum : Index {
    MASS,
    MOBILITY,
    GAP_PLUS,
    GAP_MINUS,
    STIFFNESS,
    DAMPING,
    EXPONENT,
    RESTITUTION,
    FREE_STIFFNESS,
    ACCELERATION,
    SHARE
};
// Rows of Motion.touch; BUSY: the pair must be looked at in every step.
enum : Index { BUSY, OPEN, SIDE, START, APPROACH, IMPULSE, PEAK, DURATION, LOSS, NORMAL, DISSIPATIVE, REBOUND };

// Constants of a one-step method for one step size; see femimpact/integrators/stepping/layout.py.
struct Scheme {
    double dt;
    double predict_u; // u1 = u0 + dt v0 + predict_u a0 + correct_u a1
    double predict_v; // v1 = v0 + predict_v a0 + correct_v a1
    double correct_u;
    double correct_v;
    double alpha_f;
    double alpha_m;
    double carry;  // alpha_f/(1 - alpha_f): share of the last step's contact force
    double give_a; // what a force of 1 N does to a free mass of 1 kg in a step
    double give_u;
    double give_v;
    double spring_now; // share of x1 in the force of a centring spring, the rest is that of x0
    bool mean;         // one mean contact force per step, kept out of the acceleration
    bool rigid;        // that force is an impulse that sets the rebound

    template <class Visitor> void fields(Visitor &visit) {
        visit("dt", dt);
        visit("predict_u", predict_u);
        visit("predict_v", predict_v);
        visit("correct_u", correct_u);
        visit("correct_v", correct_v);
        visit("alpha_f", alpha_f);
        visit("alpha_m", alpha_m);
        visit("carry", carry);
        visit("give_a", give_a);
        visit("give_u", give_u);
        visit("give_v", give_v);
        visit("spring_now", spring_now);
        visit("mean", mean);
        visit("rigid", rigid);
    }
};

// The step of a diagonal system, mode by mode: a1 = load s - (stiffness u0 + damping v0 + inertia a0).
struct ModalStep {
    GivenArray load;      // (n,) of the drive; like the others divided by S
    GivenArray inertia;   // (n,)
    GivenArray damping;   // (n,)
    GivenArray stiffness; // (n,)
    GivenArray loss;      // (n,) dt c/4, not divided

    template <class Visitor> void fields(Visitor &visit) {
        visit("load", load, "n");
        visit("inertia", inertia, "n");
        visit("damping", damping, "n");
        visit("stiffness", stiffness, "n");
        visit("loss", loss, "n");
    }
};

// The step of matrices of up to four bands, dof by dof; its tables have no entries where there are more.
struct BandedStep {
    GivenArray columns; // (c,) 12 (n + 6): lower bands of -C, -K and -alpha_m M; three dofs of zeros around
    GivenArray factor;  // (f,) 4 (n + 6): 1/D and the entries of -L left of it, S = L D L^T

    template <class Visitor> void fields(Visitor &visit) {
        visit("columns", columns, "c");
        visit("factor", factor, "f");
    }
};

// The structure, ready for a step: S = (1 - alpha_m) M + (1 - alpha_f)(correct_v C + correct_u K), factorised.
struct Operator {
    bool banded;
    ModalStep modes;
    GivenMatrix mass_band;      // (b, n) lower bands; a diagonal system has one
    GivenMatrix damping_band;   // (B, n) as wide as the Cholesky factor
    GivenMatrix stiffness_band; // (B, n)
    GivenMatrix cholesky_band;  // (B, n) lower bands of L, S = L L^T, diagonal inverted
    BandedStep narrow;
    GivenArray drive_load;    // (n,) of the drive
    GivenArray constant_load; // (l,) N: n or none
    GivenArray constant_a;    // (l,) what the constant load does in a step
    GivenArray constant_u;    // (l,)
    GivenArray constant_v;    // (l,)
    GivenMatrix constant_w;   // (2, w) the same, read at every row: displacement and velocity
    GivenMatrix rows;         // (R, n) places read every step: the observed one first
    GivenMatrix response_a;   // (P, n) what 1 N along b_j does in a step
    GivenMatrix response_u;   // (P, n)
    GivenMatrix response_v;   // (P, n)
    GivenMatrix compliance_u; // (R, P) row_i response_u_j
    GivenMatrix compliance_v; // (R, P)

    template <class Visitor> void fields(Visitor &visit) {
        visit("banded", banded);
        visit.group("modes", modes);
        visit("mass_band", mass_band, "b n");
        visit("damping_band", damping_band, "B n");
        visit("stiffness_band", stiffness_band, "B n");
        visit("cholesky_band", cholesky_band, "B n");
        visit.group("narrow", narrow);
        visit("drive_load", drive_load, "n");
        visit("constant_load", constant_load, "l");
        visit("constant_a", constant_a, "l");
        visit("constant_u", constant_u, "l");
        visit("constant_v", constant_v, "l");
        visit("constant_w", constant_w, "2 w");
        visit("rows", rows, "R n");
        visit("response_a", response_a, "P n");
        visit("response_u", response_u, "P n");
        visit("response_v", response_v, "P n");
        visit("compliance_u", compliance_u, "R P");
        visit("compliance_v", compliance_v, "R P");
    }
};

// The fine steps of a method that divides those with contact; parts = 1 where it only looks ahead.
struct Fine {
    Index parts;
    Operator structure;
    Scheme scheme;

    template <class Visitor> void fields(Visitor &visit) {
        visit("parts", parts);
        visit.group("operator", structure);
        visit.group("scheme", scheme);
    }
};

// Contact pairs: the row of `Operator.rows` that each reads, its law, its numbers.
struct Pairs {
    GivenIndices row;       // (P,)
    GivenIndices kind;      // (P,)
    GivenIndices address;   // (P,) of a custom law's function
    GivenBlock constants;   // (11, P, C)
    GivenIndices obstacles; // (o,) stops fixed in space, their pairs, where the base moves; else none
    Matrix refused; // (P, 3) of each custom law: depth, rate and approach speed of its first force that is no number

    template <class Visitor> void fields(Visitor &visit) {
        visit("row", row, "P");
        visit("kind", kind, "P");
        visit("address", address, "P");
        visit("constants", constants, "9+2 P C");
        visit("obstacles", obstacles, "o");
        visit("refused", refused, "P 3");
    }
};

// State at the present step.
struct Motion {
    Matrix q;                    // (n, C)
    Matrix v;                    // (n, C)
    Matrix a;                    // (n, C)
    Matrix w;                    // (R, C)
    Matrix w_rate;               // (R, C)
    Block ball;                  // (9, P, C)
    Block touch;                 // (12, P, C)
    Block totals;                // (6, P, C)
    View<const Index, 2> window; // (2, C) first step, and the step after the last
    Matrix drive;                // (14, C)
    GivenMatrix table;           // (t, C) history of a drive given by samples at every fine step, else no rows
    GivenBlock travel;           // (2, e, C) such a base's displacement and velocity, where stops need it
    Matrix ledger;               // (8, C)
    Matrix v_before;             // (n, C)
    Array loss_of_mode;          // (m,) of a single case on its modes, else none
    Matrix to_modes;             // (P, i) energy that the open contacts of such a case have passed on, else none
    Block saved;                 // (3, s, C) q, v and a at the start of a step that may be redone, else none
    Block saved_ball;            // (3, r, C) y and its rates
    Block scratch;               // (3, n, C)

    template <class Visitor> void fields(Visitor &visit) {
        visit("q", q, "n C");
        visit("v", v, "n C");
        visit("a", a, "n C");
        visit("w", w, "R C");
        visit("w_rate", w_rate, "R C");
        visit("ball", ball, "9 P C");
        visit("touch", touch, "9+3 P C");
        visit("totals", totals, "6 P C");
        visit("window", window, "2 C");
        visit("drive", drive, "9+5 C");
        visit("table", table, "t C");
        visit("travel", travel, "2 e C");
        visit("ledger", ledger, "8 C");
        visit("v_before", v_before, "n C");
        visit("loss_of_mode", loss_of_mode, "m");
        visit("to_modes", to_modes, "P i");
        visit("saved", saved, "3 s C");
        visit("saved_ball", saved_ball, "3 r C");
        visit("scratch", scratch, "3 n C");
    }
};

// Statistics per base cycle; the state before the first step is row 0 of `energy`.
struct Cycles {
    View<Index, 1> next_wrap; // (C,) step
    View<Index, 1> number;    // (C,) cycles finished
    GivenArray period;        // (C,) steps per cycle, a real number
    Matrix sums;              // (6, C)
    Matrix last;              // (2, C) the observed place at the last step
    Block values;             // (K, 6, C)
    Block energy;             // (k, 7, C) K + 1 rows, or one

    template <class Visitor> void fields(Visitor &visit) {
        visit("next_wrap", next_wrap, "C");
        visit("number", number, "C");
        visit("period", period, "C");
        visit("sums", sums, "6 C");
        visit("last", last, "2 C");
        visit("values", values, "K 6 C");
        visit("energy", energy, "k 7 C");
    }
};

// What case 0 keeps.
struct Record {
    View<const Index, 2> used; // (h, 4) 1 where a channel has a row of q, of v, of the balls, or of forces
    GivenBlock rows;           // (h, 2, n) of q and v
    GivenBlock pair_rows;      // (h, 4, P) of Y, Y_RATE, FORCE and of the force of contact
    Matrix channels;           // (h, a)
    Matrix energy;             // (g, d) columns and modes
    Block snapshots;           // (j, 2, n + P)
    Matrix forces;             // (j, P)
    Matrix impacts;            // (q, u) columns and modes
    GivenIndices stride;       // (4,): every, first sample, snapshot stride, first snapshot
    View<Index, 1> tally;      // (4,): step, samples, snapshots, impacts met

    template <class Visitor> void fields(Visitor &visit) {
        visit("used", used, "h 4");
        visit("rows", rows, "h 2 n");
        visit("pair_rows", pair_rows, "h 4 P");
        visit("channels", channels, "h a");
        visit("energy", energy, "g d");
        visit("snapshots", snapshots, "j 2 n+P");
        visit("forces", forces, "j P");
        visit("impacts", impacts, "q u");
        visit("stride", stride, "4");
        visit("tally", tally, "4");
    }
};

// A block of cases side by side: where they are, what is kept of them, and scratch space.
struct Cases {
    Pairs pairs;
    Motion motion;
    Cycles cycles;
    Record record;
    Matrix pair_scratch;  // (6, P) for the contact equations of one case
    Array energy_scratch; // (7,) for the energies of one case

    template <class Visitor> void fields(Visitor &visit) {
        visit.group("pairs", pairs);
        visit.group("motion", motion);
        visit.group("cycles", cycles);
        visit.group("record", record);
        visit("pair_scratch", pair_scratch, "6 P");
        visit("energy_scratch", energy_scratch, "7");
    }
};

// A block with its method: what every function of the loop is handed.
struct Stepped {
    Operator structure;
    Scheme scheme;
    Cases cases;
    bool ledger;

    template <class Visitor> void fields(Visitor &visit) {
        visit.group("operator", structure);
        visit.group("scheme", scheme);
        visit.group("cases", cases);
        visit("ledger", ledger);
    }
};

} // namespace FEMIMPACT_TARGET::stepping
