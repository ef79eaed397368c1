// What the loop over events works on: the arrays that it is handed, by name.
//
// Each line of a struct with fields is a member and its row in the table of names, types and shapes that Python hands
// arrays over by (see fields.hpp); a type in View<...> that is const is only read. The case axis comes first: each case
// is a separate run. In shapes C cases, F closed forms, K entries, P rigid-body coordinates, d coordinates (structure,
// then balls), n coordinates of the structure, R pairs, O outputs, N closed forms of the same contact parameters, B
// blocks, L knots, H loads s(t), D drives whose work is kept apart or none, S samples of a base cycle and one more; any
// other letter is a separate length. Rows of scalars: x of every pair, the contact force of every pair on the
// structure, then the outputs, the first of which is the observed place.
#pragma once

#include "../array.hpp"
#include "../columns.hpp"
#include "../contact/impulses.hpp"
#include "../fields.hpp"

namespace FEMIMPACT_TARGET {

// Contact states of a pair; the last two times the side of the wall. A rigid pair in contact sticks.
constexpr double FREE = 0.0, CONTACT = 1.0, SEPARATING = 2.0;

// How a case stands to its closed form: in it; to enter it with the coordinates it has; as a start whose contact states
// are found; the same with the motion of an earlier run in that form; or as a start whose contact states are still to
// be found.
ENUMERATION(ENTRY_NAMES, ENTERED, ENTERING, STARTED, RESUMED, STARTING);

// What a case stopped for: its end, a closed form not made before, a steady motion that is unbounded, or events that do
// not end.
ENUMERATION(STOP_NAMES, DONE, FORM_WANTED, RESONANT, UNENDING);

// Rows of Cases.touch, of a contact that has not ended: start (s), approach speed (m/s), impulse (N s), largest force
// (N), duration (s) and loss (J).
ENUMERATION(TOUCH_NAMES, BEGUN, TOUCH_SPEED, PUSHED, LARGEST_FORCE, LASTED, LOST);

using GivenFlags = View<const unsigned char, 1>;

// ---- scalars and motions ----------------------------------------------------------------------------

// Scalars read from a motion in closed form; the first 2R of them (gaps and contact forces) decide events.
struct Scalars {
    FIELDS_BEGIN;
    ARRAY(exponent, "K", GivenComplexArray);
    ARRAY(coupling, "K K", GivenComplexMatrix);  // above the diagonal of the blocks
    ARRAY(blocks, "B 2", View<const Index, 2>);  // first entry and number of entries of each; none where that is 0
    ARRAY(size, "K", GivenArray);                // |lambda|, or the norm of the block
    NUMBER(omega, double);                       // of the sine
    NUMBER(degree, Index);                       // of the pieces of s(t), each a polynomial; -1 for a sine
    ARRAY(rigid_body_given, "P", GivenArray);    // constant acceleration
    ARRAY(rigid_body_drive, "H P", GivenMatrix); // acceleration per unit of s(t); zero for a sine: that is in `sine`
    // side of a contact whose force is watched for its end, times STICKS if it sticks, else 0
    ARRAY(lasting, "2R", GivenArray);
    ARRAY(upper, "2R+1", Array); // the last two are those of the search for the peak
    ARRAY(lower, "2R+1", Array);
    ARRAY(weight, "2R+O K", GivenComplexMatrix);
    ARRAY(weight_size, "2R+O K", GivenMatrix);
    ARRAY(rigid_body_weight, "2R+O P", GivenMatrix);
    ARRAY(rigid_body_rate_weight, "2R+O P", GivenMatrix);
    ARRAY(sine, "2R+O", GivenComplexArray);
    ARRAY(constant, "2R+O", GivenArray);
    ARRAY(follow, "8H 2R+O", GivenMatrix); // steady motion under polynomials, per unit of what `drive` holds
    NUMBER(driven, Index); // entries, the slowest ones, that move under a polynomial; see `drive_entries`
    NUMBER(slow, Index);   // of these, the ones that constant loads drive too: their motions may grow for a time
    ARRAY(load, "3H K", GivenComplexMatrix); // what s, ub' and ub of each load add to the rate of each entry
    ARRAY(given, "K", GivenComplexArray);    // the same of constant loads and walls; zero behind the slow ones
    ARRAY(term, "K", ComplexArray);          // scratch
    ARRAY(growth, "K", ComplexArray);        // scratch
    FIELDS_END;
};

// Where the motion is: homogeneous part, rigid-body coordinates, time, a drive by pieces.
//
// The base's motion, if it moves, is the first load. Of a force ub and ub' are integrals of s that no load reads.
struct Motion {
    FIELDS_BEGIN;
    ARRAY(entry, "K", ComplexArray);
    ARRAY(rigid_body, "P", Array);
    ARRAY(rigid_body_rate, "P", Array);
    ARRAY(clock, "2", Array);  // time, phase of the sine at t = 0
    ARRAY(drive, "8H", Array); // of each load ub, ub', s and the derivatives of s to the fifth; zero for a sine
    FIELDS_END;
};

// Results of a search, and its scratch space; R pairs, K entries.
struct Search {
    FIELDS_BEGIN;
    ARRAY(leaving, "2R", Array); // side of a bound just left, or at which another bound was met at rest; else 0
    ARRAY(at_wall, "2R", Array); // side of the wall touched at this instant, else 0
    ARRAY(rate, "2R", Array);
    ARRAY(found, "5", Array);           // scratch
    ARRAY(size, "K", Array);            // |H|; see `measure`
    ARRAY(drift, "2 K", Matrix);        // of driven entries: |H''|, and how far H'' changes; see `measure`
    ARRAY(power, "3 K", ComplexMatrix); // H', H'' of driven entries, and scratch
    ARRAY(event, "2", Array);           // scalar, side
    ARRAY(negligible, "1", Array);      // m/s, see `negligible_approach`
    FIELDS_END;
};

// What `next_event` is handed where it is called alone.
struct SearchCall {
    FIELDS_BEGIN;
    GROUP(scalars, Scalars);
    GROUP(motion, Motion);
    GROUP(search, Search);
    FIELDS_END;
};

// ---- closed forms -----------------------------------------------------------------------------------

// Closed forms, one for each set of pairs in contact; on which side they are enters by the walls.
struct Forms {
    FIELDS_BEGIN;
    NUMBER(made, Index);                 // number of forms; another thread may be adding more, not to be seen here
    ARRAY(key, "F", GivenIndices);       // bit j is set where pair j is in contact
    ARRAY(following, "F", GivenIndices); // the next form for the same contact parameters, -1 for none
    ARRAY(number, "F", GivenIndices);    // among those of the same contact parameters
    ARRAY(entries, "F", GivenIndices);
    ARRAY(rigid_bodies, "F", GivenIndices);
    ARRAY(driven, "F", GivenIndices); // see Scalars
    ARRAY(slow, "F", GivenIndices);
    ARRAY(exponent, "F K", GivenComplexMatrix);
    ARRAY(coupling, "F K K", View<const Complex, 3>); // see Scalars
    ARRAY(blocks, "F B 2", View<const Index, 3>);
    ARRAY(size, "F K", GivenMatrix);
    ARRAY(rigid_body_given, "F P R+1", View<const double, 3>); // of a unit load, and per m of each wall
    ARRAY(rigid_body_drive, "F H P", View<const double, 3>);
    ARRAY(weight, "F 2R+O K", View<const Complex, 3>);
    ARRAY(weight_size, "F 2R+O K", View<const double, 3>);
    ARRAY(rigid_body_weight, "F 2R+O P", View<const double, 3>);
    ARRAY(rigid_body_rate_weight, "F 2R+O P", View<const double, 3>);
    ARRAY(constant, "F 2R+O R+1", View<const double, 3>);
    ARRAY(through, "F 3H 2R+O", View<const double, 3>); // directly of s, ub' and ub
    ARRAY(follow, "F 8H 2R+O", View<const double, 3>);  // see Scalars
    ARRAY(shape, "F d K", View<const Complex, 3>);
    ARRAY(shape_rate, "F d K", View<const Complex, 3>);
    ARRAY(rigid_body_shape, "F d P", View<const double, 3>);
    ARRAY_AS("static", static_part, "F d R+1", View<const double, 3>);
    ARRAY(static_rate, "F d R+1", View<const double, 3>); // of a coordinate that slow and other entries move
    ARRAY(position_through, "F d", GivenMatrix);          // directly of ub
    ARRAY(position_follow, "F 8H d", View<const double, 3>);
    ARRAY(velocity_follow, "F 8H d", View<const double, 3>);
    ARRAY(load, "F 3H K", View<const Complex, 3>);   // what s, ub' and ub add to the rate of each entry
    ARRAY(given, "F K R+1", View<const Complex, 3>); // and constant loads, and per m of each wall
    ARRAY(to_entry_u, "F K d", View<const Complex, 3>);
    ARRAY(to_entry_v, "F K d", View<const Complex, 3>);
    ARRAY(to_rigid_body, "F P d", View<const double, 3>);
    ARRAY(impulse_entry, "F K R", View<const Complex, 3>); // what a unit impulse on the structure at a pair adds
    ARRAY(impulse_rigid_body, "F P R", View<const double, 3>);
    ARRAY(together, "F K K", View<const unsigned char, 3>); // whether the product of two terms occurs in the ledger
    ARRAY(first, "F d+1", View<const Index, 2>); // entries that move coordinate i: members[first[i]:first[i + 1]]
    ARRAY(members, "F dK", View<const Index, 2>);
    FIELDS_END;
};

// ---- cases ------------------------------------------------------------------------------------------

// Contact pairs, as far as all cases have them in common.
struct Pairs {
    FIELDS_BEGIN;
    ARRAY(direction, "R d", GivenMatrix); // of a force on the structure
    ARRAY(in_space, "R", GivenArray);     // -1 for a stop that does not move with the base, whose x is w + ub; else 0
    ARRAY(rigid, "R", GivenFlags);        // whether the law is that of rigid impacts
    ARRAY(mobility, "R R", GivenMatrix);  // change of x_i' by a unit impulse on the structure at j
    NUMBER(closure, double);              // m
    FIELDS_END;
};

// Inputs and present state of every case.
struct Cases {
    FIELDS_BEGIN;
    ARRAY(omega, "C", GivenArray);
    ARRAY(amplitude, "C H", GivenComplexMatrix); // of each load; that of the first one is real
    ARRAY(knots, "L", GivenArray);               // s, where the pieces of s(t) begin, rising; none for a sine
    ARRAY(pieces, "L 8H", GivenMatrix);          // what `Motion.drive` is at the beginning of each piece
    NUMBER(degree, Index);                       // of the pieces; see Scalars
    NUMBER(longest, double);                     // s, for which the series of `drive_entries` serves
    ARRAY(gap_plus, "C R", GivenMatrix);
    ARRAY(gap_minus, "C R", GivenMatrix);
    ARRAY(stiffness, "C R", GivenMatrix);
    ARRAY(damping, "C R", GivenMatrix);
    ARRAY(restitution, "C R", GivenMatrix);
    ARRAY(over_speed, "C R 4V", View<const double, 3>); // see `restitution_of`
    ARRAY(state, "C R", Matrix);
    ARRAY(form, "C 2", View<Index, 2>); // the first form for the case's contact parameters, the present one
    ARRAY(entry, "C K", ComplexMatrix);
    ARRAY(rigid_body, "C 2 P", View<double, 3>);  // and their rates
    ARRAY(clock, "C 2", Matrix);                  // see Motion
    ARRAY(drive, "C 8H", Matrix);                 // see Motion
    ARRAY(piece, "C", View<Index, 1>);            // number of the present piece
    ARRAY(coordinates, "C 2 d", View<double, 3>); // displacements and velocities where a form is to be entered
    ARRAY(entering, "C", View<Index, 1>);         // ENTERED, or what is to be done first
    ARRAY(leaving, "C 2R", Matrix);               // see Search
    ARRAY(hit, "C", Array);             // number from 1 of the pair that meets a rigid wall now, times its side; else 0
    ARRAY(released, "C R", Matrix);     // side of a sticking pair that an impact has let go at this instant
    ARRAY(sample, "C", View<Index, 1>); // samples taken since the start
    ARRAY(events, "C 2", View<Index, 2>);        // in this call, and at one instant
    ARRAY(known, "C N", View<unsigned char, 2>); // whether the steady motion in a form is known
    ARRAY(sine, "C N 2R+O", View<Complex, 3>);   // steady motion of the scalars
    ARRAY(harmonic, "C N d", View<Complex, 3>);  // of the coordinates
    ARRAY(rigid_body_sine, "C N P", View<Complex, 3>);
    ARRAY(touch, "C 6 R", View<double, 3>);    // contacts that have not ended; see BEGUN
    ARRAY(to_modes, "C R m", View<double, 3>); // J, what these have given to each mode; m is n or 0
    ARRAY(window, "C 2", GivenMatrix);       // s, of which the totals are: impacts that end in it, and the forces in it
    ARRAY(totals, "C 6 R", View<double, 3>); // sums over them; see COUNT
    FIELDS_END;
};

// One case: its drive, its contacts, and their states.
struct Case {
    const Cases &all;
    Index number;
    double omega = all.omega(number);                          // of the sine; 0 for pieces
    GivenComplexArray amplitude = all.amplitude.row(number);   // (H,) of s(t): m/s^2 or N
    GivenArray knots = all.knots;                              // (L,)
    View<Index, 1> piece = all.piece.part(number, number + 1); // (1,) number of the present one
    GivenArray gap_plus = all.gap_plus.row(number);            // (R,) m, to the + wall
    GivenArray gap_minus = all.gap_minus.row(number);          // (R,) m, to the - wall
    GivenArray stiffness = all.stiffness.row(number);          // (R,)
    GivenArray damping = all.damping.row(number);              // (R,)
    GivenArray restitution = all.restitution.row(number);      // (R,)
    GivenMatrix over_speed = all.over_speed.row(number);       // (R, 4V)
    Array state = all.state.row(number);                       // (R,) contact states
    Array released = all.released.row(number);                 // (R,)
    Matrix coordinates = all.coordinates.row(number);          // (2, d)
    Matrix touch = all.touch.row(number);                      // (6, R)
    Matrix to_modes = all.to_modes.row(number);                // (R, m)
    GivenArray window = all.window.row(number);                // (2,)
    Matrix totals = all.totals.row(number);                    // (6, R)
};

// ---- what is read and written -----------------------------------------------------------------------

// Grid of times, and the values read on it.
struct Grid {
    FIELDS_BEGIN;
    ARRAY(start, "C", GivenArray);     // s, of sample 0
    ARRAY(interval, "C", GivenArray);  // s
    NUMBER(per_cycle, double);         // samples, not always an integer
    ARRAY(origin, "C", GivenIndices);  // sample with which the first cycle begins
    ARRAY(cycle, "C", View<Index, 1>); // cycle whose peak is being looked for
    // largest, smallest, sums of w^2, w sin and w cos, samples, and the times of the extremes (s) of each cycle
    ARRAY(cycles, "C y 8", View<double, 3>);
    ARRAY(values, "C x O", View<double, 3>); // or (C, 0, O) where only cycles are wanted
    ARRAY(kept, "k", GivenIndices);          // number of the energy row that a sample fills, -1 for none
    ARRAY(energy, "C e n+7", View<double, 3>);
    ARRAY(work_of, "C w D+1", View<double, 3>); // beside these, of each drive and of constant forces; w is e or 0
    FIELDS_END;
};

// Displacements and velocities of all coordinates of a single case at some samples.
struct Snapshots {
    FIELDS_BEGIN;
    ARRAY(shown, "s", GivenIndices); // number of the snapshot, -1 for none; no samples where none is wanted
    ARRAY_AS("fields", fields_of, "f 2 d", View<double, 3>);
    ARRAY(forces, "f R", Matrix); // N on the structure
    FIELDS_END;
};

// Impacts and sticking phases of a single case, and the events of every case, one row each; those beyond the last row
// are counted.
struct Tables {
    FIELDS_BEGIN;
    ARRAY(impacts, "i n+9", Matrix);              // see `end_contact`, then the energy given to each mode
    ARRAY(sticking, "j 5", Matrix);               // pair, side, start and end (s), impulse (N s)
    ARRAY(number, "2", View<Index, 1>);           // rows of both
    ARRAY(events, "C l R+2d+5", View<double, 3>); // see `write_event`; without rows none is counted
    ARRAY(logged, "C", View<Index, 1>);           // rows of each case
    FIELDS_END;
};

// Coefficients of the equations for the ledger, and its sums of every case; n coordinates of structure.
struct Ledger {
    FIELDS_BEGIN;
    ARRAY(mass, "d", GivenArray);
    ARRAY(damping, "d", GivenArray);
    ARRAY(stiffness, "d", GivenArray);
    ARRAY(load, "d", GivenArray);  // per unit of s(t)
    ARRAY(given, "d", GivenArray); // N
    ARRAY(free_stiffness, "R", GivenArray);
    ARRAY(free_damping, "R", GivenArray);
    ARRAY(work, "C", Array);            // J
    ARRAY(contact_loss, "C", Array);    // J
    ARRAY(rounding, "C", Array);        // J, what rounding may have made of the energies of contacts
    ARRAY(loss_of_mode, "C n", Matrix); // J
    ARRAY(start, "C n+7", Matrix);      // energies that a case starts with
    NUMBER(everywhere, bool);           // or only through compliant contacts, for the table of impacts
    // of each drive where there are several, of which some may act along one load; the first is the base, if it moves
    ARRAY(drive_load, "D d", GivenMatrix);
    ARRAY(drive_amplitude, "D", GivenComplexArray); // as Cases.amplitude
    ARRAY(drive_pieces, "g 6D", GivenMatrix);       // s and its derivatives as in Cases.pieces; g is L or 0
    ARRAY(work_of, "C D+1", Matrix);                // J, of each and of constant forces
    FIELDS_END;
};

// Cases of a call, the samples to which it takes them, and why each stopped.
struct Task {
    FIELDS_BEGIN;
    ARRAY(members, "M", GivenIndices);   // cases
    ARRAY(begin, "C", GivenIndices);     // samples after which is read
    ARRAY(end, "C", GivenIndices);       // samples to which is gone
    ARRAY(most, "C", GivenArray);        // events allowed in all
    ARRAY(stopped, "C", View<Index, 1>); // what each one stopped for; see DONE
    FIELDS_END;
};

// ---- working space ----------------------------------------------------------------------------------

// Working space for integrals of products: T terms of a motion, its entries, its sine, and what is constant.
struct Products {
    FIELDS_BEGIN;
    ARRAY(before, "2 d", Matrix);
    ARRAY(after, "2 d", Matrix);
    ARRAY(strength, "d+R K+2", ComplexMatrix); // T = K + 2
    ARRAY(growth, "K+2", ComplexArray);
    ARRAY(plus, "K+2 K+2", ComplexMatrix);
    ARRAY(minus, "K+2 K+2", ComplexMatrix);
    ARRAY(moments, "K 6", ComplexMatrix); // integrals of powers of the time times e^{mu s}; see `set_moments`
    ARRAY(rates, "d 9+9+6", Matrix);      // Taylor series of what driven entries move
    FIELDS_END;
};

// Bounds and constant parts of the scalars, from the present contact states and walls.
struct Bounds {
    FIELDS_BEGIN;
    ARRAY(upper, "2R+1", Array);
    ARRAY(lower, "2R+1", Array);
    ARRAY(lasting, "2R", Array);
    ARRAY(constant, "2R+O", Array);
    ARRAY_AS("static", static_part, "d", Array);
    ARRAY(static_rate, "d", Array);
    ARRAY(given, "P", Array);
    ARRAY(entry_given, "K", ComplexArray);
    ARRAY(nothing, "H P", GivenMatrix);  // zero
    ARRAY(wall, "R+1", Array);           // 1, then side times gap of each pair in contact or separating
    ARRAY(steady, "2 K", ComplexMatrix); // scratch
    FIELDS_END;
};

// Working space of one thread.
struct Space {
    FIELDS_BEGIN;
    GROUP(motion, Motion); // of the present case
    GROUP(begin, Motion);  // where the present closed form began
    GROUP(trial, Motion);
    GROUP(mark, Motion);       // up to where the ledger is written
    GROUP(scratch, Motion);    // advanced to read the motion at other instants
    GROUP(peak_trial, Motion); // the same, to an estimate of a peak, or to the end of a cycle
    GROUP(search, Search);
    GROUP(bounds, Bounds);
    GROUP(products, Products);
    GROUP(impulses, Impulses);
    ARRAY(turn, "K", ComplexArray); // growth of the entries between two samples
    ARRAY(impulse, "R", Array);
    ARRAY(row, "R", View<Index, 1>); // in the table, or behind it, of the last impact of each pair
    ARRAY(samples, "S", Array);      // w of the cycle that goes on, as far as it is read
    ARRAY(extremes, "8", Array);     // extremes of a contact force and their times, as in a row of `Grid.cycles`
    FIELDS_END;
};

// All that one call is given but the ledger, which a call may lack.
struct Job {
    FIELDS_BEGIN;
    GROUP(pairs, Pairs);
    GROUP(cases, Cases);
    GROUP(forms, Forms);
    GROUP(grid, Grid);
    GROUP(snapshots, Snapshots);
    GROUP(tables, Tables);
    GROUP(space, Space);
    FIELDS_END;
};

} // namespace FEMIMPACT_TARGET
