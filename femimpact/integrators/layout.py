"""How the arrays of a run are laid out: what each row is, and which arrays belong together."""

from __future__ import annotations

from typing import Any, NamedTuple

from numpy.typing import NDArray

CYCLE_COLUMNS = ("maximum", "minimum", "square", "sine", "cosine", "samples")
ENERGY_COLUMNS = ("kinetic", "strain", "ball", "contact", "work", "structure_loss", "contact_loss")
IMPACT_COLUMNS = (
    "time", "pair", "side", "approach_speed", "rebound_speed", "impulse", "peak_force", "duration", "energy_loss",
)  # fmt: skip
TOTAL_COLUMNS = ("count", "approach_speed", "approach_speed_max", "impulse", "peak_force", "force_time")
# the first four count impacts that end within the window; the last two every force in it, riding included

# rows of Motion.ball (., pairs, cases); y and x = y - w are relative to the base, FORCE acts on the structure
Y, Y_RATE, Y_ACCELERATION, X, X_BEFORE, FORCE, Y_BEFORE = range(7)
# rows of Motion.drive (., cases); SCALE is -amplitude omega^2, BASE the base acceleration
SINE, COSINE, TURN_SINE, TURN_COSINE, PHASE, PHASE_STEP, SCALE, BASE, BASE_BEFORE = range(9)
# rows of Motion.ledger (., cases)
WORK, STRUCTURE_LOSS, CONTACT_LOSS, LOAD, LOAD_BEFORE = range(5)
# rows of Pairs.constants (., pairs, cases)
MASS, GAP_PLUS, GAP_MINUS, STIFFNESS, DAMPING, FREE_STIFFNESS, ACCELERATION = range(7)
# rows of Motion.touch (., pairs, cases); BUSY: the pair must be looked at in every step
BUSY, OPEN, SIDE, START, APPROACH, IMPULSE, PEAK, DURATION, LOSS, NORMAL, DISSIPATIVE = range(11)


class Scheme(NamedTuple):
    """Newmark's constants for one step size."""

    dt: float
    predict_u: float  # dt^2 (1/2 - beta)
    predict_v: float  # dt (1 - gamma)
    correct_u: float  # dt^2 beta
    correct_v: float  # dt gamma


class Operator(NamedTuple):
    """The structure, ready for a step: S = M + gamma dt C + beta dt^2 K, factorised once."""

    banded: bool
    load: NDArray[Any]  # (n,) -base_load; diagonal systems: already divided by S
    damping: NDArray[Any]  # (n,) C/S of a diagonal system
    stiffness: NDArray[Any]  # (n,) K/S of a diagonal system
    mass_band: NDArray[Any]  # (k + 1, n) lower bands; a diagonal system has one
    damping_band: NDArray[Any]
    stiffness_band: NDArray[Any]
    cholesky_band: NDArray[Any]  # (k + 1, n) lower bands of L, S = L L^T, diagonal inverted
    base_load: NDArray[Any]  # (n,)
    rows: NDArray[Any]  # (rows, n) places read every step: the observed one first
    response: NDArray[Any]  # (pairs, n) S^-1 b_j
    compliance: NDArray[Any]  # (rows, pairs) row_i S^-1 b_j


class Pairs(NamedTuple):
    """Contact pairs: the row of `Operator.rows` that each reads, its law, its numbers."""

    row: NDArray[Any]  # (pairs,)
    kind: NDArray[Any]  # (pairs,)
    constants: NDArray[Any]  # (7, pairs, cases)


class Motion(NamedTuple):
    """State at the present step; the case axis last."""

    q: NDArray[Any]  # (n, cases)
    v: NDArray[Any]
    a: NDArray[Any]
    w: NDArray[Any]  # (rows, cases)
    w_rate: NDArray[Any]
    ball: NDArray[Any]  # (7, pairs, cases)
    touch: NDArray[Any]  # (11, pairs, cases)
    totals: NDArray[Any]  # (columns, pairs, cases)
    window: NDArray[Any]  # (2, cases) first step, and the step after the last
    drive: NDArray[Any]  # (9, cases)
    ledger: NDArray[Any]  # (5, cases)
    v_before: NDArray[Any]  # (n, cases)
    scratch: NDArray[Any]  # (3, n, cases)


class Cycles(NamedTuple):
    """Statistics per base cycle; the state before the first step is row 0 of `energy`."""

    next_wrap: NDArray[Any]  # (cases,) step
    number: NDArray[Any]  # (cases,) cycles finished
    period: NDArray[Any]  # (cases,) steps per cycle, a real number
    sums: NDArray[Any]  # (columns, cases)
    values: NDArray[Any]  # (cycles, columns, cases)
    energy: NDArray[Any]  # (cycles + 1, columns, cases)


class Record(NamedTuple):
    """What case 0 keeps."""

    kind: NDArray[Any]  # (channels,)
    source: NDArray[Any]  # (channels,) row or pair
    rows: NDArray[Any]  # (rows, n)
    channels: NDArray[Any]  # (samples, channels)
    energy: NDArray[Any]  # (samples, columns)
    fields: NDArray[Any]  # (snapshots, 2, n + pairs)
    forces: NDArray[Any]  # (snapshots, pairs)
    impacts: NDArray[Any]  # (most, columns)
    stride: NDArray[Any]  # (4,): every, first sample, snapshot stride, first snapshot
    tally: NDArray[Any]  # (4,): step, samples, snapshots, impacts met
