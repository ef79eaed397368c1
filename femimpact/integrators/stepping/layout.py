"""Arguments of the compiled loop over steps, by name: how arrays are laid out and which belong together.

The core reads these named tuples by a table (`core/stepping/loop_data.hpp`); a test compares names, types, order
and numbers of axes. The case axis comes last: cases lie side by side, one alone or in packs of `WIDTH`.
"""

from __future__ import annotations

from typing import NamedTuple

from femimpact.arrays import Array, Integers

WIDTH = 8
"""Cases in a pack."""

# rows of Cycles.last (., cases): displacement (m) and velocity (m/s) of the observed place
LAST, LAST_RATE = range(2)
# rows of Motion.ball (., pairs, cases); y and x = y - w are relative to the base, FORCE acts on the structure;
# RATE and RATE_BEFORE are kept only where a method looks ahead
Y, Y_RATE, Y_ACCELERATION, X, X_BEFORE, FORCE, Y_BEFORE, RATE, RATE_BEFORE = range(9)
# rows of Motion.drive (., cases); the drive's history is SCALE times the sine; BASE is its value at the step's
# end, ACTING that in the balance of the step; TRAVEL is its amplitude as a displacement of the base (m), TRAVEL_RATE
# as a velocity (m/s), and OBSTACLE_RATE(_BEFORE) the velocity of stops fixed in space
(
    SINE, COSINE, TURN_SINE, TURN_COSINE, PHASE, PHASE_STEP, SCALE, BASE, BASE_BEFORE, ACTING, TRAVEL, TRAVEL_RATE,
    OBSTACLE_RATE, OBSTACLE_RATE_BEFORE,
) = range(14)  # fmt: skip
# rows of Motion.ledger (., cases); LOAD_BEFORE is load @ q at the last step; REFINED to OWN_LOSS set aside what a
# refined case has summed by itself; HELD is the potential of the constant load at the start
WORK, STRUCTURE_LOSS, CONTACT_LOSS, LOAD_BEFORE, REFINED, OWN_WORK, OWN_LOSS, HELD = range(8)
# rows of Pairs.constants (., pairs, cases); a stop has no mass (its energy) and no mobility (1/m);
# SHARE of the drive that acts as an acceleration of the base on the ball
(
    MASS, MOBILITY, GAP_PLUS, GAP_MINUS, STIFFNESS, DAMPING, EXPONENT, RESTITUTION, FREE_STIFFNESS, ACCELERATION, SHARE,
    FREE_DAMPING,
) = range(12)  # fmt: skip
# rows of Motion.touch (., pairs, cases); BUSY: the pair must be looked at in every step
BUSY, OPEN, SIDE, START, APPROACH, IMPULSE, PEAK, DURATION, LOSS, NORMAL, DISSIPATIVE, REBOUND = range(12)


class Scheme(NamedTuple):
    """Constants of a one-step method for one step size, acting on the accelerations a0 and a1.

    M [(1 - alpha_m) a1 + alpha_m a0] + C v_f + K u_f = F_f + b [(1 - alpha_f) f1 + alpha_f f0], where
    . _f is (1 - alpha_f) . 1 + alpha_f . 0, or, with one mean force f kept out of the acceleration,
    M a + C v + K u = F and v1 gains dt M^-1 b f, u1 gains mass_response_u M^-1 b f.
    """

    dt: float
    predict_u: float  # u1 = u0 + dt v0 + predict_u a0 + correct_u a1
    predict_v: float  # v1 = v0 + predict_v a0 + correct_v a1
    correct_u: float
    correct_v: float
    alpha_f: float
    alpha_m: float
    carry: float  # alpha_f/(1 - alpha_f): share of the last step's contact force
    mass_response_a: float  # what a force of 1 N does to a free mass of 1 kg in a step
    mass_response_u: float
    mass_response_v: float
    spring_now: float  # share of x1 in the force of a centring spring, the rest is that of x0
    mean: bool  # one mean contact force per step, kept out of the acceleration
    rigid: bool  # that force is an impulse that sets the rebound


class ModalStep(NamedTuple):
    """The step of a diagonal system, mode by mode: a1 = load s - (stiffness u0 + damping v0 + inertia a0)."""

    load: Array  # (n,) of the drive; like the others divided by S
    inertia: Array  # (n,)
    damping: Array  # (n,)
    stiffness: Array  # (n,)
    loss: Array  # (n,) dt c/4, not divided


class BandedStep(NamedTuple):
    """The step of matrices of up to four bands, dof by dof; its tables have no entries where there are more."""

    columns: Array  # (12 (n + 6),) lower bands of -C, -K and -alpha_m M; three dofs of zeros around
    factor: Array  # (4 (n + 6),) 1/D and the entries of -L left of it, S = L D L^T


