"""Input of the compiled loop: the settings of the method, the instants that are read, and its arrays by name."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array, Complex, Integers
from femimpact.contact.laws import KELVIN_VOIGT, RIGID
from femimpact.errors import require
from femimpact.excitation import Excitation
from femimpact.integrators.channel_rows import drive_of
from femimpact.response.response import Recorder
from femimpact.system.system import System

MOST_PAIRS = 60
"""Contact pairs of one system: the set of those in contact is a number of 64 bits."""


class EventSettings(Protocol):
    """The event-driven method, as its run takes it; see `EventDriven`."""

    @property
    def closure(self) -> float:
        """Height of a bounce that is the last, m."""

    @property
    def samples_per_cycle(self) -> int:
        """Instants of a base cycle at which a run is read."""

    @property
    def most_events(self) -> int:
        """Events of a base cycle beyond which a run is given up."""


def check_events(system: System) -> None:
    """Refuse what the method cannot compute exactly, and say what does.

    Raises `InputError` if the system is not on its modes, or a contact is neither rigid nor Kelvin-Voigt, or leaves
    no clearance.
    """
    allowed = "must be on its normal modes for EventDriven: use reduce(system, modes=n)"
    require(system.is_diagonal, "system", f"{system.dofs} coupled dofs", "", allowed)
    allowed = f"must be at most {MOST_PAIRS} contacts for EventDriven; Newmark takes any number"
    require(len(system.contacts) <= MOST_PAIRS, "system", f"{len(system.contacts)} contacts", "", allowed)
    for pair in system.contacts:
        allowed = "must be Rigid or KelvinVoigt for EventDriven; other laws are for Newmark and its family"
        require(pair.parameters.kind in (RIGID, KELVIN_VOIGT), f"{pair.name}.contact", pair.law.name, "", allowed)
        clear = sum(pair.gaps) > 0.0
        require(clear, f"{pair.name}.gap", sum(pair.gaps), "m", "must leave some clearance between both walls")


SAMPLES_OF_A_PERIOD = 20
"""Readings in a period of the highest kept mode, under a drive by samples."""

MOST_SAMPLES = 1_000_000
"""Readings of a run under a drive by samples, where no interval is given."""

LEAST_SAMPLES = 8
"""Readings in a base cycle, of which its rms and harmonic are taken."""

WHOLE = 1e-9
"""Share of itself by which rounding may put a number of samples off an integer."""


@dataclass(frozen=True)
class ReadingGrid:
    """Instants at which a run is read."""

    interval: float  # s
    # samples in what counts as a base cycle: those of a period of a sine, which need not be an integer; under a
    # drive by samples `LEAST_SAMPLES` or more
    per_cycle: float
    follows_cycles: bool = False  # whether there are `EventSettings.samples_per_cycle` in each
    chosen: tuple[str, ...] = ()  # a note on how the interval was chosen where the drive is given by samples


def reading_grid(
    system: System,  # on its modes
    excitation: Excitation,
    method: EventSettings,
    duration: float,  # s
    recorder: Recorder,
) -> ReadingGrid:
    """The instants at which a run is read: as the recorder has them, or as they suit the drive.

    Without an interval of the recorder there are `samples_per_cycle` in a cycle of a sine. A drive by samples is read
    at their interval, or at 1/20 of the period of the highest kept mode if that is less, and at no more than 10^6
    instants.

    Raises `InputError` if the interval of the recorder leaves fewer than 8 readings in a cycle of a sine.
    """
    drive, chosen = drive_of(system, excitation), tuple[str, ...]()
    if not drive.in_pieces and recorder.interval is None:
        samples = method.samples_per_cycle
        return ReadingGrid((2.0 * math.pi / drive.omega) / samples, float(samples), follows_cycles=True)
    longest = 1.0 / (LEAST_SAMPLES * excitation.frequency)
    if recorder.interval is not None:
        interval = recorder.interval
        allowed = f"must be <= {longest:.4g} s, {LEAST_SAMPLES} readings in a cycle; Recorder.every keeps fewer of them"
        resolved = drive.in_pieces or interval <= longest * (1.0 + WHOLE)
        require(resolved, "record.interval", interval, "s", allowed)
    elif drive.line is not None:
        interval, chosen = _suited(system, drive.line.interval, "the interval of the samples that drive it", duration)
    elif drive.pieces is not None:
        knots = drive.pieces.knots
        mean = float(knots[-1] - knots[0]) / (knots.size - 1)
        interval, chosen = _suited(system, mean, "the mean length of the polynomials that drive it", duration)
    per_cycle = 1.0 / (excitation.frequency * interval)
    if abs(per_cycle - round(per_cycle)) <= WHOLE * per_cycle:
        per_cycle = float(round(per_cycle))
    # the largest line of a record may lie near its last one
    return ReadingGrid(interval, max(per_cycle, float(LEAST_SAMPLES)), chosen=chosen)


def _suited(system: System, between: float, reason: str, duration: float) -> tuple[float, tuple[str, ...]]:
    """Interval (s) that suits a drive with a time between its samples or knots (s), and a note that says so."""
    highest = math.sqrt(float(np.max(system.K.diagonal() / system.M.diagonal()))) / (2.0 * math.pi)
    period = 1.0 / highest if highest > 0.0 else math.inf
    finest = between
    if period / SAMPLES_OF_A_PERIOD < between:
        finest = period / SAMPLES_OF_A_PERIOD
        reason = f"1/{SAMPLES_OF_A_PERIOD} of the period of the highest kept mode, {highest:.4g} Hz"
    interval = finest
    # the state at the start is one of them
    if duration > (MOST_SAMPLES - 1) * finest:
        interval = duration / (MOST_SAMPLES - 1)
        reason = f"so that there are no more than {MOST_SAMPLES:,} readings; {finest:.4g} s would be {reason}"
    return interval, (
        f"read every {interval:.4g} s, {reason}; Recorder(interval=) sets another one, and largest(channel) of the "
        "response finds what lies between",
    )


FREE, CONTACT, SEPARATING = range(3)
"""Contact states of a pair; the last two times the side of the wall. A rigid pair in contact sticks."""

ENTERED, ENTERING, STARTED, RESUMED, STARTING = range(5)
"""How a case stands to its closed form: in it; to enter it with the coordinates it has; as a start whose contact states
are found; the same with the motion of an earlier run in that form; or as a start whose contact states are still to be
found."""

BEGUN, TOUCH_SPEED, PUSHED, LARGEST_FORCE, LASTED, LOST = range(6)
"""Rows of `Cases.touch`, of a contact that has not ended: start (s), approach speed (m/s), impulse (N s), largest force
(N), duration (s) and loss (J)."""


DONE, FORM_WANTED, RESONANT, UNENDING = range(4)
"""Why a case stopped: at its end, for a closed form not made before, an unbounded steady motion, or events that do not
end."""


# ---- closed forms ----------------------------------------------------------------------------------


class Forms(NamedTuple):
    """Closed forms, one for each set of pairs in contact; on which side they are enters by the walls."""

    made: int  # number of forms; another thread may be adding more, which this call must not see
    key: Integers  # (F,) bit j is set where pair j is in contact
    following: Integers  # (F,) the next form for the same contact parameters, -1 for none
    number: Integers  # (F,) among those of the same contact parameters
    entries: Integers  # (F,)
    rigid_bodies: Integers  # (F,)
    driven: Integers  # (F,) entries, the slowest ones, that take all of their response to a polynomial
    exponent: Complex  # (F, K)
    coupling: Complex  # (F, K, K); see Scalars
    blocks: Integers  # (F, B, 2)
    size: Array  # (F, K)
    rigid_body_given: Array  # (F, P, 1 + R) of a unit load, and per m of each wall
    rigid_body_drive: Array  # (F, P)
    weight: Complex  # (F, 2R + O, K)
    weight_size: Array  # (F, 2R + O, K)
    rigid_body_weight: Array  # (F, 2R + O, P)
    rigid_body_rate_weight: Array  # (F, 2R + O, P)
    constant: Array  # (F, 2R + O, 1 + R)
    through: Array  # (F, 3, 2R + O) directly of s, ub' and ub
    follow: Array  # (F, 8, 2R + O) see Scalars
    shape: Complex  # (F, d, K)
    shape_rate: Complex  # (F, d, K)
    rigid_body_shape: Array  # (F, d, P)
    static: Array  # (F, d, 1 + R)
    position_through: Array  # (F, d) directly of ub
    position_follow: Array  # (F, 8, d)
    velocity_follow: Array  # (F, 8, d)
    load: Complex  # (F, 3, K): what s, ub' and ub add to the rate of each entry
    to_entry_u: Complex  # (F, K, d)
    to_entry_v: Complex  # (F, K, d)
    to_rigid_body: Array  # (F, P, d)
    impulse_entry: Complex  # (F, K, R): what a unit impulse on the structure at a pair adds
    impulse_rigid_body: Array  # (F, P, R)
    reaction: Array  # (F, R, R) impulses at the pairs that stick (rows) by a unit one at each other pair
    together: NDArray[np.bool_]  # (F, T, T) whether the product of two terms of the motion occurs in the ledger
    first: Integers  # (F, d + 1) entries that move coordinate i: members[first[i]:first[i + 1]]
    members: Integers  # (F, d K)


# ---- cases -----------------------------------------------------------------------------------------


class Pairs(NamedTuple):
    """Contact pairs, as far as all cases have them in common."""

    direction: Array  # (R, d) of a force on the structure
    in_space: Array  # (R,) -1 for a stop that does not move with the base, whose x is w + ub; else 0
    rigid: NDArray[np.bool_]  # (R,) whether the law is that of rigid impacts
    mobility: Array  # (R, R) change of x_i' by a unit impulse on the structure at j
    closure: float  # m


class Cases(NamedTuple):
    """Inputs and present state of every case."""

    omega: Array  # (C,)
    amplitude: Array  # (C,)
    knots: Array  # (L,) s, where the pieces of s(t) begin, rising; none for a sine
    pieces: Array  # (L, 8) what `Motion.drive` is at the beginning of each piece
    degree: int  # of the pieces, each a polynomial; -1 for a sine
    longest: float  # s, for which the series of driven entries serves
    gap_plus: Array  # (C, R)
    gap_minus: Array  # (C, R)
    stiffness: Array  # (C, R)
    damping: Array  # (C, R)
    restitution: Array  # (C, R)
    state: Array  # (C, R)
    form: Integers  # (C, 2) the first form for the case's contact parameters, the present one
    entry: Complex  # (C, K)
    rigid_body: Array  # (C, 2, P) and their rates
    clock: Array  # (C, 2) see Motion
    drive: Array  # (C, 8) see Motion
    piece: Integers  # (C,) number of the present piece
    coordinates: Array  # (C, 2, d) displacements and velocities where a form is to be entered
    entering: Integers  # (C,) ENTERED, or what is to be done first
    leaving: Array  # (C, 2R) see Search
    hit: Array  # (C,) number from 1 of the pair that meets a rigid wall at this instant, times its side; else 0
    released: Array  # (C, R) side of a sticking pair that an impact has let go at this instant
    sample: Integers  # (C,) samples taken since the start
    events: Integers  # (C, 2) in this call, and at one instant
    known: NDArray[np.bool_]  # (C, N) whether the steady motion in a form is known
    sine: Complex  # (C, N, 2R + O): steady motion of the scalars
    harmonic: Complex  # (C, N, d): of the coordinates
    rigid_body_sine: Complex  # (C, N, P)
    touch: Array  # (C, 6, R) contacts that have not ended; see BEGUN
    to_modes: Array  # (C, R, n) J, what these have given to each mode
    window: Array  # (C, 2) s, of which the totals are: impacts that end in it, and the forces in it
    totals: Array  # (C, 6, R) sums over them; see columns.TOTAL_COLUMNS


# ---- what is read and written ----------------------------------------------------------------------


class Grid(NamedTuple):
    """Grid of times, and the values read on it."""

    start: Array  # (C,) s, of sample 0
    interval: Array  # (C,) s
    per_cycle: float  # samples, not always an integer
    origin: Integers  # (C,) sample with which the first cycle begins
    cycle: Integers  # (C,) cycle whose peak is being looked for
    cycles: Array  # (C, cycles, 8); see columns.CYCLE_COLUMNS, then the times of maximum and minimum (s)
    values: Array  # (C, samples, O), or (C, 0, O) where only cycles are wanted
    kept: Integers  # (samples,) number of the energy row that a sample fills, -1 for none
    energy: Array  # (C, rows, 7 + n)


class Snapshots(NamedTuple):
    """Displacements and velocities of all coordinates of a single case at some samples."""

    shown: Integers  # (samples,) number of the snapshot, -1 for none; no samples where none is wanted
    fields: Array  # (snapshots, 2, d)
    forces: Array  # (snapshots, R) N on the structure


class Tables(NamedTuple):
    """Impacts and sticking phases of a single case, one row each; those beyond the last row are counted."""

    impacts: Array  # (most, 9 + n); see columns.IMPACT_COLUMNS, then the energy given to each mode
    sticking: Array  # (most, 5): pair, side, start and end (s), impulse (N s)
    number: Integers  # (2,) rows of both


class Ledger(NamedTuple):
    """Coefficients of the equations for the ledger, and its sums of every case; n coordinates of structure."""

    mass: Array  # (d,)
    damping: Array  # (d,)
    stiffness: Array  # (d,)
    load: Array  # (d,) per unit of s(t)
    given: Array  # (d,) N
    free_stiffness: Array  # (R,)
    free_damping: Array  # (R,)
    work: Array  # (C,) J
    contact_loss: Array  # (C,) J
    rounding: Array  # (C,) J, what rounding may have made of the energies of contacts
    loss_of_mode: Array  # (C, n) J
    start: Array  # (C, 7 + n) energies that a case starts with
    everywhere: bool  # or only through compliant contacts, for the table of impacts


class Task(NamedTuple):
    """Cases of a call, the samples to which it takes them, and why each stopped."""

    members: Integers  # (members,) cases
    begin: Integers  # (C,) samples after which is read
    end: Integers  # (C,) samples to which is gone
    most: Array  # (C,) events allowed in all
    stopped: Integers  # (C,) what each one stopped for; see DONE


# ---- working space ---------------------------------------------------------------------------------


class Motion(NamedTuple):
    """Where the motion is: homogeneous part, rigid-body coordinates, time, a drive by pieces."""

    entry: Complex  # (K,)
    rigid_body: Array  # (P,)
    rigid_body_rate: Array  # (P,)
    clock: Array  # (2,): time, phase of the sine at t = 0
    drive: Array  # (8,): ub, ub', s and the derivatives of s to the fifth; zero for a sine


class Search(NamedTuple):
    """Results of a search, and its scratch space; R scalars, K entries."""

    leaving: Array  # (R,) side of a bound just left, or at which another bound was met at rest; else 0
    at_wall: Array  # (R,) side of the wall touched at this instant, else 0
    rate: Array  # (R,)
    found: Array  # (5,) scratch
    size: Array  # (K,) |H|; see `measure`
    drift: Array  # (2, K) of driven entries: |H''|, and how far H'' changes
    power: Complex  # (3, K): H', and scratch
    event: Array  # (2,): scalar, side
    negligible: Array  # (1,) m/s, see `negligible_approach`


class Products(NamedTuple):
    """Working space for integrals of products: T terms of a motion, its entries, its sine, and what is constant."""

    before: Array  # (2, d)
    after: Array  # (2, d)
    strength: Complex  # (d + R, T)
    growth: Complex  # (T,)
    plus: Complex  # (T, T)
    minus: Complex  # (T, T)
    moments: Complex  # (K, 6) integrals of powers of the time times e^{mu s}
    rates: Array  # (d, 24) Taylor series of what driven entries move


class Bounds(NamedTuple):
    """Bounds and constant parts of the scalars, from the present contact states and walls."""

    upper: Array  # (2R + 1,)
    lower: Array  # (2R + 1,)
    lasting: Array  # (2R,)
    constant: Array  # (2R + O,)
    static: Array  # (d,)
    given: Array  # (P,)
    nothing: Array  # (P,) zero
    wall: Array  # (1 + R,) 1, then side times gap of each pair in contact or separating
    steady: Complex  # (2, K) scratch


class Space(NamedTuple):
    """Working space of one thread."""

    motion: Motion  # of the present case
    begin: Motion  # where the present closed form began
    trial: Motion
    mark: Motion  # up to where the ledger is written
    scratch: Motion  # advanced to read the motion at other instants
    peak_trial: Motion  # the same, to an estimate of a peak, or to the end of a cycle
    search: Search
    bounds: Bounds
    products: Products
    turn: Complex  # (K,) growth of the entries between two samples
    impulse: Array  # (R,)
    row: Integers  # (R,) in the table, or behind it, of the last impact of each pair
    samples: Array  # (per_cycle + 1,) w of the cycle that goes on, as far as it is read
    extremes: Array  # (8,) extremes of a contact force and their times, as in a row of `Grid.cycles`


class Job(NamedTuple):
    """All that one compiled call is given but the ledger, which a call may lack."""

    pairs: Pairs
    cases: Cases
    forms: Forms
    grid: Grid
    snapshots: Snapshots
    tables: Tables
    space: Space
