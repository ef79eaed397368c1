// What the loop over events works on: the arrays that it is handed, by name.
//
// The functions `fields` are the table of names, types and shapes that Python hands arrays over by; a type in View<...>
// that is const is only read. The case axis comes first: each case is a separate run. In shapes C cases, F closed
// forms, K entries, P rigid-body coordinates, d coordinates (structure, then balls), n coordinates of the structure,
// R pairs, O outputs, N closed forms of the same contact parameters, B blocks, L knots, S samples of a base cycle and
// one more; any other letter is a separate length. Rows of scalars: x of every pair, the contact force of every pair
// on the structure, then the outputs, the first of which is the observed place.
#pragma once

#include "../array.hpp"
#include "../columns.hpp"

namespace FEMIMPACT_TARGET {

// Contact states of a pair; the last two times the side of the wall. A rigid pair in contact sticks.
constexpr double FREE = 0.0, CONTACT = 1.0, SEPARATING = 2.0;

// How a case stands to its closed form: in it; to enter it with the coordinates it has; as a start whose contact states
// are found; the same with the motion of an earlier run in that form; or as a start whose contact states are still to
// be found.
enum : Index { ENTERED, ENTERING, STARTED, RESUMED, STARTING };

// What a contact that has not ended adds up to: start (s), approach speed (m/s), impulse (N s), largest force (N),
// duration (s) and loss (J).
enum : Index { BEGUN, TOUCH_SPEED, PUSHED, LARGEST_FORCE, LASTED, LOST };

using GivenFlags = View<const unsigned char, 1>;

// ---- scalars and motions ----------------------------------------------------------------------------

// Scalars read from a motion in closed form; the first 2R of them (gaps and contact forces) decide events.
struct Scalars {
    GivenComplexArray exponent;  // (K,)
    GivenComplexMatrix coupling; // (K, K), above the diagonal of the blocks
    View<const Index, 2> blocks; // (B, 2) first entry and number of entries of each; none where that is 0
    GivenArray size;             // (K,) |lambda|, or the norm of the block
    double omega;                // of the sine
    Index degree;                // of the pieces of s(t), each a polynomial; -1 for a sine
    GivenArray rigid_body_given; // (P,) constant acceleration
    GivenArray rigid_body_drive; // (P,) acceleration per unit of s(t); zero for a sine: that is in `sine`
    GivenArray lasting; // (2R,) side of a contact whose force is watched for its end, times STICKS if it sticks, else 0
    Array upper;        // (2R + 1,); the last two are those of the search for the peak
    Array lower;        // (2R + 1,)
    GivenComplexMatrix weight;          // (2R + O, K)
    GivenMatrix weight_size;            // (2R + O, K)
    GivenMatrix rigid_body_weight;      // (2R + O, P)
    GivenMatrix rigid_body_rate_weight; // (2R + O, P)
    GivenComplexArray sine;             // (2R + O,)
    GivenArray constant;                // (2R + O,)
    GivenMatrix follow;                 // (8, 2R + O) steady motion under a polynomial, per unit of what `drive` holds
    Index driven;                       // entries, the slowest ones, that move under a polynomial; see `drive_entries`
    GivenComplexMatrix load;            // (3, K) what s, ub' and ub add to the rate of each entry
    ComplexArray term;                  // (K,) scratch
    ComplexArray growth;                // (K,) scratch

    template <class Visitor> void fields(Visitor &visit) {
        visit("exponent", exponent, "K");
        visit("coupling", coupling, "K K");
        visit("blocks", blocks, "B 2");
        visit("size", size, "K");
        visit("omega", omega);
        visit("degree", degree);
        visit("rigid_body_given", rigid_body_given, "P");
        visit("rigid_body_drive", rigid_body_drive, "P");
        visit("lasting", lasting, "2R");
        visit("upper", upper, "2R+1");
        visit("lower", lower, "2R+1");
        visit("weight", weight, "2R+O K");
        visit("weight_size", weight_size, "2R+O K");
        visit("rigid_body_weight", rigid_body_weight, "2R+O P");
        visit("rigid_body_rate_weight", rigid_body_rate_weight, "2R+O P");
        visit("sine", sine, "2R+O");
        visit("constant", constant, "2R+O");
        visit("follow", follow, "8 2R+O");
        visit("driven", driven);
        visit("load", load, "3 K");
        visit("term", term, "K");
        visit("growth", growth, "K");
    }
};

// Where the motion is: homogeneous part, rigid-body coordinates, time, a drive by pieces.
struct Motion {
    ComplexArray entry;    // (K,)
    Array rigid_body;      // (P,)
    Array rigid_body_rate; // (P,)
    Array clock;           // (2,): time, phase of the sine at t = 0
    Array drive;           // (8,): ub, ub', s and the derivatives of s to the fifth; zero for a sine

