"""Table of one collision of each contact of a study over the approach speed: restitution, force and steps."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.contact import collide
from femimpact.errors import require
from femimpact.export import figures, tables
from femimpact.integrators.methods import Method, step_of
from femimpact.study.result_directory import FILES, prepare_directory
from femimpact.study.study import Study, build_systems, method_for, read_mesh_of
from femimpact.system.contact_pair import ContactPair

SPEEDS = 7
UNITS = {
    "approach_speed": "m/s",
    "restitution_asked": "1",
    "restitution": "1",
    "restitution_with_step": "1",
    "contact_time": "s",
    "steps_per_contact": "1",
    "peak_force": "N",
    "largest_penetration": "m",
    "energy_loss": "J",
}


def approach_speeds(speed_min: float, speed_max: float) -> NDArray[np.float64]:
    """Approach speeds (m/s) of the table, even on a logarithmic axis.

    Raises `InputError` unless 0 < speed_min < speed_max, both finite.
    """
    sound = math.isfinite(speed_min) and speed_min > 0.0
    require(sound, "speed_min", speed_min, "m/s", "must be a finite number > 0 m/s")
    sound = math.isfinite(speed_max) and speed_max > speed_min
    require(sound, "speed_max", speed_max, "m/s", f"must be a finite number > speed_min, {speed_min:g} m/s")
    return np.geomspace(speed_min, speed_max, SPEEDS)


def contact_table(study: Study, speed_min: float = 0.01, speed_max: float = 1.0) -> dict[str, list[Any]]:
    """One collision of every impactor and stop of a study, at seven approach speeds.

    Parameters
    ----------
    study : Study
    speed_min, speed_max : float, m/s

    Returns
    -------
    dict of str to list
        By column, units in `UNITS`: the restitution given, that of one collision in continuous
        time and that with the study's step. Not a number where a law is given no restitution, has
        no force or duration, or cannot be stepped alone.

    Raises
    ------
    InputError
        If the speeds are no range, or the study has no contact.
    """
    speeds = approach_speeds(speed_min, speed_max)
    return _table(*_contacts(study), speeds)


def write_contact_table(
    study: Study, directory: Path, force: bool = False, speed_min: float = 0.01, speed_max: float = 1.0
) -> dict[str, list[Any]]:
    """Write the table as `contact.csv`, and force over penetration as `contact_force.png`."""
    speeds = approach_speeds(speed_min, speed_max)
    pairs, method = _contacts(study)
    columns = _table(pairs, method, speeds)
    contacts = [(pair.name, pair.law, pair.effective_mass) for pair in pairs]
    # speeds far apart would leave the slow loops too small to see
    shown = np.linspace(max(speed_min, 0.25 * speed_max), speed_max, 3)
    with prepare_directory(directory, force) as staging:
        tables.write_csv(staging.folder / FILES["contact_table"].name, columns, UNITS)
        staging.finish_part("table")
        drawn = figures.contact_laws(contacts, shown.tolist(), figures.OffScreen())
        figures.save_figure(drawn, staging.folder / FILES["force_figure"].name)
    return columns


def _contacts(study: Study) -> tuple[tuple[ContactPair, ...], Method]:
    """The pairs of the integrated system, and the study's method with its step."""
    _, system = build_systems(study, read_mesh_of(study))
    pairs = tuple(pair for pair in system.contacts if pair.has_walls)
    require(bool(pairs), "impactor", None, "", "table [[impactor]] is missing from the study")
    return pairs, method_for(study, system)


def _table(pairs: tuple[ContactPair, ...], method: Method, speeds: NDArray[np.float64]) -> dict[str, list[Any]]:
    rows = [_row(pair, method, float(speed)) for pair in pairs for speed in speeds]
    return {name: [row[name] for row in rows] for name in rows[0]}


def _row(pair: ContactPair, method: Method, speed: float) -> dict[str, Any]:
    found = collide(pair.law, pair.effective_mass, speed)
    # none where the method does not step, or not this law
    stepped = method.achieved_restitution(pair, speed)
    step = (step_of(method) or math.nan) / getattr(method, "refine", 1)
    return {
        "impactor": pair.name,
        "law": pair.law.name,
        "approach_speed": speed,
        "restitution_asked": math.nan if pair.law.restitution is None else pair.law.restitution,
        "restitution": found.restitution,
        "restitution_with_step": math.nan if stepped is None else stepped.mean,
        "contact_time": found.contact_time,
        "steps_per_contact": math.nan if pair.parameters.is_rigid else found.contact_time / step,
        "peak_force": found.peak_force,
        "largest_penetration": found.largest_penetration,
        "energy_loss": found.energy_loss,
    }
