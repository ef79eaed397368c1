# Structs of arrays for the loop over events, as `core.tables()` has them; a test compares both. What their fields are,
# and what the letters of shapes stand for, is said in `event_driven/loop_data.hpp`.

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array, Complex, Integers

class Task(NamedTuple):
    members: Integers  # (M,)
    begin: Integers  # (C,)
    end: Integers  # (C,)
    most: Array  # (C,)
    stopped: Integers  # (C,)

class Job(NamedTuple):
    pairs: Pairs
    cases: Cases
    forms: Forms
    grid: Grid
    snapshots: Snapshots
    tables: Tables
    space: Space

class Pairs(NamedTuple):
    direction: Array  # (R, d)
    in_space: Array  # (R,)
    rigid: NDArray[np.bool_]  # (R,)
    mobility: Array  # (R, R)
    closure: float

class Cases(NamedTuple):
    omega: Array  # (C,)
    amplitude: Complex  # (C, H)
    knots: Array  # (L,)
    pieces: Array  # (L, 8H)
    degree: int
    longest: float
    gap_plus: Array  # (C, R)
    gap_minus: Array  # (C, R)
    stiffness: Array  # (C, R)
    damping: Array  # (C, R)
    restitution: Array  # (C, R)
    state: Array  # (C, R)
    form: Integers  # (C, 2)
    entry: Complex  # (C, K)
    rigid_body: Array  # (C, 2, P)
    clock: Array  # (C, 2)
    drive: Array  # (C, 8H)
    piece: Integers  # (C,)
    coordinates: Array  # (C, 2, d)
    entering: Integers  # (C,)
    leaving: Array  # (C, 2R)
    hit: Array  # (C,)
    released: Array  # (C, R)
    sample: Integers  # (C,)
    events: Integers  # (C, 2)
    known: NDArray[np.bool_]  # (C, N)
    sine: Complex  # (C, N, 2R+O)
    harmonic: Complex  # (C, N, d)
    rigid_body_sine: Complex  # (C, N, P)
    touch: Array  # (C, 6, R)
    to_modes: Array  # (C, R, m)
    window: Array  # (C, 2)
    totals: Array  # (C, 6, R)

class Forms(NamedTuple):
    made: int
    key: Integers  # (F,)
    following: Integers  # (F,)
    number: Integers  # (F,)
    entries: Integers  # (F,)
    rigid_bodies: Integers  # (F,)
    driven: Integers  # (F,)
    slow: Integers  # (F,)
    exponent: Complex  # (F, K)
    coupling: Complex  # (F, K, K)
    blocks: Integers  # (F, B, 2)
    size: Array  # (F, K)
    rigid_body_given: Array  # (F, P, R+1)
    rigid_body_drive: Array  # (F, H, P)
    weight: Complex  # (F, 2R+O, K)
    weight_size: Array  # (F, 2R+O, K)
    rigid_body_weight: Array  # (F, 2R+O, P)
    rigid_body_rate_weight: Array  # (F, 2R+O, P)
    constant: Array  # (F, 2R+O, R+1)
    through: Array  # (F, 3H, 2R+O)
    follow: Array  # (F, 8H, 2R+O)
    shape: Complex  # (F, d, K)
    shape_rate: Complex  # (F, d, K)
    rigid_body_shape: Array  # (F, d, P)
    static: Array  # (F, d, R+1)
    static_rate: Array  # (F, d, R+1)
    position_through: Array  # (F, d)
    position_follow: Array  # (F, 8H, d)
    velocity_follow: Array  # (F, 8H, d)
    load: Complex  # (F, 3H, K)
    given: Complex  # (F, K, R+1)
    to_entry_u: Complex  # (F, K, d)
    to_entry_v: Complex  # (F, K, d)
    to_rigid_body: Array  # (F, P, d)
    impulse_entry: Complex  # (F, K, R)
    impulse_rigid_body: Array  # (F, P, R)
    together: NDArray[np.bool_]  # (F, K, K)
    first: Integers  # (F, d+1)
    members: Integers  # (F, dK)

class Grid(NamedTuple):
    start: Array  # (C,)
    interval: Array  # (C,)
    per_cycle: float
    origin: Integers  # (C,)
    cycle: Integers  # (C,)
    cycles: Array  # (C, y, 8)
    values: Array  # (C, x, O)
    kept: Integers  # (k,)
    energy: Array  # (C, e, n+7)
    work_of: Array  # (C, w, D+1)