    template <class Visitor> void fields(Visitor &visit) {
        visit("entry", entry, "K");
        visit("rigid_body", rigid_body, "P");
        visit("rigid_body_rate", rigid_body_rate, "P");
        visit("clock", clock, "2");
        visit("drive", drive, "8");
    }
};

// What a search leaves behind, and its scratch space: R pairs, K entries.
struct Search {
    Array leaving;       // (2R,) side of a bound just left, or at which another bound was met at rest; else 0
    Array at_wall;       // (2R,) side of the wall touched at this instant, else 0
    Array rate;          // (2R,)
    Array found;         // (5,) scratch
    Array size;          // (K,) |H|; see `measure`
    Matrix drift;        // (2, K) of driven entries: |H''|, and how far H'' changes; see `measure`
    ComplexMatrix power; // (3, K): H', H'' of driven entries, and scratch
    Array event;         // (2,): scalar, side
    Array negligible;    // (1,) m/s, see `negligible_approach`

    template <class Visitor> void fields(Visitor &visit) {
        visit("leaving", leaving, "2R");
        visit("at_wall", at_wall, "2R");
        visit("rate", rate, "2R");
        visit("found", found, "5");
        visit("size", size, "K");
        visit("drift", drift, "2 K");
        visit("power", power, "3 K");
        visit("event", event, "2");
        visit("negligible", negligible, "1");
    }
};

// What `next_event` is handed where it is called alone.
struct SearchCall {
    Scalars scalars;
    Motion motion;
    Search search;

    template <class Visitor> void fields(Visitor &visit) {
        visit.group("scalars", scalars);
        visit.group("motion", motion);
        visit.group("search", search);
    }
};

// ---- closed forms -----------------------------------------------------------------------------------

// Closed forms, one for each set of pairs in contact; on which side they are enters by the walls.
struct Forms {
    Index made;                              // number of forms; another thread may be adding more, not to be seen here
    GivenIndices key;                        // (F,) bit j is set where pair j is in contact
    GivenIndices following;                  // (F,) the next form for the same contact parameters, -1 for none
    GivenIndices number;                     // (F,) among those of the same contact parameters
    GivenIndices entries;                    // (F,)
    GivenIndices rigid_bodies;               // (F,)
    GivenIndices driven;                     // (F,) see Scalars
    GivenComplexMatrix exponent;             // (F, K)
    View<const Complex, 3> coupling;         // (F, K, K); see Scalars
    View<const Index, 3> blocks;             // (F, B, 2)
    GivenMatrix size;                        // (F, K)
    View<const double, 3> rigid_body_given;  // (F, P, 1 + R) of a unit load, and per m of each wall
    GivenMatrix rigid_body_drive;            // (F, P)
    View<const Complex, 3> weight;           // (F, 2R + O, K)
    View<const double, 3> weight_size;       // (F, 2R + O, K)
    View<const double, 3> rigid_body_weight; // (F, 2R + O, P)
    View<const double, 3> rigid_body_rate_weight; // (F, 2R + O, P)
    View<const double, 3> constant;               // (F, 2R + O, 1 + R)
    View<const double, 3> through;                // (F, 3, 2R + O) directly of s, ub' and ub
    View<const double, 3> follow;                 // (F, 8, 2R + O) see Scalars
    View<const Complex, 3> shape;                 // (F, d, K)
    View<const Complex, 3> shape_rate;            // (F, d, K)
    View<const double, 3> rigid_body_shape;       // (F, d, P)
    View<const double, 3> static_part;            // (F, d, 1 + R)
    GivenMatrix position_through;                 // (F, d) directly of ub
    View<const double, 3> position_follow;        // (F, 8, d)
    View<const double, 3> velocity_follow;        // (F, 8, d)
    View<const Complex, 3> load;                  // (F, 3, K): what s, ub' and ub add to the rate of each entry
    View<const Complex, 3> to_entry_u;            // (F, K, d)
    View<const Complex, 3> to_entry_v;            // (F, K, d)
    View<const double, 3> to_rigid_body;          // (F, P, d)
    View<const Complex, 3> impulse_entry;         // (F, K, R): what a unit impulse on the structure at a pair adds
    View<const double, 3> impulse_rigid_body;     // (F, P, R)
    View<const double, 3> reaction;        // (F, R, R) impulses at the pairs that stick (rows) by a unit one elsewhere
    View<const unsigned char, 3> together; // (F, K, K) whether the product of two terms occurs in the ledger
    View<const Index, 2> first;            // (F, d + 1) entries that move coordinate i: members[first[i]:first[i + 1]]
    View<const Index, 2> members;          // (F, d K)

