"""Cases whose base has no cycle (a chirp, a random motion, a shock, a record): each is a run of its whole history."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from femimpact.arrays import Array
from femimpact.parametric.definition import ParameterStudy
from femimpact.parametric.measures import Measure
from femimpact.parametric.paths import (
    Place,
    Stage,
    placed_balls,
    scaled_starts,
    structure_at_balls,
    study_with,
    unit_draws,
)
from femimpact.response.response import Recorder, Response
from femimpact.study.study import Study
from femimpact.system.modes import with_checked_pairs
from femimpact.system.state import State
from femimpact.system.system import System, without_impactors

INSTANTS = 4096
"""Of a motion at which its largest speed is looked for, which scales the speeds of starts."""


def values_of_case(study: ParameterStudy, case: int) -> dict[Place, Any]:
    """Values of a case by their places."""
    table = study.table
    return {place: table.value(axis, case) for axis, place in enumerate(table.places)}


def history_of_case(
    study: ParameterStudy, case: int, start: int, record: Recorder, without_balls: bool = False
) -> Response:  # fmt: skip
    """The run of one start of a case.

    Parameters
    ----------
    study : ParameterStudy
        Of a `Study`.
    case, start : int
    record : Recorder
    without_balls : bool
        Whether the cavities are empty.

    Returns
    -------
    Response

    Raises
    ------
    InputError
        If the case cannot be run.
    """
    values = values_of_case(study, case)
    given: Any = study.study
    changed = study_with(given, {place: value for place, value in values.items() if place.stage is Stage.CASE})
    system = _with_contacts(study.systems.of(values), changed)
    state = _start(study, system, changed, values, start)
    if without_balls:
        system, state = without_impactors(system), replace(state, ball_displacement=None, ball_velocity=None)
    method = study.systems.method_of(system, values)
    return method.run(system, changed.base.excitation, changed.base.history_duration, record, state)


def value_of_history(
    measure: Measure,  # one that needs no cycle
    response: Response,  # with the channel of the observed place
    observed: Any,
) -> float:
    """A measure of a whole run."""
    if measure.function is not None:
        return float(measure.function(response))
    if measure.channel:
        return abs(float(response.largest(measure.channel).value))
    impacts, energy, duration = response.impacts, response.energy, float(response.time[-1] - response.time[0])
    hits = len(impacts) + impacts.dropped
    if measure.name == "peak":
        return abs(float(response.largest(observed).value))
    if measure.name == "rms":
        return math.sqrt(float(np.mean(response[observed] ** 2)))
    if measure.name == "impacts_per_second":
        return hits / duration
    if measure.name in ("loss_per_second", "energy_residual"):
        if energy is None:
            return math.nan
        lost = energy.structure_loss + energy.contact_loss
        return float(energy.residual if measure.name == "energy_residual" else (lost[-1] - lost[0]) / duration)
    columns = {
        "mean_approach_speed": impacts.approach_speed, "largest_approach_speed": impacts.approach_speed,
        "mean_impulse": impacts.impulse, "peak_force": impacts.peak_force,
    }  # fmt: skip
    sizes = np.abs(columns[measure.name])
    if not sizes.size:
        return 0.0
    return float(sizes.mean() if measure.name.startswith("mean") else sizes.max())


def _with_contacts(system: System, changed: Study) -> System:
    """The system with the gaps and the laws of a study."""
    items: dict[str, Any] = {item.name: item for item in changed.structure.impactors}
    items |= {item.name: item for item in changed.structure.absorbers}
    items |= {item.name: item for item in changed.structure.stops}
    contacts = tuple(
        replace(pair, gaps=items[pair.name].gaps, law=items[pair.name].contact) for pair in system.contacts
    )
    return with_checked_pairs(system, contacts)


def _start(study: ParameterStudy, system: System, changed: Study, values: dict[Place, Any], start: int) -> State:
    """The start of a case: that of its base, with the balls where the axes or the draws have them."""
    balls, frame = len(system.balls), changed.base.start
    state = State.static() if frame == "static" else State.at_rest(frame)
    if study.starts > 1:
        gaps = np.array([[pair.gaps for pair in system.balls]], dtype=float).reshape(1, balls, 2)
        draws = unit_draws(study.starts, balls, study.seed)
        placed, moving = (both[0, start] for both in scaled_starts(draws, gaps, _largest_speed(changed)))
        if state.is_static_on(system):
            placed = placed + structure_at_balls(system, state, changed.base.excitation)
    else:
        by_path = {place.path: value for place, value in values.items()}
        placed, moving = (
            np.array([float(by_path.get(f"start.{pair.name}.{name}", none)) for pair in system.balls])
            for name, none in (("position", np.nan), ("speed", 0.0))
        )
        placed = placed_balls(placed, system, state, changed.base.excitation)
    # what is not given may be that of the static state
    given = {"ball_displacement": placed} if placed.size and not np.isnan(placed).any() else {}
    return replace(state, **given, **({"ball_velocity": moving} if np.any(moving) else {}))


def _largest_speed(changed: Study) -> Array:
    """Largest speed of the base over its history, (1,) in m/s."""
    time = np.linspace(0.0, changed.base.history_duration, INSTANTS)
    return np.array([float(np.abs(changed.base.excitation.velocity(time)).max())])