class Operator(NamedTuple):
    """The structure, ready for a step: S = (1 - alpha_m) M + (1 - alpha_f)(correct_v C + correct_u K), factorised."""

    banded: bool
    modes: ModalStep
    mass_band: Array  # (k + 1, n) lower bands; a diagonal system has one
    damping_band: Array  # (K + 1, n) as wide as the Cholesky factor
    stiffness_band: Array  # (K + 1, n)
    cholesky_band: Array  # (K + 1, n) lower bands of L, S = L L^T, diagonal inverted
    narrow: BandedStep
    drive_load: Array  # (n,) of the drive
    constant_load: Array  # (n,) N, or none
    constant_a: Array  # (n,) what the constant load does in a step, or none
    constant_u: Array  # (n,)
    constant_v: Array  # (n,)
    constant_w: Array  # (2, rows) the same, read at every row: displacement and velocity
    rows: Array  # (rows, n) places read every step: the observed one first
    response_a: Array  # (pairs, n) what 1 N along b_j does in a step
    response_u: Array  # (pairs, n)
    response_v: Array  # (pairs, n)
    compliance_u: Array  # (rows, pairs) row_i response_u_j
    compliance_v: Array  # (rows, pairs)


class Fine(NamedTuple):
    """The fine steps of a method that divides those with contact; parts = 1 where it only looks ahead."""

    parts: int
    operator: Operator
    scheme: Scheme


class Pairs(NamedTuple):
    """Contact pairs: the row of `Operator.rows` that each reads, its law, its numbers."""

    row: Integers  # (pairs,)
    kind: Integers  # (pairs,)
    address: Integers  # (pairs,) of a custom law's compiled function
    constants: Array  # (12, pairs, cases)
    obstacles: Integers  # (stops fixed in space,) their pairs, where the base moves; else none
    refused: Array  # (pairs, 3) depth, rate and approach speed for which a custom law first gave no number; else zero


class Motion(NamedTuple):
    """State at the present step; the case axis last."""

    q: Array  # (n, cases)
    v: Array  # (n, cases)
    a: Array  # (n, cases)
    w: Array  # (rows, cases)
    w_rate: Array  # (rows, cases)
    ball: Array  # (9, pairs, cases)
    touch: Array  # (12, pairs, cases)
    totals: Array  # (columns, pairs, cases)
    window: Integers  # (2, cases) first step, and the step after the last
    drive: Array  # (14, cases)
    table: Array  # (steps * refine + 1, cases) history of a drive given by samples, else no rows
    travel: Array  # (2, steps * refine + 1, cases) such a base's displacement and velocity, where stops need it
    ledger: Array  # (8, cases)
    v_before: Array  # (n, cases)
    loss_of_mode: Array  # (n,) of a single case on its modes, else none
    to_modes: Array  # (pairs, n) energy that the open contacts of such a case have passed on, else none
    saved: Array  # (3, n, cases) q, v and a at the start of a step that may be redone, else none
    saved_ball: Array  # (3, pairs, cases) y and its rates
    scratch: Array  # (3, n, cases)


class Cycles(NamedTuple):
    """Statistics per base cycle; the state before the first step is row 0 of `energy`."""

    next_wrap: Integers  # (cases,) step
    number: Integers  # (cases,) cycles finished
    period: Array  # (cases,) steps per cycle, a real number
    sums: Array  # (columns, cases)
    last: Array  # (2, cases) the observed place at the last step
    values: Array  # (cycles, columns, cases)
    energy: Array  # (cycles + 1, columns, cases)


class Record(NamedTuple):
    """Samples, snapshots and impacts of case 0."""

    used: Integers  # (channels, 4) 1 where a channel has a row of q, of v, of the balls, or of forces
    rows: Array  # (channels, 2, n) of q and v
    pair_rows: Array  # (channels, 4, pairs) of Y, Y_RATE, FORCE and of the force of contact
    channels: Array  # (channels, samples)
    energy: Array  # (columns and modes, samples)
    snapshots: Array  # (snapshots, 2, n + pairs)
    forces: Array  # (snapshots, pairs)
    impacts: Array  # (most, columns and modes)
    stride: Integers  # (4,): every, first sample, snapshot stride, first snapshot
    tally: Integers  # (4,): step, samples, snapshots, impacts met


class Cases(NamedTuple):
    """A block of cases side by side: where they are, what is kept of them, and working space."""

    pairs: Pairs
    motion: Motion
    cycles: Cycles
    record: Record
    pair_scratch: Array  # (6, pairs) for the contact equations of one case
    energy_scratch: Array  # (columns,) for the energies of one case


class Law(NamedTuple):
    """Numbers of one pair's law, and of its contact in progress."""

    kind: int
    gap_plus: float  # m
    gap_minus: float  # m
    stiffness: float  # N/m, or N/m^n
    damping: float  # N s/m; of a power law its loss factor, 1
    exponent: float
    restitution: float
    spring: float  # N/m, of the centring spring
    dashpot: float  # N s/m, of the dashpot beside it
    approach: float  # m/s, speed at which the contact opened
    address: int  # of a custom law's function


class Stepped(NamedTuple):
    """A block with its method: what every function of the loop is handed."""

    operator: Operator
    scheme: Scheme
    cases: Cases
    ledger: bool