    template <class Visitor> void fields(Visitor &visit) {
        visit("made", made);
        visit("key", key, "F");
        visit("following", following, "F");
        visit("number", number, "F");
        visit("entries", entries, "F");
        visit("rigid_bodies", rigid_bodies, "F");
        visit("driven", driven, "F");
        visit("exponent", exponent, "F K");
        visit("coupling", coupling, "F K K");
        visit("blocks", blocks, "F B 2");
        visit("size", size, "F K");
        visit("rigid_body_given", rigid_body_given, "F P R+1");
        visit("rigid_body_drive", rigid_body_drive, "F P");
        visit("weight", weight, "F 2R+O K");
        visit("weight_size", weight_size, "F 2R+O K");
        visit("rigid_body_weight", rigid_body_weight, "F 2R+O P");
        visit("rigid_body_rate_weight", rigid_body_rate_weight, "F 2R+O P");
        visit("constant", constant, "F 2R+O R+1");
        visit("through", through, "F 3 2R+O");
        visit("follow", follow, "F 8 2R+O");
        visit("shape", shape, "F d K");
        visit("shape_rate", shape_rate, "F d K");
        visit("rigid_body_shape", rigid_body_shape, "F d P");
        visit("static", static_part, "F d R+1");
        visit("position_through", position_through, "F d");
        visit("position_follow", position_follow, "F 8 d");
        visit("velocity_follow", velocity_follow, "F 8 d");
        visit("load", load, "F 3 K");
        visit("to_entry_u", to_entry_u, "F K d");
        visit("to_entry_v", to_entry_v, "F K d");
        visit("to_rigid_body", to_rigid_body, "F P d");
        visit("impulse_entry", impulse_entry, "F K R");
        visit("impulse_rigid_body", impulse_rigid_body, "F P R");
        visit("reaction", reaction, "F R R");
        visit("together", together, "F K K");
        visit("first", first, "F d+1");
        visit("members", members, "F dK");
    }
};

// How coordinates are read from the motion in one closed form.
struct Shapes {
    double omega;
    GivenComplexMatrix shape;      // (d, K)
    GivenComplexMatrix shape_rate; // (d, K)
    GivenMatrix rigid_body_shape;  // (d, P)
    GivenArray static_part;        // (d,)
    GivenComplexArray harmonic;    // (d,)
    GivenMatrix follow;            // (8, d)
    GivenMatrix follow_rate;       // (8, d)
    Index degree;                  // see Scalars
    GivenIndices first;            // (d + 1,)
    GivenIndices members;          // (d K,)
    Index rigid_bodies;
};

// The closed form that a case is in, with what its own drive and walls make of it.
struct Form {
    Scalars scalars;
    Shapes shapes;
    View<const unsigned char, 2> together; // (K, K)
    GivenComplexArray rigid_body_sine;     // (P,)
    GivenComplexMatrix impulse_entry;      // (K, R)
    GivenMatrix impulse_rigid_body;        // (P, R)
    GivenMatrix reaction;                  // (R, R)
    GivenMatrix load_on_rigid_body;        // (P, 1 + R)
};

// ---- cases ------------------------------------------------------------------------------------------

// What all cases have in common.
struct Pairs {
    GivenMatrix direction; // (R, d) of a force on the structure
    GivenArray in_space;   // (R,) -1 for a stop that does not move with the base, whose x is w + ub; else 0
    GivenFlags rigid;      // (R,) whether the law is that of rigid impacts
    GivenMatrix mobility;  // (R, R) change of x_i' by a unit impulse on the structure at j
    double closure;        // m

