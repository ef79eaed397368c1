"""Random vibro-impact structures for the event-driven method: one case for each seed, the same on every machine."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

import femimpact as fi

GRAVITY = 9.81
"""m/s^2."""

APART = 0.05
"""Relative distance that a drive keeps from natural frequencies that nothing damps."""

FEWEST_CYCLES, MOST_CYCLES = 6.0, 200.0
"""Bounds of a duration, in cycles of a sine, or in periods of the structure under a broken line."""


@dataclass(frozen=True, eq=False)
class RandomCase:
    """One run to be made: what moves, what drives it, how long (s), from where, and a line that says so."""

    system: fi.System
    excitation: fi.Sine | fi.PointForce | fi.RecordedBase
    duration: float
    initial: fi.State
    description: str


@dataclass(frozen=True, eq=False)
class Scale:
    """What a case is sized by: its first frequency (Hz), a mass at its contacts (kg) and its amplitude (m)."""

    frequency: float
    mass: float
    amplitude: float


def random_case(seed: int) -> RandomCase:
    """A random structure with balls and stops, its excitation, duration and start.

    Structures: half are cantilevers (0.1 to 0.4 m, aluminium or steel, some with a tip mass) on 1 to 6 normal
    modes, half are chains of 1 to 4 masses from 1 to 100 Hz on all their modes. Damping ratios: none in 15 %,
    1e-4 to 0.02 in 50 %, up to 0.2 in 35 %; a beam's Rayleigh damping may make its fast modes overdamped.

    Contacts: up to three balls and two stops, at least one pair. Equal parts in a fifth of the cases: equal balls
    at one place, or on equal oscillators (repeated eigenvalues, half of them in rotated coordinates). A pair is
    rigid or Kelvin-Voigt with even odds. Restitution of rigid ones: 0 in 10 %, 1 in 10 %, 0.9 to 0.999 in 10 %,
    else 0 to 1. Kelvin-Voigt: restitution 1 in 10 %, else 0.1 to 1, with a stiffness of 1e2 to 1e7 N/m, a contact
    time of 0.05 to 3 ms, or one of 0.01 to 0.5 periods of the structure; some are given by their dashpot.

    Gaps, for an amplitude of 1 mm and in proportion to it (0.1 to 3 mm): 0 on one side in 15 %, 3e-6 m in 10 %,
    else 1e-5 to 5e-3 m, equal on both sides in half of the cases. A third has balls under a constant acceleration
    (9.81 m/s^2, or 0.1 to 10 times the drive's), a fifth balls on centring springs.

    Excitations: half a sine of the base, a quarter a force at a place, a quarter a broken line of random
    accelerations of the base; 60 % of the sines within 20 % of the first frequency, else 0.2 to 3 times it; they
    keep 5 % away from natural frequencies where there is no damping, and from those of balls on centring springs.
    Phases are random. Starts: rest in the base, rest in the inertial frame, or given positions and velocities.

    Durations aim at 100 to 2000 impacts by a rough count, within 6 and 200 cycles (of a sine, or of the
    structure under a broken line).

    Parameters
    ----------
    seed : int

    Returns
    -------
    RandomCase
    """
    rng = np.random.default_rng([seed, 20260])
    amplitude = _log_uniform(rng, 1e-4, 3e-3)
    kinds = ("rigid", "kelvin-voigt")
    most_pairs = 5
    whole, words = (_cantilever if rng.random() < 0.5 else _chain)(rng, amplitude, kinds, most_pairs)
    recorded = rng.random() < 0.25
    excitation = (_recorded if recorded else _sine)(rng, whole, amplitude)
    # the cycle of a broken line is that of its largest line, which may be slow: periods of the structure then
    period = 1.0 / (whole.first_frequency if recorded else excitation.frequency)
    duration = max(period * _cycles(rng, whole, amplitude), 1.0 / excitation.frequency)
    initial, start = _start(rng, whole, amplitude * 2.0 * math.pi * excitation.frequency)
    if not _fits(whole, excitation, initial):
        # the base is where it was at rest: nothing is displaced against it
        excitation = replace(excitation, phase=0.0)
    contacts = ", ".join(f"{pair.name} {_law_words(pair)}" for pair in whole.contacts)
    description = f"seed {seed}: {words}; {contacts}; {type(excitation).__name__} at {excitation.frequency:.4g} Hz"
    return RandomCase(whole, excitation, duration, initial, f"{description}; {start}")


def resting_case(seed: int) -> RandomCase:
    """A ball that lies on its wall under a constant force, until the wall leaves it.

    In even cases the sine of the base accelerates the wall away, in odd ones another ball strikes it away. The balls
    are rigid with restitution 0.3 to 0.8, of half of the striking ones 0, on a chain of 1 to 3 masses, and meet no
    other wall.

    Parameters
    ----------
    seed : int

    Returns
    -------
    RandomCase
    """
    rng = np.random.default_rng([seed, 20261])
    count, side, amplitude = int(rng.integers(1, 4)), float(rng.choice([-1.0, 1.0])), _log_uniform(rng, 1e-4, 1e-3)
    mass, frequency = _log_uniform(rng, 0.1, 1.0), _log_uniform(rng, 5.0, 30.0)
    stiffness = np.diag(np.full(count, 2.0)) - np.diag(np.ones(count - 1), 1) - np.diag(np.ones(count - 1), -1)
    softest = float(np.linalg.eigvalsh(stiffness)[0])
    stiffness *= mass * (2.0 * math.pi * frequency) ** 2 / softest
    # the force on the ball against what the base's acceleration makes of it
    struck, drive = seed % 2 == 1, float(rng.uniform(0.2, 0.5)) * frequency
    pressing = amplitude * (2.0 * math.pi * drive) ** 2 * (10.0 if struck else float(rng.uniform(0.2, 0.6)))
    gap, far = amplitude, 1e3 * amplitude
    laws = [fi.Rigid(float(rng.uniform(0.3, 0.8))) for _ in range(2)]
    lying = (gap, far) if side > 0.0 else (far, gap)
    balls = [fi.Impactor("lying", "m1", mass * _log_uniform(rng, 0.05, 0.5), lying, laws[0], 0.0, side * pressing)]
    start = fi.State(ball_displacement=[side * gap])
    if struck:
        # a blow on the wall of the same side moves the structure away from what lies there
        speed = side * amplitude * 2.0 * math.pi * drive * float(rng.uniform(2.0, 5.0))
        law = fi.Rigid(0.0) if seed % 4 == 1 else laws[1]
        balls.append(fi.Impactor("striking", "m1", mass * _log_uniform(rng, 0.1, 1.0), lying, law))
        start = fi.State(ball_displacement=[side * gap, 0.0], ball_velocity=[0.0, speed])
    whole = fi.System.from_matrices(
        mass * np.eye(count), 0.02 * stiffness / (2.0 * math.pi * frequency), stiffness,
        points={f"m{i + 1}": row for i, row in enumerate(np.eye(count))}, base_load=np.full(count, mass),
        impactors=balls,
    )  # fmt: skip
    words = "struck" if struck else "the base leaves"
    # some impacts of the striking ball, or some cycles of the base
    duration = (0.5 if struck else 3.0) / drive
    return RandomCase(fi.reduce(whole, modes=count), fi.Sine(amplitude, drive), duration, start, f"{seed}: {words}")


def _law_words(pair: fi.system.ContactPair) -> str:
    return f"{pair.law.name} e={pair.parameters.restitution:.3g} gaps {pair.gaps[0]:.3g}/{pair.gaps[1]:.3g}"


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def _pick(rng: np.random.Generator, shares: tuple[float, ...]) -> int:
    """Index drawn with these probabilities."""
    return int(rng.choice(len(shares), p=shares))


def _ratio(rng: np.random.Generator) -> float:
    """Damping ratio."""
    kind = _pick(rng, (0.15, 0.5, 0.35))
    return (0.0, _log_uniform(rng, 1e-4, 0.02), float(rng.uniform(0.02, 0.2)))[kind]


# ---- structures -----------------------------------------------------------------------------------


def _cantilever(rng: np.random.Generator, amplitude: float, kinds: tuple[str, ...], most: int) -> tuple[fi.System, str]:
    """A beam on some of its normal modes."""
    modulus, density = ((70e9, 2700.0), (210e9, 7850.0))[int(rng.integers(2))]
    beam = fi.Beam.uniform(
        length=float(rng.uniform(0.1, 0.4)), width=0.02, thickness=_log_uniform(rng, 8e-4, 3e-3),
        young_modulus=modulus, density=density,
    )  # fmt: skip
    tip = (fi.PointMass("box", "tip", beam.mass * _log_uniform(rng, 0.1, 2.0)),) if rng.random() < 0.5 else ()
    ratio = _ratio(rng)
    damping = fi.Rayleigh(ratio, modes=(1, 2)) if ratio else None
    bare = fi.Structure(beam=beam, masses=tip, damping=damping)
    first = fi.assemble(bare, elements=8).first_frequency
    scale = Scale(first, 0.25 * beam.mass + sum(body.mass for body in tip), amplitude)
    places = ["tip", "mid", float(rng.uniform(0.3, 0.95)) * beam.length]
    rng.shuffle(places)
    if rng.random() < 0.2:
        balls = _equal(_ball(rng, "ball", places[0], scale, kinds), [places[0]] * int(rng.integers(2, 4)))
        note = f"{len(balls)} equal balls, "
    else:
        balls, note = _balls(rng, places, scale, kinds), ""
    stops = _stops(rng, places, scale, kinds, most - len(balls), bool(balls))
    modes = int(rng.integers(1, 7))
    system = fi.reduce(fi.assemble(replace(bare, impactors=balls, stops=stops), elements=8), modes=modes)
    return system, f"cantilever {first:.3g} Hz, {modes} modes, {note}damping {ratio:.2g}"


def _chain(rng: np.random.Generator, amplitude: float, kinds: tuple[str, ...], most: int) -> tuple[fi.System, str]:
    """Masses and springs in a row from the base on, or equal oscillators side by side."""
    equal = rng.random() < 0.2
    count = int(rng.integers(2, 4)) if equal else int(rng.integers(1, 5))
    mass, first = _log_uniform(rng, 0.02, 2.0), _log_uniform(rng, 1.0, 100.0)
    if equal:
        masses, stiffness = np.full(count, mass), mass * (2.0 * math.pi * first) ** 2 * np.eye(count)
    else:
        masses = mass * np.exp(rng.uniform(-1.0, 1.0, count))
        springs = np.append(np.exp(rng.uniform(-1.0, 1.0, count)), 0.0)
        stiffness = np.diag(springs[:-1] + springs[1:])
        stiffness -= np.diag(springs[1:-1], 1) + np.diag(springs[1:-1], -1)
        softest = scipy.linalg.eigh(stiffness, np.diag(masses), eigvals_only=True)[0]
        stiffness *= (2.0 * math.pi * first) ** 2 / softest
    # rows of a rotation read equal oscillators in coordinates that mix them
    rows = scipy.linalg.qr(rng.normal(size=(count, count)))[0] if equal and rng.random() < 0.5 else np.eye(count)
    names = [f"m{i + 1}" for i in range(count)]
    ratios = _ratio(rng) * (np.ones(count) if equal else rng.uniform(0.3, 1.0, count))
    values, vectors = scipy.linalg.eigh(stiffness, np.diag(masses))
    momentum = np.diag(masses) @ vectors
    damping = (momentum * (2.0 * ratios * np.sqrt(values))) @ momentum.T
    scale = Scale(first, mass, amplitude)
    places: list[str | float] = [*names]
    rng.shuffle(places)
    balls = _equal(_ball(rng, "ball", "m1", scale, kinds), names) if equal else _balls(rng, places, scale, kinds)
    stops = _stops(rng, places, scale, kinds, most - len(balls), bool(balls))
    whole = fi.System.from_matrices(
        np.diag(masses), 0.5 * (damping + damping.T), stiffness, points=dict(zip(names, rows, strict=True)),
        base_load=np.diag(masses) @ rows.T @ np.ones(count), impactors=balls, stops=stops,
    )  # fmt: skip
    words = f"{count} equal oscillators" if equal else f"chain of {count}"
    return fi.reduce(whole, modes=count), f"{words} {first:.3g} Hz, damping {float(ratios.max()):.2g}"


# ---- contacts -------------------------------------------------------------------------------------


def _balls(
    rng: np.random.Generator, places: list[str | float], scale: Scale, kinds: tuple[str, ...]
) -> tuple[fi.Impactor, ...]:
    count = _pick(rng, (0.1, 0.4, 0.3, 0.2))
    return tuple(_ball(rng, f"ball{i + 1}", places[int(rng.integers(len(places)))], scale, kinds) for i in range(count))


def _ball(rng: np.random.Generator, name: str, place: str | float, scale: Scale, kinds: tuple[str, ...]) -> fi.Impactor:
    mass, omega = scale.mass * _log_uniform(rng, 5e-3, 1.0), 2.0 * math.pi * scale.frequency
    acceleration, spring = 0.0, 0.0
    if rng.random() < 1.0 / 3.0:
        size = GRAVITY if rng.random() < 0.3 else _log_uniform(rng, 0.1, 10.0) * scale.amplitude * omega**2
        acceleration = float(rng.choice([-1.0, 1.0])) * size
    if rng.random() < 0.2:
        spring = mass * (omega * _log_uniform(rng, 0.1, 3.0)) ** 2
    return fi.Impactor(name, place, mass, _gaps(rng, scale), _law(rng, scale, kinds), spring, acceleration)


def _equal(ball: fi.Impactor, places: list[str | float] | list[str]) -> tuple[fi.Impactor, ...]:
    """The same ball at each of these places, which may be one place."""
    return tuple(replace(ball, name=f"ball{i + 1}", at=place) for i, place in enumerate(places))


def _stops(
    rng: np.random.Generator, places: list[str | float], scale: Scale, kinds: tuple[str, ...], most: int, balls: bool
) -> tuple[fi.Stop, ...]:
    """Up to two stops, at different places; one at least where there are no balls."""
    count = min(max(_pick(rng, (0.55, 0.3, 0.15)), 0 if balls else 1), most, len(places))
    stops = []
    for i, place in enumerate(places[:count]):
        plus, minus = _gaps(rng, scale)
        side = _pick(rng, (0.4, 0.3, 0.3))
        gap = ((plus, minus), (plus, math.inf), (math.inf, minus))[side]
        stops.append(fi.Stop(f"stop{i + 1}", place, gap, _law(rng, scale, kinds)))
    return tuple(stops)


def _gaps(rng: np.random.Generator, scale: Scale) -> tuple[float, float]:
    """Gaps (m) on the + and the - side, not both of them 0."""
    unit = scale.amplitude / 1e-3

    def one() -> float:
        return unit * (3e-6 if rng.random() < 0.1 else _log_uniform(rng, 1e-5, 5e-3))

    plus = one()
    minus = plus if rng.random() < 0.5 else one()
    if rng.random() < 0.15:
        return (0.0, minus) if rng.random() < 0.5 else (plus, 0.0)
    return plus, minus


def _law(rng: np.random.Generator, scale: Scale, kinds: tuple[str, ...]) -> fi.Rigid | fi.KelvinVoigt:
    if kinds[int(rng.integers(len(kinds)))] == "rigid":
        kind = _pick(rng, (0.1, 0.1, 0.1, 0.7))
        e = (0.0, 1.0, 1.0 - _log_uniform(rng, 1e-3, 0.1), float(rng.uniform(0.0, 1.0)))[kind]
        return fi.Rigid(e)
    e = 1.0 if rng.random() < 0.1 else float(rng.uniform(0.1, 1.0))
    kind = _pick(rng, (0.3, 0.1, 0.3, 0.3))
    stiffness = _log_uniform(rng, 1e2, 1e7)
    if kind == 0:
        return fi.KelvinVoigt(stiffness=stiffness, restitution=e)
    if kind == 1:
        # the dashpot of a ratio 0 to 2, over-critical ones included
        damping = float(rng.uniform(0.0, 2.0)) * 2.0 * math.sqrt(stiffness * 0.1 * scale.mass)
        return fi.KelvinVoigt(stiffness=stiffness, damping=damping)
    time = _log_uniform(rng, 5e-5, 3e-3) if kind == 2 else _log_uniform(rng, 0.01, 0.5) / scale.frequency
    return fi.KelvinVoigt(restitution=e, contact_time=time)


# ---- excitations, durations and starts ------------------------------------------------------------


def _sine(rng: np.random.Generator, system: fi.System, amplitude: float) -> fi.Sine | fi.PointForce:
    """A sine of the base or at a place that moves the structure without contacts by this amplitude (m)."""
    near = rng.random() < 0.6
    factor = float(rng.uniform(0.8, 1.2)) if near else _log_uniform(rng, 0.2, 3.0)
    frequency, forbidden = factor * system.first_frequency, _undamped(system)
    while np.any(np.abs(frequency / forbidden - 1.0) < APART):
        frequency *= 1.0 + APART
    phase, force = float(rng.uniform(0.0, 2.0 * math.pi)), rng.random() < 1.0 / 3.0
    place = _place(rng, system)
    omega, row = 2.0 * math.pi * frequency, system.point_row(place)
    # of the place that is driven, and of the base itself
    load = row if force else system.base_load * omega**2
    moved = np.abs(row @ (load / (system.K.diagonal() - omega**2 + 1j * omega * system.C.diagonal())))
    if force:
        return fi.PointForce(place, fi.Sine(amplitude / float(moved), frequency, phase))
    return fi.Sine(amplitude / max(float(moved), 1.0), frequency, phase)


def _place(rng: np.random.Generator, system: fi.System) -> str:
    names = [name for name in system.points if name != "root"]
    return names[int(rng.integers(len(names)))]


def _undamped(system: fi.System) -> np.ndarray:
    """Natural frequencies (Hz) that a drive must keep away from: without damping, and of balls on centring springs."""
    balls, n = system.balls, system.dofs
    stiffness = np.zeros((n + len(balls), n + len(balls)))
    stiffness[:n, :n] = system.K.toarray()
    for i, pair in enumerate(balls):
        stretch = np.concatenate([-pair.direction, np.eye(len(balls))[i]])
        stiffness += pair.free_stiffness * np.outer(stretch, stretch)
    mass = np.concatenate([system.M.diagonal(), [pair.mass for pair in balls]])
    values = scipy.linalg.eigh(stiffness, np.diag(mass), eigvals_only=True)
    alone = [pair.free_stiffness / pair.mass for pair in balls]
    lossless = float(system.C.diagonal().min()) == 0.0
    squares = np.array([*(values if lossless or any(alone) else []), *alone])
    # a ball without a spring is at 0 Hz, but for rounding
    return np.asarray(np.sqrt(squares[squares > 1e-9 * values[-1]]) / (2.0 * math.pi))


def _recorded(rng: np.random.Generator, system: fi.System, amplitude: float) -> fi.RecordedBase:
    """Random accelerations of the base, straight between samples a few to a period apart; it may end early."""
    frequency = system.first_frequency
    interval = 1.0 / (frequency * _log_uniform(rng, 2.0, 12.0))
    count = int(rng.integers(40, 400))
    samples = rng.normal(size=count) * amplitude * (2.0 * math.pi * frequency) ** 2 * _log_uniform(rng, 0.1, 1.0)
    velocity = float(rng.normal()) * amplitude * frequency
    return fi.RecordedBase(samples - samples.mean(), interval, velocity if rng.random() < 0.5 else 0.0)


def _cycles(rng: np.random.Generator, system: fi.System, amplitude: float) -> float:
    """Cycles that give some number of impacts by a rough count."""
    aim, per_cycle = _log_uniform(rng, 100.0, 2000.0), 0.0
    for pair in system.contacts:
        e, clearance = pair.parameters.restitution, sum(pair.gaps)
        bounces = min(1.0 / max(1.0 - e, 0.01), 30.0)
        crossings = 0.0 if math.isinf(clearance) else min(amplitude / clearance, 100.0)
        per_cycle += 1.0 + bounces + crossings * min(bounces, 5.0)
    return min(max(aim / per_cycle, FEWEST_CYCLES), MOST_CYCLES)


def _start(rng: np.random.Generator, system: fi.System, speed: float) -> tuple[fi.State, str]:
    kind = _pick(rng, (0.4, 0.3, 0.3))
    if kind < 2:
        frame = ("base", "space")[kind]
        return fi.State.at_rest(frame), f"rest in {frame}"
    # of mass-normalised modes
    velocity = speed * math.sqrt(system.total_mass) * rng.normal(size=system.dofs) / system.dofs
    share = rng.uniform(-0.9, 0.9, len(system.balls))
    ball = [s * pair.gaps[0 if s > 0.0 else 1] for s, pair in zip(share, system.balls, strict=True)]
    return fi.State(None, velocity, ball, speed * rng.normal(size=len(system.balls))), "given velocities"


def _fits(system: fi.System, excitation: fi.Sine | fi.PointForce | fi.RecordedBase, initial: fi.State) -> bool:
    """Whether the start is between the walls."""
    try:
        initial.relative_to_base(system, excitation)
    except fi.InputError:
        return False
    return True
