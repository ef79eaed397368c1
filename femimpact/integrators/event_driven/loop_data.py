"""What the compiled loop works on, as named tuples of arrays.

The case axis comes first: each case is a run of its own. C cases, F closed forms, K entries, P rigid-body
coordinates, d coordinates (structure, then balls), R pairs, O outputs. Rows of scalars: x of every pair, the contact
force of every pair on the structure, then the outputs, the first of which is the observed place.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numpy.typing import NDArray

from femimpact.integrators.event_driven.motion import Motion, Scalars, Search

__all__ = [
    "BEGUN", "CONTACT", "ENTERED", "ENTERING", "FITTING", "FREE", "LARGEST_FORCE", "LASTED", "LOST", "PUSHED",
    "SEPARATING", "STARTED", "STARTING", "TOUCH_SPEED", "Bounds", "Case", "Cases", "Form", "Forms", "Grid", "Job",
    "Ledger", "Pairs", "Products", "Shapes", "Snapshots", "Space", "Tables",
]  # fmt: skip

FREE, CONTACT, SEPARATING = range(3)
"""Contact states of a pair; the last two times the side of the wall. A rigid pair in contact sticks."""

ENTERED, ENTERING, FITTING, STARTED, STARTING = range(5)
"""How a case stands to its closed form: in it; to enter it with the coordinates it has; the same with velocities that
are made to fit its sticking pairs; as a start whose contact states are found, or are still to be found."""

BEGUN, TOUCH_SPEED, PUSHED, LARGEST_FORCE, LASTED, LOST = range(6)
"""What a contact that has not ended adds up to: start (s), approach speed (m/s), impulse (N s), largest force (N),
duration (s) and loss (J)."""


# ---- closed forms ----------------------------------------------------------------------------------


class Forms(NamedTuple):
    """Closed forms, one for each set of pairs in contact; on which side they are enters by the walls."""

    made: int  # number of forms; another thread may be adding more, which this call must not see
    key: NDArray[Any]  # (F,) bit j is set where pair j is in contact
    following: NDArray[Any]  # (F,) the next form for the same contact parameters, -1 for none
    number: NDArray[Any]  # (F,) among those of the same contact parameters
    entries: NDArray[Any]  # (F,)
    rigid_bodies: NDArray[Any]  # (F,)
    exponent: NDArray[Any]  # (F, K) complex
    coupling: NDArray[Any]  # (F, K, K) complex; see Scalars
    blocks: NDArray[Any]  # (F, B, 2)
    size: NDArray[Any]  # (F, K)
    rigid_body_given: NDArray[Any]  # (F, P, 1 + R) of a unit load, and per m of each wall
    rigid_body_drive: NDArray[Any]  # (F, P)
    weight: NDArray[Any]  # (F, 2R + O, K) complex
    weight_size: NDArray[Any]  # (F, 2R + O, K)
    rigid_body_weight: NDArray[Any]  # (F, 2R + O, P)
    rigid_body_rate_weight: NDArray[Any]  # (F, 2R + O, P)
    constant: NDArray[Any]  # (F, 2R + O, 1 + R)
    through: NDArray[Any]  # (F, 3, 2R + O) directly of s, ub' and ub
    follow: NDArray[Any]  # (F, 4, 2R + O) see Scalars
    shape: NDArray[Any]  # (F, d, K) complex
    shape_rate: NDArray[Any]  # (F, d, K) complex
    rigid_body_shape: NDArray[Any]  # (F, d, P)
    static: NDArray[Any]  # (F, d, 1 + R)
    position_through: NDArray[Any]  # (F, d) directly of ub
    position_follow: NDArray[Any]  # (F, 4, d)
    load: NDArray[Any]  # (F, 3, K) complex: what s, ub' and ub add to the rate of each entry
    to_entry_u: NDArray[Any]  # (F, K, d) complex
    to_entry_v: NDArray[Any]  # (F, K, d) complex
    to_rigid_body: NDArray[Any]  # (F, P, d)
    impulse_entry: NDArray[Any]  # (F, K, R) complex: what a unit impulse on the structure at a pair adds
    impulse_rigid_body: NDArray[Any]  # (F, P, R)
    together: NDArray[Any]  # (F, T, T) whether the product of two terms of the motion occurs in the ledger
    first: NDArray[Any]  # (F, d + 1) entries that move coordinate i: members[first[i]:first[i + 1]]
    members: NDArray[Any]  # (F, d K)


class Shapes(NamedTuple):
    """How coordinates are read from the motion in one closed form."""

    omega: float
    shape: NDArray[Any]  # (d, K) complex
    shape_rate: NDArray[Any]  # (d, K) complex
    rigid_body_shape: NDArray[Any]  # (d, P)
    static: NDArray[Any]  # (d,)
    harmonic: NDArray[Any]  # (d,) complex
    follow: NDArray[Any]  # (4, d)
    first: NDArray[Any]  # (d + 1,)
    members: NDArray[Any]  # (d K,)
    rigid_bodies: int


class Form(NamedTuple):
    """The closed form that a case is in, with what its own drive and walls make of it."""

    scalars: Scalars
    shapes: Shapes
    together: NDArray[Any]  # (T, T)
    rigid_body_sine: NDArray[Any]  # (P,) complex
    impulse_entry: NDArray[Any]  # (K, R) complex
    impulse_rigid_body: NDArray[Any]  # (P, R)
    load_on_rigid_body: NDArray[Any]  # (P, 1 + R)


# ---- cases -----------------------------------------------------------------------------------------


class Pairs(NamedTuple):
    """What all cases have in common."""

    direction: NDArray[Any]  # (R, d) of a force on the structure
    in_space: NDArray[Any]  # (R,) -1 for a stop that does not move with the base, whose x is w + ub; else 0
    rigid: NDArray[Any]  # (R,) whether the law is that of rigid impacts
    mobility: NDArray[Any]  # (R, R) change of x_i' by a unit impulse on the structure at j
    closure: float  # m


class Cases(NamedTuple):
    """What every case is given, and where it is."""

    omega: NDArray[Any]  # (C,)
    amplitude: NDArray[Any]  # (C,)
    knots: NDArray[Any]  # (n,) s(t) of a broken line; none for a sine
    knot_interval: float  # s
    gap_plus: NDArray[Any]  # (C, R)
    gap_minus: NDArray[Any]  # (C, R)
    stiffness: NDArray[Any]  # (C, R)
    damping: NDArray[Any]  # (C, R)
    restitution: NDArray[Any]  # (C, R)
    state: NDArray[Any]  # (C, R)
    form: NDArray[Any]  # (C, 2) the first form for the case's contact parameters, the present one
    entry: NDArray[Any]  # (C, K) complex
    rigid_body: NDArray[Any]  # (C, 2, P) and their rates
    clock: NDArray[Any]  # (C, 2) see Motion
    drive: NDArray[Any]  # (C, 4) see Motion
    coordinates: NDArray[Any]  # (C, 2, d) displacements and velocities where a form is to be entered
    entering: NDArray[Any]  # (C,) ENTERED, or what is to be done first
    leaving: NDArray[Any]  # (C, 2R) see Search
    hit: NDArray[Any]  # (C,) number from 1 of the pair that meets a rigid wall at this instant, times its side; else 0
    released: NDArray[Any]  # (C, R) side of a sticking pair that an impact has let go at this instant
    sample: NDArray[Any]  # (C,) samples taken since the start
    events: NDArray[Any]  # (C, 2) in this call, and at one instant
    known: NDArray[Any]  # (C, N) whether the steady motion in a form is known
    sine: NDArray[Any]  # (C, N, 2R + O) complex: steady motion of the scalars
    harmonic: NDArray[Any]  # (C, N, d) complex: of the coordinates
    rigid_body_sine: NDArray[Any]  # (C, N, P) complex
    touch: NDArray[Any]  # (C, 6, R) contacts that have not ended; see BEGUN
    to_modes: NDArray[Any]  # (C, R, n) J, what these have given to each mode
    window: NDArray[Any]  # (C, 2) s, in which impacts are counted
    totals: NDArray[Any]  # (C, 6, R) sums over them; see columns.TOTAL_COLUMNS


class Case(NamedTuple):
    """One case: its drive, its contacts, and their states."""

    number: int
    omega: float  # of the sine; 0 for a broken line
    amplitude: float  # of s(t): m/s^2 or N
    gap_plus: NDArray[Any]  # (R,) m, to the + wall
    gap_minus: NDArray[Any]  # (R,) m, to the - wall
    stiffness: NDArray[Any]  # (R,)
    damping: NDArray[Any]  # (R,)
    restitution: NDArray[Any]  # (R,)
    state: NDArray[Any]  # (R,) contact states
    released: NDArray[Any]  # (R,)
    coordinates: NDArray[Any]  # (2, d)
    touch: NDArray[Any]  # (6, R)
    to_modes: NDArray[Any]  # (R, n)
    window: NDArray[Any]  # (2,)
    totals: NDArray[Any]  # (6, R)


# ---- what is read and written ----------------------------------------------------------------------


class Grid(NamedTuple):
    """What is read on a grid of times."""

    start: NDArray[Any]  # (C,) s, of sample 0
    interval: NDArray[Any]  # (C,) s
    per_cycle: int  # samples
    origin: NDArray[Any]  # (C,) sample with which the first cycle begins
    cycle: NDArray[Any]  # (C,) cycle whose peak is being looked for
    cycles: NDArray[Any]  # (C, cycles, 6); see columns.CYCLE_COLUMNS
    values: NDArray[Any]  # (C, samples, O), or (C, 0, O) where only cycles are wanted
    kept: NDArray[Any]  # (samples,) number of the energy row that a sample fills, -1 for none
    energy: NDArray[Any]  # (C, rows, 7 + n)


class Snapshots(NamedTuple):
    """Whole motions of a single case."""

    shown: NDArray[Any]  # (samples,) number of the snapshot, -1 for none; no samples where none is wanted
    fields: NDArray[Any]  # (snapshots, 2, d)
    forces: NDArray[Any]  # (snapshots, R) N on the structure


class Tables(NamedTuple):
    """Impacts and sticking phases of a single case, one row each; those beyond the last row are counted."""

    impacts: NDArray[Any]  # (most, 9 + n); see columns.IMPACT_COLUMNS, then the energy given to each mode
    sticking: NDArray[Any]  # (most, 5): pair, side, start and end (s), impulse (N s)
    number: NDArray[Any]  # (2,) rows of both


class Ledger(NamedTuple):
    """What the ledger needs of the equations, and what it has summed of every case; n coordinates of structure."""

    mass: NDArray[Any]  # (d,)
    damping: NDArray[Any]  # (d,)
    stiffness: NDArray[Any]  # (d,)
    load: NDArray[Any]  # (d,) per unit of s(t)
    given: NDArray[Any]  # (d,) N
    free_stiffness: NDArray[Any]  # (R,)
    work: NDArray[Any]  # (C,) J
    contact_loss: NDArray[Any]  # (C,) J
    rounding: NDArray[Any]  # (C,) J, what rounding may have made of the energies of contacts
    loss_of_mode: NDArray[Any]  # (C, n) J
    start: NDArray[Any]  # (C, 7 + n) energies that a case starts with
    everywhere: bool  # or only through compliant contacts, for the table of impacts


# ---- working space ---------------------------------------------------------------------------------


class Products(NamedTuple):
    """Working space for integrals of products: T terms of a motion, its entries, its sine, and what is constant."""

    before: NDArray[Any]  # (2, d)
    after: NDArray[Any]  # (2, d)
    strength: NDArray[Any]  # (d + R, T) complex
    growth: NDArray[Any]  # (T,) complex
    plus: NDArray[Any]  # (T, T) complex
    minus: NDArray[Any]  # (T, T) complex


class Bounds(NamedTuple):
    """What the present contact states and walls make of the scalars."""

    upper: NDArray[Any]  # (2R + 1,)
    lower: NDArray[Any]  # (2R + 1,)
    lasting: NDArray[Any]  # (2R,)
    constant: NDArray[Any]  # (2R + O,)
    static: NDArray[Any]  # (d,)
    given: NDArray[Any]  # (P,)
    nothing: NDArray[Any]  # (P,) zero
    wall: NDArray[Any]  # (1 + R,) 1, then side times gap of each pair in contact or separating
    steady: NDArray[Any]  # (2, K) complex scratch


class Space(NamedTuple):
    """Working space of one thread."""

    motion: Motion  # of the present case
    begin: Motion  # where the present closed form began
    trial: Motion
    mark: Motion  # up to where the ledger is written
    spare: Motion
    crest: Motion
    search: Search
    bounds: Bounds
    products: Products
    turn: NDArray[Any]  # (2, K + 1) complex
    impulse: NDArray[Any]  # (R,)
    samples: NDArray[Any]  # (per_cycle,) w of the cycle that goes on, as far as it is read


class Job(NamedTuple):
    """All that one compiled call is given but the ledger, which a call may lack."""

    pairs: Pairs
    cases: Cases
    forms: Forms
    grid: Grid
    snapshots: Snapshots
    tables: Tables
    space: Space
