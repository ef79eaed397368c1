"""Measures of a case: names, units, and how each is read from dwells or from a run with its history."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import Fault, InputError, checked, name_text, require, suggestion
from femimpact.figures.study_labels import BESIDE, STATISTICS
from femimpact.integrators.cases import SineDwellResults
from femimpact.response.channels import resolve_channels
from femimpact.response.cycles import SteadyMotion
from femimpact.response.response import Response
from femimpact.sweep.curve import Columns, dwell_columns
from femimpact.system.system import System


class Source(Enum):
    """Results from which a measure is read."""

    DWELL = "the statistics of the compiled call"
    LEDGER = "the energy ledger of the compiled call, where the method sums it up; else a run of the case"
    BARE = "a dwell of the case and of the same without balls"
    RUN = "a run of the case with its history"


@dataclass(frozen=True, eq=False)
class Measure:
    """One number, or one word, of a case."""

    name: str
    unit: str
    long_name: str
    source: Source
    is_text: bool = False
    function: Callable[[Response], Any] | None = None  # of the user, of a `Response`
    channel: str = ""  # whose largest value it is; empty for any other
    better: str = ""  # "small" or "large": which of its values are better; empty where that depends on the purpose


MEASURES = {
    item.name: item
    for item in (
        *(
            Measure(one.name, one.metadata["unit"], one.metadata["words"], Source.DWELL, better="small")
            for one in fields(SteadyMotion)
            if "words" in one.metadata
        ),
        Measure("peak_ratio", "1", "peak with balls over that without, below 1 is better", Source.BARE, better="small"),
        Measure("impacts_per_cycle", "1", "impacts in a cycle of the base", Source.DWELL),
        Measure("mean_approach_speed", "m/s", "mean approach speed of the impacts", Source.DWELL, better="small"),
        Measure("largest_approach_speed", "m/s", "largest approach speed of an impact", Source.DWELL, better="small"),
        Measure("mean_impulse", "N s", "mean impulse of the impacts", Source.DWELL, better="small"),
        Measure("peak_force", "N", "largest contact force under the contact law", Source.DWELL, better="small"),
        Measure("cycle_mean_force", "N", "cycle-averaged contact force", Source.DWELL, better="small"),
        Measure("impacts_per_second", "1/s", "impacts in a second", Source.DWELL),
        Measure("loss_per_second", "W", "energy lost by structure and contacts in a second", Source.LEDGER),
        Measure("loss_per_cycle", "J", "energy lost by structure and contacts in a cycle of the base", Source.LEDGER),
        Measure("damping", "1", "loss per cycle over 4 pi times the largest energy stored", Source.LEDGER),
        Measure("energy_residual", "1", "energy unaccounted for, over the energy put in", Source.DWELL),
        Measure("regime", "", "kind of motion", Source.RUN, is_text=True),
    )
}
"""Measures by their names."""

OF_CYCLES = ("first_harmonic", "impacts_per_cycle", "cycle_mean_force", "loss_per_cycle", "damping", "regime")
"""Measures that need cycles of the base."""

INSTANTS = 16
"""Number of instants of a cycle at which the energy stored is read for the damping."""


def measures_of(
    given: Sequence[Any],
    system: System,
    without_cycle: str = "",  # the motion of the base where it has no cycle; empty where it has
) -> tuple[Measure, ...]:
    """The measures asked for: by their names, by a channel whose largest value is meant, or functions of a response."""
    found = tuple(_measure(item, system) for item in given)
    names = [item.name for item in found]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise InputError([Fault("measures", name, "", "is asked for twice")])
    for name in names:
        if without_cycle and name in OF_CYCLES:
            left = ", ".join(other for other in MEASURES if other not in OF_CYCLES)
            allowed = f"needs cycles of the base, which {without_cycle} has not: take {left}, or a channel"
            raise InputError([Fault("measures", name, "", allowed)])
    if not found:
        raise InputError([Fault("measures", "none", "", f"must be one or more of {', '.join(MEASURES)}")])
    return found


def check_names(
    measures: Sequence[Measure],
    axes: Sequence[str],  # paths
) -> None:
    """Refuse measures whose variables would have a name that another variable of the dataset, or an axis, has."""
    taken = {"case", *BESIDE}
    for path in axes:
        require(path not in taken, path, None, "", "is the name of another variable: give the argument another one")
    taken |= {f"{path}{side}" for path in axes for side in ("", ".plus", ".minus")}
    for item in measures:
        checked("measures", item.name, name_text())
        sound = bool(item.name) and "/" not in item.name
        require(sound, "measures", item.name, "", "must have a name that a variable can have: no empty one, and no /")
        variables = {f"{item.name}{end}" for end in ("", *STATISTICS)}
        shared = sorted(variables & taken)
        allowed = f"has a name that is taken: {', '.join(shared)} is another variable, or an axis"
        require(not shared, "measures", item.name, "", allowed)
        taken |= variables


def _measure(item: Any, system: System) -> Measure:
    if callable(item) and not isinstance(item, type):
        name = str(getattr(item, "__name__", type(item).__name__)).strip("<>")
        unit = str(getattr(item, "unit", ""))
        better = MEASURES[name].better if name in MEASURES else ""
        return Measure(name, unit, name.replace("_", " "), Source.RUN, function=item, better=better)
    if not isinstance(item, str):
        raise InputError([Fault("measures", item, "", "must be names, or functions of a response")])
    if item in MEASURES:
        return MEASURES[item]
    try:
        (channel,) = resolve_channels(system, (item,))
        channel.reading(system)
    except InputError as error:
        allowed = suggestion(item, MEASURES)
        if "." in item:
            allowed = f"with a dot it must be a channel, whose largest value is measured: {error.faults[0].allowed}"
        raise InputError([Fault("measures", item, "", allowed)]) from None
    words = f"largest size of the channel {channel.name}"
    return Measure(item, channel.unit, words, Source.RUN, channel=channel.name, better="small")


def columns_of(found: SineDwellResults, frequency: Array, measured: NDArray[np.int64]) -> Columns:
    """Measures of many dwells, (n,) each, as far as the compiled call has summed them up."""
    columns = dwell_columns(found, frequency)
    columns["impacts_per_second"] = columns["impacts_per_cycle"] * frequency
    if found.loss.size == frequency.size:
        columns["loss_per_cycle"] = found.loss / measured
        columns["loss_per_second"] = columns["loss_per_cycle"] * frequency
        columns["damping"] = _damping(columns["loss_per_cycle"], found.stored)
    return columns


def _damping(loss: Any, stored: Any) -> Any:
    """Loss per cycle over 4 pi times the energy stored; 0 where nothing moves."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(stored > 0.0, loss / (4.0 * math.pi * stored), 0.0)


