"""What one ball in a box takes from whatever shakes the box: in closed form where it has one, and by runs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from femimpact.arrays import Array
from femimpact.contact.laws import KelvinVoigt, Rigid
from femimpact.errors import optional, quantity, real_array, require, takes
from femimpact.excitation.harmonic import Sine
from femimpact.integrators.cases import cores, run_each
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.runs import response_by
from femimpact.progress import Progress, check_progress, draws_progress
from femimpact.response.regimes import classify, significant
from femimpact.response.response import Recorder
from femimpact.structure.structure import Stop
from femimpact.system.state import State
from femimpact.system.system import System

if TYPE_CHECKING:
    import xarray

SAMPLES = 256
"""Readings in a cycle, of which the effective mass of a run is taken."""

APART = 0.01
"""Share by which the losses of two motions of one rhythm differ; of a loss below 1 it is a difference."""

POINT = ["restitution", "amplitude_over_gap"]


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
    progress: Progress | bool | None = None,
) -> xarray.Dataset:
    """Loss, effective mass and stability of a ball in a box that moves as A sin(w t), whatever carries the box.

    With r = d/A, d the gap from the middle to a wall, and k = (1 - e)/(1 + e), the ball meets each wall once in a cycle
    with v = 2 [pi r + sqrt(pi^2 + 4 k^2 (1 - r^2))]/(pi^2 + 4 k^2), its speed over A w, at the phase of
    sin(phi) = pi v/2 - r and cos(phi) = -k v. It takes 4 k v^2 of m w^2 A^2 in a cycle, and its force on the box is
    -m_e s'' - c s' of the motion s, with m_e = (4/pi) m v sin(phi) and c = loss m w/pi. Stable here is no promise for a
    part that the ball moves: see `orbits.two_impact_orbits`.

    Parameters
    ----------
    amplitude_over_gap : array_like (levels,)
        A/d, increasing.
    restitution : array_like (restitutions,)
        e, increasing.
    starts : int
        Runs at each point: ball and phase anywhere, its speed in the box up to 2 A w; some 15 ms each. 0 gives the
        closed form alone.
    seed : int
        Of the starts, which are the same at all points.
    cycles : int
        Length of a run, of which the last third is measured.
    gravity : float
        Constant acceleration along the motion, over w^2 A: by runs.
    stiffness : float, optional
        Of walls of the Kelvin-Voigt law with the restitution, over m w^2: by runs. None is a rigid wall.
    progress : callable or bool, optional
        Called with the share done, 0 to 1; True draws a bar.

    Returns
    -------
    xarray.Dataset over restitution and amplitude_over_gap
        - `loss`, `effective_mass`, `stable` of the motion above, not a number where there is none; `fold`, from which
          A/d on it exists, and `symmetry_breaking`, up to which it is stable. At `best`, 2 k/pi, the loss is 4/k.
        - With starts, over `motion` too, each motion that starts lead to: `motion_share` of the starts, `motion_loss`,
          `motion_effective_mass` (to some 1e-3) and `rhythm`, the largest loss first. All that is "irregular", without
          a period up to 8 cycles, is one motion.
        - `both_walls`, the share of the starts that lead to one impact on each wall in every cycle, and `sure_from`,
          the first of the longest series of A/d at which all do but a ball that meets no wall: the designer's point.

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
    closed, report = stiffness is None and gravity == 0.0, check_progress(progress)
    allowed = "must be 1 or more with gravity or compliant walls, which have no closed form"
    require(closed or starts > 0, "starts", starts, "1", allowed)
    settings = {"cycles": cycles, "gravity": gravity, "stiffness": stiffness or math.inf}
    curve = xarray.Dataset(coords=dict(zip(POINT, (e, levels), strict=True)), attrs=settings)
    if closed:
        curve = curve.assign(_two_impacts(curve["amplitude_over_gap"], curve["restitution"]))
    if starts:
        # place over d, speed over A w, phase
        low, high = (-1.0, -2.0, 0.0), (1.0, 2.0, 2.0 * math.pi)
        begun = np.random.default_rng(seed).uniform(low, high, (starts, 3)).tolist()
        cases = [(one, level, *start) for one in e.tolist() for level in levels.tolist() for start in begun]
        rows = run_each(lambda case, _: _measured(case, cycles, gravity, stiffness), cases, cores(), report)
        curve = curve.merge(_motions(rows, starts)).assign_attrs(starts=starts, seed=seed)
    return curve.transpose(*POINT, ...)


def _increasing(key: str, values: ArrayLike, least: float, most: float) -> Array:
    allowed = f"must be one or more increasing numbers, {least:g} to {most:g}"
    numbers = np.atleast_1d(real_array(key, values, "1", allowed))
    sound = numbers.ndim == 1 and numbers.size > 0 and bool(np.all(np.diff(numbers, prepend=-1.0) > 0.0))
    require(sound and least <= numbers[0] and numbers[-1] <= most, key, values, "1", allowed)
    return numbers