    template <class Visitor> void fields(Visitor &visit) {
        visit("direction", direction, "R d");
        visit("in_space", in_space, "R");
        visit("rigid", rigid, "R");
        visit("mobility", mobility, "R R");
        visit("closure", closure);
    }
};

// What every case is given, and where it is.
struct Cases {
    GivenArray omega;             // (C,)
    GivenArray amplitude;         // (C,)
    GivenArray knots;             // (L,) s, where the pieces of s(t) begin, rising; none for a sine
    GivenMatrix pieces;           // (L, 8) what `Motion.drive` is at the beginning of each piece
    Index degree;                 // of the pieces; see Scalars
    double longest;               // s, for which the series of `drive_entries` serves
    GivenMatrix gap_plus;         // (C, R)
    GivenMatrix gap_minus;        // (C, R)
    GivenMatrix stiffness;        // (C, R)
    GivenMatrix damping;          // (C, R)
    GivenMatrix restitution;      // (C, R)
    Matrix state;                 // (C, R)
    View<Index, 2> form;          // (C, 2) the first form for the case's contact parameters, the present one
    ComplexMatrix entry;          // (C, K)
    View<double, 3> rigid_body;   // (C, 2, P) and their rates
    Matrix clock;                 // (C, 2) see Motion
    Matrix drive;                 // (C, 8) see Motion
    View<Index, 1> piece;         // (C,) number of the present piece
    View<double, 3> coordinates;  // (C, 2, d) displacements and velocities where a form is to be entered
    View<Index, 1> entering;      // (C,) ENTERED, or what is to be done first
    Matrix leaving;               // (C, 2R) see Search
    Array hit;                    // (C,) number from 1 of the pair that meets a rigid wall now, times its side; else 0
    Matrix released;              // (C, R) side of a sticking pair that an impact has let go at this instant
    View<Index, 1> sample;        // (C,) samples taken since the start
    View<Index, 2> events;        // (C, 2) in this call, and at one instant
    View<unsigned char, 2> known; // (C, N) whether the steady motion in a form is known
    View<Complex, 3> sine;        // (C, N, 2R + O): steady motion of the scalars
    View<Complex, 3> harmonic;    // (C, N, d): of the coordinates
    View<Complex, 3> rigid_body_sine; // (C, N, P)
    View<double, 3> touch;            // (C, 6, R) contacts that have not ended; see BEGUN
    View<double, 3> to_modes;         // (C, R, m) J, what these have given to each mode; m is n or 0
    GivenMatrix window;               // (C, 2) s, in which impacts are counted
    View<double, 3> totals;           // (C, 6, R) sums over them; see COUNT

