# Structs of arrays for the loop over steps, as `core.tables()` has them; a test compares both. What their fields are,
# and what the letters of shapes stand for, is said in `stepping/loop_data.hpp`; of `Law` in `contact/laws.hpp`.

from typing import NamedTuple

from femimpact.arrays import Array, Integers

class Stepped(NamedTuple):
    operator: Operator
    scheme: Scheme
    cases: Cases
    ledger: bool

class Operator(NamedTuple):
    banded: bool
    modes: ModalStep
    mass_band: Array  # (b, n)
    damping_band: Array  # (B, n)
    stiffness_band: Array  # (B, n)
    cholesky_band: Array  # (B, n)
    narrow: BandedStep
    drive_load: Array  # (n,)
    more_load: Array  # (H, n)
    more_a: Array  # (H, n)
    constant_load: Array  # (l,)
    constant_a: Array  # (l,)
    constant_u: Array  # (l,)
    constant_v: Array  # (l,)
    constant_w: Array  # (2, w)
    rows: Array  # (R, n)
    response_a: Array  # (P, n)
    response_u: Array  # (P, n)
    response_v: Array  # (P, n)
    compliance_u: Array  # (R, P)
    compliance_v: Array  # (R, P)

class ModalStep(NamedTuple):
    load: Array  # (n,)
    inertia: Array  # (n,)
    damping: Array  # (n,)
    stiffness: Array  # (n,)
    loss: Array  # (n,)

class BandedStep(NamedTuple):
    columns: Array  # (c,)
    factor: Array  # (f,)

class Scheme(NamedTuple):
    dt: float
    predict_u: float
    predict_v: float
    correct_u: float
    correct_v: float
    alpha_f: float
    alpha_m: float
    carry: float
    mass_response_a: float
    mass_response_u: float
    mass_response_v: float
    spring_now: float
    mean: bool
    rigid: bool

class Cases(NamedTuple):
    pairs: Pairs
    motion: Motion
    cycles: Cycles
    record: Record
    pair_scratch: Array  # (6, P)
    energy_scratch: Array  # (7,)

class Pairs(NamedTuple):
    row: Integers  # (P,)
    kind: Integers  # (P,)
    address: Integers  # (P,)
    constants: Array  # (9+3, P, C)
    obstacles: Integers  # (o,)
    refused: Array  # (P, 3)

class Motion(NamedTuple):
    q: Array  # (n, C)
    v: Array  # (n, C)
    a: Array  # (n, C)
    w: Array  # (R, C)
    w_rate: Array  # (R, C)
    ball: Array  # (9, P, C)
    touch: Array  # (9+3, P, C)
    totals: Array  # (6, P, C)
    window: Integers  # (2, C)
    drive: Array  # (9+5, C)
    table: Array  # (t, C)
    travel: Array  # (2, e, C)
    more: Array  # (H, T)
    drives: Array  # (D, F)
    drive_place: Integers  # (D,)
    held_by_drive: Array  # (D,)
    work_of: Array  # (D+1,)
    ledger: Array  # (8, C)
    v_before: Array  # (n, C)
    loss_of_mode: Array  # (m,)
    to_modes: Array  # (P, i)
    saved: Array  # (3, s, C)
    saved_ball: Array  # (3, r, C)
    scratch: Array  # (3, n, C)

class Cycles(NamedTuple):
    next_wrap: Integers  # (C,)
    number: Integers  # (C,)
    period: Array  # (C,)
    sums: Array  # (6, C)
    last: Array  # (2, C)
    values: Array  # (K, 6, C)
    energy: Array  # (k, 7, C)

class Record(NamedTuple):
    used: Integers  # (h, 4)
    rows: Array  # (h, 2, n)
    pair_rows: Array  # (h, 4, P)
    channels: Array  # (h, a)
    energy: Array  # (g, d)
    work_of: Array  # (D+1, S)
    snapshots: Array  # (j, 2, n+P)
    forces: Array  # (j, P)
    impacts: Array  # (q, u)
    stride: Integers  # (4,)
    tally: Integers  # (4,)

class Fine(NamedTuple):
    parts: int
    operator: Operator
    scheme: Scheme

class Law(NamedTuple):
    kind: int
    gap_plus: float
    gap_minus: float
    stiffness: float
    damping: float
    exponent: float
    restitution: float
    spring: float
    dashpot: float
    approach: float
    address: int