class Snapshots(NamedTuple):
    shown: Integers  # (s,)
    fields: Array  # (f, 2, d)
    forces: Array  # (f, R)

class Tables(NamedTuple):
    impacts: Array  # (i, n+9)
    sticking: Array  # (j, 5)
    number: Integers  # (2,)
    events: Array  # (C, l, R+2d+5)
    logged: Integers  # (C,)

class Space(NamedTuple):
    motion: Motion
    begin: Motion
    trial: Motion
    mark: Motion
    scratch: Motion
    peak_trial: Motion
    search: Search
    bounds: Bounds
    products: Products
    impulses: Impulses
    turn: Complex  # (K,)
    impulse: Array  # (R,)
    row: Integers  # (R,)
    samples: Array  # (S,)
    extremes: Array  # (8,)

class Motion(NamedTuple):
    entry: Complex  # (K,)
    rigid_body: Array  # (P,)
    rigid_body_rate: Array  # (P,)
    clock: Array  # (2,)
    drive: Array  # (8H,)

class Search(NamedTuple):
    leaving: Array  # (2R,)
    at_wall: Array  # (2R,)
    rate: Array  # (2R,)
    found: Array  # (5,)
    size: Array  # (K,)
    drift: Array  # (2, K)
    power: Complex  # (3, K)
    event: Array  # (2,)
    negligible: Array  # (1,)

class Bounds(NamedTuple):
    upper: Array  # (2R+1,)
    lower: Array  # (2R+1,)
    lasting: Array  # (2R,)
    constant: Array  # (2R+O,)
    static: Array  # (d,)
    static_rate: Array  # (d,)
    given: Array  # (P,)
    entry_given: Complex  # (K,)
    nothing: Array  # (H, P)
    wall: Array  # (R+1,)
    steady: Complex  # (2, K)

class Products(NamedTuple):
    before: Array  # (2, d)
    after: Array  # (2, d)
    strength: Complex  # (d+R, K+2)
    growth: Complex  # (K+2,)
    plus: Complex  # (K+2, K+2)
    minus: Complex  # (K+2, K+2)
    moments: Complex  # (K, 6)
    rates: Array  # (d, 9+9+6)

class Impulses(NamedTuple):
    rounding: Array  # (R,)
    pair: Integers  # (R,)
    held: NDArray[np.bool_]  # (R,)
    pushes: NDArray[np.bool_]  # (R,)
    approach: Array  # (R,)
    target: Array  # (R,)
    impulse: Array  # (R,)
    trial: Array  # (R,)
    mobility: Array  # (R, R)
    factor: Array  # (R, R)
    normal: Array  # (R, R)
    order: Integers  # (2, R)
    size: Array  # (R,)
    solved: Array  # (R,)

class Ledger(NamedTuple):
    mass: Array  # (d,)
    damping: Array  # (d,)
    stiffness: Array  # (d,)
    load: Array  # (d,)
    given: Array  # (d,)
    free_stiffness: Array  # (R,)
    free_damping: Array  # (R,)
    work: Array  # (C,)
    contact_loss: Array  # (C,)
    rounding: Array  # (C,)
    loss_of_mode: Array  # (C, n)
    start: Array  # (C, n+7)
    everywhere: bool
    drive_load: Array  # (D, d)
    drive_amplitude: Complex  # (D,)
    drive_pieces: Array  # (g, 6D)
    work_of: Array  # (C, D+1)

class SearchCall(NamedTuple):
    scalars: Scalars
    motion: Motion
    search: Search

class Scalars(NamedTuple):
    exponent: Complex  # (K,)
    coupling: Complex  # (K, K)
    blocks: Integers  # (B, 2)
    size: Array  # (K,)
    omega: float
    degree: int
    rigid_body_given: Array  # (P,)
    rigid_body_drive: Array  # (H, P)
    lasting: Array  # (2R,)
    upper: Array  # (2R+1,)
    lower: Array  # (2R+1,)
    weight: Complex  # (2R+O, K)
    weight_size: Array  # (2R+O, K)
    rigid_body_weight: Array  # (2R+O, P)
    rigid_body_rate_weight: Array  # (2R+O, P)
    sine: Complex  # (2R+O,)
    constant: Array  # (2R+O,)
    follow: Array  # (8H, 2R+O)
    driven: int
    slow: int
    load: Complex  # (3H, K)
    given: Complex  # (K,)
    term: Complex  # (K,)
    growth: Complex  # (K,)
