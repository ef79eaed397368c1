"""What one ball in a box takes from whatever shakes the box: in closed form where it has one, and by runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array
from femimpact.contact.laws import KelvinVoigt, Rigid
from femimpact.errors import optional, quantity, real_array, require, takes
from femimpact.excitation.harmonic import Sine
from femimpact.integrators.cases import run_each, workers_of
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.runs import response_by
from femimpact.progress import Progress, check_progress, draws_progress
from femimpact.response.regimes import classify, significant
from femimpact.response.response import Recorder
from femimpact.structure.structure import Stop
from femimpact.system.state import ROUNDED, State
from femimpact.system.system import System

if TYPE_CHECKING:
    import xarray

FASTEST_START = 2.0
"""Largest speed of the ball at a start, relative to the box, over A w."""

SAMPLES = 256
"""Readings in a cycle, of which the effective mass of a run is taken."""

APART = 0.01
"""Share by which the losses of two motions of one rhythm differ; of a loss below 1 it is a difference."""

TWO_IMPACTS = "2:1 periodic"
"""The rhythm of the damper: in every cycle one impact on each wall."""

UNMET = "no impacts"
"""Of a ball that stands in space, out of the reach of the walls, or is still on its way to one."""

WORDS = {
    "amplitude_over_gap": "amplitude of the box over the gap, A/d",
    "loss": "loss per cycle over m w^2 A^2",
    "effective_mass": "effective mass over m",
    "stable": "whether small disturbances decay",
    "found": "share of the starts that find one impact on each wall in every cycle",
    "motion_loss": "loss per cycle over m w^2 A^2, of a motion of the runs",
    "motion_effective_mass": "effective mass over m, of a motion of the runs",
    "motion_share": "share of the starts that find the motion",
    "motion_rhythm": "impacts in so many cycles",
    "fold": "A/d from which on the motion in closed form exists",
    "best": "A/d of the largest loss",
    "symmetry_breaking": "A/d up to which it is stable",
    "sure_from": "A/d from which on all starts find one impact on each wall in every cycle",
    "sure_to": "A/d up to which all do",
}
"""Of the variables of a curve."""

OVER = ("restitution", "amplitude_over_gap")


@draws_progress
@takes(
    starts=quantity("1", at_least=0, at_most=10_000, integer=True),
    seed=quantity("1", at_least=0, integer=True),
    cycles=quantity("1", at_least=60, integer=True),
    gravity=quantity("1", at_least=0.0, at_most=1e3),
    stiffness=optional(quantity("1", above=0.0, at_most=1e9)),
)
def damper_curve(
    amplitude_over_gap: ArrayLike,
    restitution: ArrayLike,
    *,
    starts: int = 0,
    seed: int = 0,
    cycles: int = 720,
    gravity: float = 0.0,
    stiffness: float | None = None,
    threads: int | None = None,
    progress: Progress | bool | None = None,
) -> xarray.Dataset:
    """Loss, effective mass and stability of a ball in a box that moves as A sin(w t), whatever carries the box.

    With r = d/A, d the gap from the middle to a wall, and k = (1 - e)/(1 + e), the ball meets each wall once in a cycle
    with v = 2 [pi r + sqrt(pi^2 + 4 k^2 (1 - r^2))]/(pi^2 + 4 k^2), its speed over A w, at the phase of
    sin(phi) = pi v/2 - r and cos(phi) = -k v. It takes 4 k v^2 of m w^2 A^2 in a cycle, and its force on the box is
    -m_e s'' - c s' of the motion s, with m_e = (4/pi) m v sin(phi) and c = loss m w/pi.

    Parameters
    ----------
    amplitude_over_gap : array_like (levels,)
        A/d, increasing.
    restitution : array_like (restitutions,)
        e, increasing.
    starts : int
        Runs at each point: ball and phase anywhere, the ball's speed in the box up to 2 A w; some 15 ms each. 0 gives
        the closed form alone.
    seed : int
        Of the starts, which are the same at all points.
    cycles : int
        Length of a run; the last third is measured, of 120 cycles or more for periods up to 6.
    gravity : float
        Constant acceleration along the motion, over w^2 A: by runs.
    stiffness : float, optional
        Of walls of the Kelvin-Voigt law with the restitution, over m w^2: by runs. None is a rigid wall.
    threads : int, optional
        For the runs; as many as there are cores by default.
    progress : callable or bool, optional
        Called with the share done, 0 to 1; True draws a bar.

    Returns
    -------
    xarray.Dataset over restitution and amplitude_over_gap
        - `loss`, `effective_mass`, `stable` of the motion above between rigid walls without gravity, not a number where
          there is none. Along the restitution `fold`, the A/d from which on it exists, and `symmetry_breaking`, up to
          which it is stable; at `best`, 2 k/pi, the loss is largest, 4/k.
        - With starts, over `motion` too, each motion that was found: `motion_share` of the starts, `motion_loss`,
          `motion_effective_mass` (within some 1e-3) and `motion_rhythm`, the largest loss first. What has no period up
          to 8 cycles is one, "irregular", with its mean.
        - `found`, the share of the starts that find one impact on each wall in every cycle. Along the restitution
          `sure_from` and `sure_to` are the ends of the longest series of levels at which all starts do but those of a
          ball that meets no wall, "no impacts". `sure_from` is the designer's point, and not `best`.

    Raises
    ------
    InputError
        If a value is out of range, or gravity or stiffness are asked for without starts.

    Notes
    -----
    The half map has the trace 2 e - (1 + e)^2 pi sin(phi)/(2 v) and the determinant e^2; the other root of the
    quadratic is unstable. Stable here is no promise for a part that the ball moves: see `orbits.two_impact_orbits`.

    Examples
    --------
    >>> import femimpact as fi
    >>> curve = fi.design.damper_curve([0.25, 0.5], 0.6)
    >>> curve["loss"].values.round(6).tolist()
    [[8.835629, 3.380524]]
    """
    import xarray

    levels = _increasing("amplitude_over_gap", amplitude_over_gap, 1e-4, 1e3)
    # compliant walls have no restitution of 0
    e = _increasing("restitution", restitution, 0.0 if stiffness is None else 0.01, 0.9999)
    closed = stiffness is None and gravity == 0.0
    allowed = "must be 1 or more with gravity or compliant walls, which have no closed form"
    require(closed or starts > 0, "starts", starts, "1", allowed)
    report, workers = check_progress(progress), workers_of(threads)
    variables: dict[str, tuple[tuple[str, ...], Any]] = {}
    if closed:
        variables |= {name: (OVER, values) for name, values in _two_impacts(levels, e[:, None]).items()}
        variables |= {name: (OVER[:1], values) for name, values in _edges(e).items()}
    if starts:
        low, high = np.transpose([(-1.0, 1.0), (-FASTEST_START, FASTEST_START), (0.0, 2.0 * math.pi)])
        begun = np.random.default_rng(seed).uniform(low, high, (starts, 3)).tolist()
        runs = [(one, level, start) for one in e.tolist() for level in levels.tolist() for start in begun]
        measured = run_each(lambda run, _: _measured(*run, cycles, gravity, stiffness), runs, workers, report)
        variables |= _of_runs(levels, [_motions(measured[i : i + starts]) for i in range(0, len(runs), starts)])
    known = {"starts": starts, "seed": seed, "cycles": cycles, "gravity": gravity, "stiffness": stiffness or math.inf}
    curve = xarray.Dataset(variables, {"restitution": e, "amplitude_over_gap": levels}, known)
    for name, words in WORDS.items():
        if name in curve.variables:
            curve[name].attrs |= {"long_name": words}
    return curve


def _increasing(key: str, values: ArrayLike, least: float, most: float) -> Array:
    allowed = f"must be one or more increasing numbers, {least:g} to {most:g}"
    numbers = np.atleast_1d(real_array(key, values, "1", allowed))
    sound = numbers.ndim == 1 and numbers.size > 0 and bool(np.all(np.diff(numbers, prepend=-1.0) > 0.0))
    require(sound and least <= numbers[0] and numbers[-1] <= most, key, values, "1", allowed)
    return numbers


# ---- in closed form -------------------------------------------------------------------------------


def _edges(e: Array) -> dict[str, Array]:
    k = (1.0 - e) / (1.0 + e)
    return {
        "fold": 2.0 * k / np.sqrt(math.pi**2 + 4.0 * k**2),
        "best": 2.0 * k / math.pi,
        "symmetry_breaking": 2.0 * np.sqrt(4.0 + (math.pi * k) ** 2) / (math.pi**2 - 4.0),
    }


def _two_impacts(level: Array, e: Array) -> dict[str, NDArray[Any]]:
    """Loss, effective mass and stability of one impact on each wall in a cycle, half a cycle apart."""
    k, r = (1.0 - e) / (1.0 + e), 1.0 / level
    below = math.pi**2 + 4.0 * k**2 * (1.0 - r**2)
    v = 2.0 * (math.pi * r + np.sqrt(np.where(below >= 0.0, below, np.nan))) / (math.pi**2 + 4.0 * k**2)
    sine = 0.5 * math.pi * v - r
    exists = _is_free(v, np.arctan2(sine, -k * v), sine, r)
    trace = 2.0 * e - (1.0 + e) ** 2 * math.pi * sine / (2.0 * v)
    return {
        "loss": np.where(exists, 4.0 * k * v**2, np.nan),
        "effective_mass": np.where(exists, 4.0 / math.pi * v * sine, np.nan),
        "stable": exists & (np.abs(trace) < 1.0 + e**2),
    }


def _is_free(v: Array, phase: Array, sine: Array, r: Array) -> NDArray[np.bool_]:
    """Whether the ball leaves the + wall and meets nothing for half a cycle.

    Its distance to a wall is least where both are equally fast, at the angles pi -+ arccos(v): the - wall is nearest at
    the first, the + wall at the second.
    """
    free = np.isfinite(v)
    turn = np.arccos(np.minimum(v, 1.0))
    for angle, side in ((math.pi - turn, -1.0), (math.pi + turn, 1.0)):
        later = np.mod(angle - phase, 2.0 * math.pi)
        distance = side * (np.sin(angle) - sine + v * later) + (1.0 - side) * r
        free = free & ((v >= 1.0) | (later >= math.pi) | (distance >= 0.0))
    return np.asarray(free)


# ---- by runs --------------------------------------------------------------------------------------


class Motion(NamedTuple):
    """What a run does in the end, or several runs alike."""

    loss: float
    effective_mass: float
    share: float
    rhythm: str


def _measured(
    e: float,
    level: float,
    begun: Sequence[float],  # place (m), speed over that of the box, and phase (rad)
    cycles: int,
    gravity: float,
    stiffness: float | None,
) -> Motion:
    """One run, of a ball of 1 kg between walls at -+1 m that move with the base at 1 rad/s."""
    place, speed, phase = begun
    walls = Stop("walls", "ball", 1.0, Rigid(e) if stiffness is None else KelvinVoigt(stiffness, restitution=e))
    none, weight = [[0.0]], [-gravity * level]
    system = System.from_matrices([[1.0]], none, none, points={"ball": [1.0]}, stops=[walls], constant_load=weight)
    drive, period, start = Sine(level, 0.5 / math.pi, phase), 2.0 * math.pi, State([place], [level * speed])
    method, record = EventDriven(samples_per_cycle=SAMPLES), Recorder(("ball",), every=SAMPLES)
    run = response_by(method, system, drive, cycles * period, record, start)
    assert run.energy is not None
    # a contact of the last cycle may not be finished, and is then not in the table
    last, window = cycles - 1, cycles // 3
    first, end = (last - window) * period, last * period
    regime, lost = classify(run.impacts, run.sticking, drive.frequency, first, end), run.energy.contact_loss
    rhythm = "irregular" if regime.kind == "chaotic" else regime.kind
    if regime.cycles:
        met = run.impacts.side[(run.impacts.time >= first) & significant(run.impacts)]
        rhythm = f"{regime.impacts}:{regime.cycles} periodic" + ", one wall" * (np.unique(met).size < 2)
    # the ball's displacement in space, in phase with the box, is that of the force on the box
    in_phase = float(run.steady.first_harmonic[0] * np.cos(run.steady.phase[0]))
    return Motion(float(lost[last] - lost[last - window]) / (window * level**2), 1.0 + in_phase / level, 1.0, rhythm)


def _motions(measured: Sequence[Motion]) -> list[Motion]:
    """The motions of the starts of a point with their shares, the largest loss first; of equal rhythms by the loss."""
    groups = list[list[Motion]]()
    for one in sorted(measured, key=lambda one: (one.rhythm, one.loss)):
        last = groups[-1][-1] if groups else one
        apart = "periodic" in one.rhythm and one.loss - last.loss > APART * max(one.loss, 1.0)
        if groups and last.rhythm == one.rhythm and not apart:
            groups[-1].append(one)
        else:
            groups.append([one])
    means = []
    for group in groups:
        loss, mass = np.mean([one[:2] for one in group], axis=0).tolist()
        means.append(Motion(loss, mass, len(group) / len(measured), group[0].rhythm))
    return sorted(means, reverse=True)


def _of_runs(levels: Array, motions: list[list[Motion]]) -> dict[str, tuple[tuple[str, ...], Any]]:
    """Variables of the motions (restitutions x levels), filled up with what is not a number and no words."""
    most, shape = max(map(len, motions)), (-1, levels.size)
    empty = Motion(math.nan, math.nan, math.nan, "")
    columns = zip(*(one for own in motions for one in [*own, *[empty] * (most - len(own))]), strict=True)
    found, unmet = (
        np.reshape([sum(one.share for one in own if one.rhythm == rhythm) for own in motions], shape)
        for rhythm in (TWO_IMPACTS, UNMET)
    )
    series = np.array([_longest(row) for row in (found > unmet) & (found + unmet > 1.0 - ROUNDED)])
    edges = np.where(series < 0, np.nan, levels[series])
    return {
        "found": (OVER, found),
        "sure_from": (OVER[:1], edges[:, 0]),
        "sure_to": (OVER[:1], edges[:, 1]),
    } | {
        f"motion_{name}": ((*OVER, "motion"), np.reshape(values, (*shape, most)))
        for name, values in zip(Motion._fields, columns, strict=True)
    }


def _longest(sure: NDArray[np.bool_]) -> tuple[int, int]:
    """First and last of the longest series of true values; -1 without one."""
    changes = np.flatnonzero(np.diff(np.concatenate([[False], sure, [False]])))
    series = list(zip(changes[::2].tolist(), changes[1::2].tolist(), strict=True))
    first, after = max(series, key=lambda each: each[1] - each[0], default=(-1, 0))
    return first, after - 1