def _two_impacts(level: xarray.DataArray, e: xarray.DataArray) -> dict[str, Any]:
    """The variables of one impact on each wall in a cycle, half a cycle apart, in closed form."""
    k, r = (1.0 - e) / (1.0 + e), 1.0 / level
    square = math.pi**2 + 4.0 * k**2 * (1.0 - r**2)
    v = 2.0 * (math.pi * r + np.sqrt(square.where(square >= 0.0))) / (math.pi**2 + 4.0 * k**2)
    sine = 0.5 * math.pi * v - r
    phase, turn, exists = np.arctan2(sine, -k * v), np.arccos(np.minimum(v, 1.0)), v > 0.0
    # on its way to the other wall the ball is nearest to a wall where both are equally fast, if they ever are
    for angle in (math.pi - turn, math.pi + turn):
        later = (angle - phase) % (2.0 * math.pi)
        exists = exists & ((later >= math.pi) | (abs(sine + r - v * later - np.sin(angle)) <= r))
    # of the half map, whose determinant is e^2
    trace = 2.0 * e - (1.0 + e) ** 2 * math.pi * sine / (2.0 * v)
    return {
        "loss": (4.0 * k * v**2).where(exists),
        "effective_mass": (4.0 / math.pi * v * sine).where(exists),
        "stable": exists & (abs(trace) < 1.0 + e**2),
        "fold": 2.0 * k / np.sqrt(math.pi**2 + 4.0 * k**2),
        "best": 2.0 * k / math.pi,
        "symmetry_breaking": 2.0 * np.sqrt(4.0 + (math.pi * k) ** 2) / (math.pi**2 - 4.0),
    }


def _measured(case: tuple[float, ...], cycles: int, gravity: float, stiffness: float | None) -> tuple[Any, ...]:
    """Point, rhythm, loss and effective mass of a run: a ball of 1 kg, walls at -+1 m on a base of 1 rad/s."""
    e, level, place, speed, phase = case
    walls = Stop("walls", "ball", 1.0, Rigid(e) if stiffness is None else KelvinVoigt(stiffness, restitution=e))
    none, weight = [[0.0]], [-gravity * level]
    system = System.from_matrices([[1.0]], none, none, points={"ball": [1.0]}, stops=[walls], constant_load=weight)
    drive, period, start = Sine(level, 0.5 / math.pi, phase), 2.0 * math.pi, State([place], [level * speed])
    method, record = EventDriven(samples_per_cycle=SAMPLES), Recorder(("ball",), every=SAMPLES)
    run = response_by(method, system, drive, cycles * period, record, start)
    assert run.energy is not None
    # a contact of the last cycle may not be finished, and is then not in the table
    last, first = cycles - 1, cycles - 1 - cycles // 3
    regime = classify(run.impacts, run.sticking, drive.frequency, first * period, last * period)
    rhythm = "irregular" if regime.kind == "chaotic" else regime.kind
    if regime.cycles:
        met = run.impacts.side[(run.impacts.time >= first * period) & significant(run.impacts)]
        rhythm = f"{regime.impacts}:{regime.cycles} periodic" + ", one wall" * (np.unique(met).size < 2)
    loss = float(np.diff(run.energy.contact_loss[[first, last]])[0]) / ((last - first) * level**2)
    # of the force on the box the part in phase is that of the ball's displacement in space
    return e, level, rhythm, loss, 1.0 + float((run.steady.first_harmonic * np.cos(run.steady.phase))[0]) / level


def _motions(rows: tuple[Any, ...], starts: int) -> xarray.Dataset:
    """Variables of the motions of runs."""
    import pandas

    names = ["motion_loss", "motion_effective_mass"]
    frame = pandas.DataFrame(rows, columns=[*POINT, "rhythm", *names]).sort_values(names[0])
    step = frame.groupby([*POINT, "rhythm"])[names[0]].diff()
    frame["apart"] = frame["rhythm"].str.contains("periodic") & (step > APART * frame[names[0]].clip(lower=1.0))
    frame["other"] = frame.groupby([*POINT, "rhythm"])["apart"].cumsum()
    groups = frame.groupby([*POINT, "rhythm", "other"])[names]
    table = groups.mean().assign(motion_share=groups.size() / starts).reset_index().drop(columns="other")
    table["motion"] = table.groupby(POINT)[names[0]].rank(method="first", ascending=False).astype(int) - 1
    motions: xarray.Dataset = table.set_index([*POINT, "motion"]).to_xarray()
    motions["rhythm"] = motions["rhythm"].fillna("").astype(str)
    share, unmet = (
        motions["motion_share"].where(motions["rhythm"] == rhythm).sum("motion")
        for rhythm in ("2:1 periodic", "no impacts")
    )
    sure = (share > unmet) & (share + unmet > 1.0 - 0.5 / starts)
    levels = np.append(motions["amplitude_over_gap"].to_numpy(), math.nan)
    # of each level how many from it on are sure
    series = [[int(np.argmin(np.append(row[i:], False))) for i in range(row.size)] for row in sure.to_numpy()]
    first = [int(np.argmax(lengths)) if any(lengths) else -1 for lengths in series]
    return motions.assign(both_walls=share, sure_from=("restitution", levels[first]))