    template <class Visitor> void fields(Visitor &visit) {
        visit("omega", omega, "C");
        visit("amplitude", amplitude, "C");
        visit("knots", knots, "L");
        visit("pieces", pieces, "L 8");
        visit("degree", degree);
        visit("longest", longest);
        visit("gap_plus", gap_plus, "C R");
        visit("gap_minus", gap_minus, "C R");
        visit("stiffness", stiffness, "C R");
        visit("damping", damping, "C R");
        visit("restitution", restitution, "C R");
        visit("state", state, "C R");
        visit("form", form, "C 2");
        visit("entry", entry, "C K");
        visit("rigid_body", rigid_body, "C 2 P");
        visit("clock", clock, "C 2");
        visit("drive", drive, "C 8");
        visit("piece", piece, "C");
        visit("coordinates", coordinates, "C 2 d");
        visit("entering", entering, "C");
        visit("leaving", leaving, "C 2R");
        visit("hit", hit, "C");
        visit("released", released, "C R");
        visit("sample", sample, "C");
        visit("events", events, "C 2");
        visit("known", known, "C N");
        visit("sine", sine, "C N 2R+O");
        visit("harmonic", harmonic, "C N d");
        visit("rigid_body_sine", rigid_body_sine, "C N P");
        visit("touch", touch, "C 6 R");
        visit("to_modes", to_modes, "C R m");
        visit("window", window, "C 2");
        visit("totals", totals, "C 6 R");
    }
};

// One case: its drive, its contacts, and their states.
struct Case {
    Index number;
    double omega;           // of the sine; 0 for pieces
    double amplitude;       // of s(t): m/s^2 or N
    GivenArray gap_plus;    // (R,) m, to the + wall
    GivenArray gap_minus;   // (R,) m, to the - wall
    GivenArray stiffness;   // (R,)
    GivenArray damping;     // (R,)
    GivenArray restitution; // (R,)
    Array state;            // (R,) contact states
    Array released;         // (R,)
    Matrix coordinates;     // (2, d)
    Matrix touch;           // (6, R)
    Matrix to_modes;        // (R, m)
    GivenArray window;      // (2,)
    Matrix totals;          // (6, R)
};

// ---- what is read and written -----------------------------------------------------------------------

// What is read on a grid of times.
struct Grid {
    GivenArray start;       // (C,) s, of sample 0
    GivenArray interval;    // (C,) s
    double per_cycle;       // samples, which need not be whole
    GivenIndices origin;    // (C,) sample with which the first cycle begins
    View<Index, 1> cycle;   // (C,) cycle whose peak is being looked for
    View<double, 3> cycles; // (C, y, 8): largest, smallest, sums of w^2, w sin and w cos, samples, and the times of the
                            // extremes (s) of each cycle
    View<double, 3> values; // (C, x, O), or (C, 0, O) where only cycles are wanted
    GivenIndices kept;      // (k,) number of the energy row that a sample fills, -1 for none
    View<double, 3> energy; // (C, e, 7 + n)

    template <class Visitor> void fields(Visitor &visit) {
        visit("start", start, "C");
        visit("interval", interval, "C");
        visit("per_cycle", per_cycle);
        visit("origin", origin, "C");
        visit("cycle", cycle, "C");
        visit("cycles", cycles, "C y 8");
        visit("values", values, "C x O");
        visit("kept", kept, "k");
        visit("energy", energy, "C e n+7");
    }
};

// Whole motions of a single case.
struct Snapshots {
    GivenIndices shown;        // (s,) number of the snapshot, -1 for none; no samples where none is wanted
    View<double, 3> fields_of; // (f, 2, d)
    Matrix forces;             // (f, R) N on the structure

    template <class Visitor> void fields(Visitor &visit) {
        visit("shown", shown, "s");
        visit("fields", fields_of, "f 2 d");
        visit("forces", forces, "f R");
    }
};

// Impacts and sticking phases of a single case, one row each; those beyond the last row are counted.
struct Tables {
    Matrix impacts;        // (i, 9 + n); see `end_contact`, then the energy given to each mode
    Matrix sticking;       // (j, 5): pair, side, start and end (s), impulse (N s)
    View<Index, 1> number; // (2,) rows of both

    template <class Visitor> void fields(Visitor &visit) {
        visit("impacts", impacts, "i n+9");
        visit("sticking", sticking, "j 5");
        visit("number", number, "2");
    }
};

// What the ledger needs of the equations, and what it has summed of every case; n coordinates of structure.
struct Ledger {
    GivenArray mass;           // (d,)
    GivenArray damping;        // (d,)
    GivenArray stiffness;      // (d,)
    GivenArray load;           // (d,) per unit of s(t)
    GivenArray given;          // (d,) N
    GivenArray free_stiffness; // (R,)
    Array work;                // (C,) J
    Array contact_loss;        // (C,) J
    Array rounding;            // (C,) J, what rounding may have made of the energies of contacts
    Matrix loss_of_mode;       // (C, n) J
    Matrix start;              // (C, 7 + n) energies that a case starts with
    bool everywhere;           // or only through compliant contacts, for the table of impacts