def of_response(
    measure: Measure,
    response: Response,
    begin: float,  # s: from when on is measured
    cycles: int,  # of the base that are measured
) -> float | str:
    """A measure that is read from a run of a case."""
    if measure.function is not None:
        return float(measure.function(response))
    if measure.name == "regime":
        return response.regime.label
    last = response.time >= begin * (1.0 - 1e-12)
    if measure.channel:
        return float(np.max(np.abs(response[measure.channel][last]), initial=0.0))
    energy = response.energy
    if energy is None:
        return math.nan
    lost = (energy.structure_loss + energy.contact_loss)[last]
    loss = float(lost[-1] - lost[0]) / cycles
    if measure.name == "loss_per_second":
        return loss * response.base.frequency
    return loss if measure.name == "loss_per_cycle" else float(_damping(loss, float(np.max(energy.stored[last]))))


def of_history(
    measure: Measure,  # one that needs no cycle
    response: Response,  # with the channel of the observed place
    observed: str,
    bare: Response | None = None,  # the same without balls, for `peak_ratio`
) -> float:
    """A measure that is read from a run over the complete history of the base."""
    if measure.function is not None:
        return float(measure.function(response))
    if measure.channel or measure.name in ("peak", "peak_ratio"):
        size = abs(float(response.largest(measure.channel or observed).value))
        if measure.name != "peak_ratio":
            return size
        reference = abs(bare.largest(observed).value) if bare is not None else 0.0
        return size / reference if reference > 0.0 else math.nan
    if measure.name == "rms":
        return math.sqrt(float(np.mean(response[observed] ** 2)))
    impacts, energy, duration = response.impacts, response.energy, float(response.time[-1] - response.time[0])
    if measure.name == "impacts_per_second":
        return (len(impacts) + impacts.dropped) / duration
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
