// What the loop over steps works on: the arrays that it is handed, by name.
//
// Each line of a struct with fields is a member and its row in the table of names, types and shapes that Python hands
// arrays over by (see fields.hpp); a type in View<...> that is const is only read. The case axis comes last: cases lie
// side by side, one alone or in packs. In shapes n degrees of freedom, R places that are read in every step, P pairs, C
// cases, m modes whose losses are kept apart (n or none), H loads behind the first and D drives whose work is kept
// apart of a single case (or none), B and b lower bands, K cycles; any other letter is a separate length.
#pragma once

#include "../array.hpp"
#include "../contact/laws.hpp"
#include "../fields.hpp"

namespace FEMIMPACT_TARGET::stepping {

using GivenBlock = View<const double, 3>;
using Block = View<double, 3>;

// Rows of Cycles.last: displacement (m) and velocity (m/s) of the observed place.
ENUMERATION(LAST_NAMES, LAST, LAST_RATE);
// Rows of Motion.ball; y and x = y - w are relative to the base, FORCE acts on the structure; RATE and RATE_BEFORE are
// kept only where a method looks ahead.
ENUMERATION(BALL_NAMES, Y, Y_RATE, Y_ACCELERATION, X, X_BEFORE, FORCE, Y_BEFORE, RATE, RATE_BEFORE);
// Rows of Motion.drive; the drive's history is SCALE times the sine; BASE is its value at the step's end, ACTING that
// in the balance of the step; TRAVEL is its amplitude as a displacement of the base (m), TRAVEL_RATE as a velocity
// (m/s), and OBSTACLE_RATE(_BEFORE) the velocity of stops fixed in space.
ENUMERATION(DRIVE_NAMES, SINE, COSINE, TURN_SINE, TURN_COSINE, PHASE, PHASE_STEP, SCALE, BASE, BASE_BEFORE, ACTING,
            TRAVEL, TRAVEL_RATE, OBSTACLE_RATE, OBSTACLE_RATE_BEFORE);
// Rows of Motion.ledger; LOAD_BEFORE is load @ q at the last step; REFINED to OWN_LOSS set aside what a refined case
// has summed by itself; HELD is the potential of the constant load at the start.
ENUMERATION(LEDGER_NAMES, WORK, STRUCTURE_LOSS, CONTACT_LOSS, LOAD_BEFORE, REFINED, OWN_WORK, OWN_LOSS, HELD);
// Rows of Pairs.constants; a stop has no mass (its energy) and no mobility (1/m); SHARE of the drive that acts as an
// acceleration of the base on the ball.
ENUMERATION(CONSTANT_NAMES, MASS, MOBILITY, GAP_PLUS, GAP_MINUS, STIFFNESS, DAMPING, EXPONENT, RESTITUTION,
            FREE_STIFFNESS, ACCELERATION, SHARE, FREE_DAMPING);
// Rows of Motion.touch; BUSY: the pair must be looked at in every step.
ENUMERATION(TOUCH_NAMES, BUSY, OPEN, SIDE, START, APPROACH, IMPULSE, PEAK, DURATION, LOSS, NORMAL, DISSIPATIVE,
            REBOUND);

// Rows of Record.tally: the present step, and how many samples, snapshots and impacts there are.
enum : Index { STEP, SAMPLES_KEPT, SNAPSHOTS_KEPT, IMPACTS_MET };

// Constants of a one-step method for one step size, acting on the accelerations a0 and a1.
//
// M [(1 - alpha_m) a1 + alpha_m a0] + C v_f + K u_f = F_f + b [(1 - alpha_f) f1 + alpha_f f0], where . _f is
// (1 - alpha_f) . 1 + alpha_f . 0, or, with one mean force f kept out of the acceleration, M a + C v + K u = F and v1
// gains dt M^-1 b f, u1 gains mass_response_u M^-1 b f.
struct Scheme {
    FIELDS_BEGIN;
    NUMBER(dt, double);
    NUMBER(predict_u, double); // u1 = u0 + dt v0 + predict_u a0 + correct_u a1
    NUMBER(predict_v, double); // v1 = v0 + predict_v a0 + correct_v a1
    NUMBER(correct_u, double);
    NUMBER(correct_v, double);
    NUMBER(alpha_f, double);
    NUMBER(alpha_m, double);
    NUMBER(carry, double);           // alpha_f/(1 - alpha_f): share of the last step's contact force
    NUMBER(mass_response_a, double); // what a force of 1 N does to a free mass of 1 kg in a step
    NUMBER(mass_response_u, double);
    NUMBER(mass_response_v, double);
    NUMBER(spring_now, double); // share of x1 in the force of a centring spring, the rest is that of x0
    NUMBER(mean, bool);         // one mean contact force per step, kept out of the acceleration
    NUMBER(rigid, bool);        // that force is an impulse that sets the rebound
    FIELDS_END;
};

// The step of a diagonal system, mode by mode: a1 = load s - (stiffness u0 + damping v0 + inertia a0).
struct ModalStep {
    FIELDS_BEGIN;
    ARRAY(load, "n", GivenArray); // of the drive; like the others divided by S
    ARRAY(inertia, "n", GivenArray);
    ARRAY(damping, "n", GivenArray);
    ARRAY(stiffness, "n", GivenArray);
    ARRAY(loss, "n", GivenArray); // dt c/4, not divided
    FIELDS_END;
};

// The step of matrices of up to four bands, dof by dof; its tables have no entries where there are more.
struct BandedStep {
    FIELDS_BEGIN;
    ARRAY(columns, "c", GivenArray); // 12 (n + 6): lower bands of -C, -K and -alpha_m M; three dofs of zeros around
    ARRAY(factor, "f", GivenArray);  // 4 (n + 6): 1/D and the entries of -L left of it, S = L D L^T
    FIELDS_END;
};

// The structure, ready for a step: S = (1 - alpha_m) M + (1 - alpha_f)(correct_v C + correct_u K), factorised.
struct Operator {
    FIELDS_BEGIN;
    NUMBER(banded, bool);
    GROUP(modes, ModalStep);
    ARRAY(mass_band, "b n", GivenMatrix);    // lower bands; a diagonal system has one
    ARRAY(damping_band, "B n", GivenMatrix); // as wide as the Cholesky factor
    ARRAY(stiffness_band, "B n", GivenMatrix);
    ARRAY(cholesky_band, "B n", GivenMatrix); // lower bands of L, S = L L^T, diagonal inverted
    GROUP(narrow, BandedStep);
    ARRAY(drive_load, "n", GivenArray);    // of the drive
    ARRAY(more_load, "H n", GivenMatrix);  // of drives along further loads, each per unit of its history
    ARRAY(more_a, "H n", GivenMatrix);     // what these do in a step to the accelerations
    ARRAY(constant_load, "l", GivenArray); // N: n or none
    ARRAY(constant_a, "l", GivenArray);    // what the constant load does in a step
    ARRAY(constant_u, "l", GivenArray);
    ARRAY(constant_v, "l", GivenArray);
    ARRAY(constant_w, "2 w", GivenMatrix); // the same, read at every row: displacement and velocity
    ARRAY(rows, "R n", GivenMatrix);       // places read every step: the observed one first
    ARRAY(response_a, "P n", GivenMatrix); // what 1 N along b_j does in a step
    ARRAY(response_u, "P n", GivenMatrix);
    ARRAY(response_v, "P n", GivenMatrix);
    ARRAY(compliance_u, "R P", GivenMatrix); // row_i response_u_j
    ARRAY(compliance_v, "R P", GivenMatrix);
    FIELDS_END;
};

// The fine steps of a method that divides those with contact; parts = 1 where it only looks ahead.
struct Fine {
    FIELDS_BEGIN;
    NUMBER(parts, Index);
    GROUP_AS("operator", structure, Operator);
    GROUP(scheme, Scheme);
    FIELDS_END;
};

// Contact pairs: the row of `Operator.rows` that each reads, its law, its numbers.
struct Pairs {
    FIELDS_BEGIN;
    ARRAY(row, "P", GivenIndices);
    ARRAY(kind, "P", GivenIndices);
    ARRAY(address, "P", GivenIndices); // of a custom law's function
    ARRAY(constants, "9+3 P C", GivenBlock);
    ARRAY(obstacles, "o", GivenIndices); // stops fixed in space, their pairs, where the base moves; else none
    // of each custom law: depth, rate and approach speed of its first force that is no number
    ARRAY(refused, "P 3", Matrix);
    FIELDS_END;
};

// State at the present step; the case axis last.
struct Motion {
    FIELDS_BEGIN;
    ARRAY(q, "n C", Matrix);
    ARRAY(v, "n C", Matrix);
    ARRAY(a, "n C", Matrix);
    ARRAY(w, "R C", Matrix);
    ARRAY(w_rate, "R C", Matrix);
    ARRAY(ball, "9 P C", Block);
    ARRAY(touch, "9+3 P C", Block);
    ARRAY(totals, "6 P C", Block);
    ARRAY(window, "2 C", View<const Index, 2>); // first step, and the step after the last
    ARRAY(drive, "9+5 C", Matrix);
    ARRAY(table, "t C", GivenMatrix);      // history of a drive given by samples at every fine step, else no rows
    ARRAY(travel, "2 e C", GivenBlock);    // such a base's displacement and velocity, where stops need it
    ARRAY(more, "H T", GivenMatrix);       // histories of the further loads at every fine step
    ARRAY(drives, "D F", GivenMatrix);     // the same of every drive; the first is the base, if it moves
    ARRAY(drive_place, "D", GivenIndices); // number of its load
    ARRAY(held_by_drive, "D", Array);      // load @ q at the last step
    ARRAY(work_of, "D+1", Array);          // J, of each drive and of constant accelerations
    ARRAY(ledger, "8 C", Matrix);
    ARRAY(v_before, "n C", Matrix);
    ARRAY(loss_of_mode, "m", Array);   // of a single case on its modes, else none
    ARRAY(to_modes, "P i", Matrix);    // energy that the open contacts of such a case have passed on, else none
    ARRAY(saved, "3 s C", Block);      // q, v and a at the start of a step that may be redone, else none
    ARRAY(saved_ball, "3 r C", Block); // y and its rates
    ARRAY(scratch, "3 n C", Block);
    FIELDS_END;
};

// Statistics per base cycle; the state before the first step is row 0 of `energy`.
struct Cycles {
    FIELDS_BEGIN;
    ARRAY(next_wrap, "C", View<Index, 1>); // step
    ARRAY(number, "C", View<Index, 1>);    // cycles finished
    ARRAY(period, "C", GivenArray);        // steps per cycle, a real number
    ARRAY(sums, "6 C", Matrix);
    ARRAY(last, "2 C", Matrix); // the observed place at the last step
    ARRAY(values, "K 6 C", Block);
    ARRAY(energy, "k 7 C", Block); // K + 1 rows, or one
    FIELDS_END;
};

// Samples, snapshots and impacts of case 0.
struct Record {
    FIELDS_BEGIN;
    ARRAY(used, "h 4", View<const Index, 2>); // 1 where a channel has a row of q, of v, of the balls, or of forces
    ARRAY(rows, "h 2 n", GivenBlock);         // of q and v
    ARRAY(pair_rows, "h 4 P", GivenBlock);    // of Y, Y_RATE, FORCE and of the force of contact
    ARRAY(channels, "h a", Matrix);           // (channels, samples)
    ARRAY(energy, "g d", Matrix);             // (columns and modes, samples)
    ARRAY(work_of, "D+1 S", Matrix);          // of drives and constant forces; no samples where there is one drive
    ARRAY(snapshots, "j 2 n+P", Block);       // displacements and velocities of each
    ARRAY(forces, "j P", Matrix);
    ARRAY(impacts, "q u", Matrix);     // (most, columns and modes)
    ARRAY(stride, "4", GivenIndices);  // every, first sample, snapshot stride, first snapshot
    ARRAY(tally, "4", View<Index, 1>); // step, samples, snapshots, impacts met
    FIELDS_END;
};

// A block of cases side by side: where they are, what is kept of them, and working space.
struct Cases {
    FIELDS_BEGIN;
    GROUP(pairs, Pairs);
    GROUP(motion, Motion);
    GROUP(cycles, Cycles);
    GROUP(record, Record);
    ARRAY(pair_scratch, "6 P", Matrix); // for the contact equations of one case
    ARRAY(energy_scratch, "7", Array);  // for the energies of one case
    FIELDS_END;
};

// A block with its method: what every function of the loop is handed.
struct Stepped {
    FIELDS_BEGIN;
    GROUP_AS("operator", structure, Operator);
    GROUP(scheme, Scheme);
    GROUP(cases, Cases);
    NUMBER(ledger, bool);
    FIELDS_END;
};

} // namespace FEMIMPACT_TARGET::stepping