    template <class Visitor> void fields(Visitor &visit) {
        visit("mass", mass, "d");
        visit("damping", damping, "d");
        visit("stiffness", stiffness, "d");
        visit("load", load, "d");
        visit("given", given, "d");
        visit("free_stiffness", free_stiffness, "R");
        visit("work", work, "C");
        visit("contact_loss", contact_loss, "C");
        visit("rounding", rounding, "C");
        visit("loss_of_mode", loss_of_mode, "C n");
        visit("start", start, "C n+7");
        visit("everywhere", everywhere);
    }
};

// ---- working space ----------------------------------------------------------------------------------

// Working space for integrals of products: T terms of a motion, its entries, its sine, and what is constant.
struct Products {
    Matrix before;          // (2, d)
    Matrix after;           // (2, d)
    ComplexMatrix strength; // (d + R, T), T = K + 2
    ComplexArray growth;    // (T,)
    ComplexMatrix plus;     // (T, T)
    ComplexMatrix minus;    // (T, T)
    ComplexMatrix moments;  // (K, 6) see `set_moments`
    Matrix rates;           // (d, 24) Taylor series of what driven entries move

    template <class Visitor> void fields(Visitor &visit) {
        visit("before", before, "2 d");
        visit("after", after, "2 d");
        visit("strength", strength, "d+R K+2");
        visit("growth", growth, "K+2");
        visit("plus", plus, "K+2 K+2");
        visit("minus", minus, "K+2 K+2");
        visit("moments", moments, "K 6");
        visit("rates", rates, "d 9+9+6");
    }
};

// Bounds and constant parts of the scalars, from the present contact states and walls.
struct Bounds {
    Array upper;          // (2R + 1,)
    Array lower;          // (2R + 1,)
    Array lasting;        // (2R,)
    Array constant;       // (2R + O,)
    Array static_part;    // (d,)
    Array given;          // (P,)
    GivenArray nothing;   // (P,) zero
    Array wall;           // (1 + R,) 1, then side times gap of each pair in contact or separating
    ComplexMatrix steady; // (2, K) scratch

    template <class Visitor> void fields(Visitor &visit) {
        visit("upper", upper, "2R+1");
        visit("lower", lower, "2R+1");
        visit("lasting", lasting, "2R");
        visit("constant", constant, "2R+O");
        visit("static", static_part, "d");
        visit("given", given, "P");
        visit("nothing", nothing, "P");
        visit("wall", wall, "R+1");
        visit("steady", steady, "2 K");
    }
};

// Working space of one thread.
struct Space {
    Motion motion; // of the present case
    Motion begin;  // where the present closed form began
    Motion trial;
    Motion mark; // up to where the ledger is written
    Motion spare;
    Motion crest;
    Search search;
    Bounds bounds;
    Products products;
    ComplexArray turn;  // (K,) growth of the entries between two samples
    Array impulse;      // (R,)
    View<Index, 1> row; // (R,) in the table, or behind it, of the last impact of each pair
    Array samples;      // (S,) w of the cycle that goes on, as far as it is read
    Array extremes;     // (8,) extremes of a contact force and their times, as in a row of `Grid.cycles`

    template <class Visitor> void fields(Visitor &visit) {
        visit.group("motion", motion);
        visit.group("begin", begin);
        visit.group("trial", trial);
        visit.group("mark", mark);
        visit.group("spare", spare);
        visit.group("crest", crest);
        visit.group("search", search);
        visit.group("bounds", bounds);
        visit.group("products", products);
        visit("turn", turn, "K");
        visit("impulse", impulse, "R");
        visit("row", row, "R");
        visit("samples", samples, "S");
        visit("extremes", extremes, "8");
    }
};

// All that one call is given but the ledger, which a call may lack.
struct Job {
    Pairs pairs;
    Cases cases;
    Forms forms;
    Grid grid;
    Snapshots snapshots;
    Tables tables;
    Space space;

    template <class Visitor> void fields(Visitor &visit) {
        visit.group("pairs", pairs);
        visit.group("cases", cases);
        visit.group("forms", forms);
        visit.group("grid", grid);
        visit.group("snapshots", snapshots);
        visit.group("tables", tables);
        visit.group("space", space);
    }
};

} // namespace FEMIMPACT_TARGET
