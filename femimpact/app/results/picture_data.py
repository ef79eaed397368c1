"""Data of pictures, stored with the results of a run and read back: pictures can be drawn again at any time."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from femimpact.app.results.result_directory import FILES
from femimpact.app.results.results import carried_of, read_dataset, read_table
from femimpact.app.study.drives import PARTS, force_of, force_table, made_of, table_of
from femimpact.arrays import Array
from femimpact.convergence.table import ConvergenceTable
from femimpact.errors import require
from femimpact.excitation.drives import Drives, HammerBlow, PointForce
from femimpact.excitation.excitation import Excitation
from femimpact.excitation.records import RecordedBase
from femimpact.excitation.sums import Sum
from femimpact.files import plain as plain_data
from femimpact.files import write_netcdf
from femimpact.response.cycles import no_steady_motion
from femimpact.response.energy import EnergyLedger
from femimpact.response.history import Snapshots
from femimpact.response.impacts import IMPACT_UNITS, Impacts, ImpactStatistics, StickingPhases, impact_statistics
from femimpact.response.response import Response
from femimpact.scene.placed import DrawnContact, DrawnSystem
from femimpact.structure.beam import Beam, Segment
from femimpact.structure.structure import Dashpot, PointMass, Spring, Structure, Support
from femimpact.sweep.curve import SWEEP_UNITS, FrequencyResponse
from femimpact.system.modes import Modes
from femimpact.system.system import System

if TYPE_CHECKING:
    import xarray


ABOUT = "about"
"""Variable that holds, as JSON, everything that is not an array."""

BASE_SAMPLES = "base_samples"
"""Variable that holds the samples of the record that moves the base."""

SNAPSHOT_DIMS = {
    "displacement": "dof",
    "velocity": "dof",
    "ball_displacement": "ball",
    "ball_velocity": "ball",
    "contact_force": "contact",
}


# ---- records ----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class SweptCurves:
    """Response curves by their names."""

    curves: Mapping[str, FrequencyResponse]
    coarse: Array | None = None  # Hz: the even grid
    # words, frequencies (Hz), and the smallest and the largest peaks (m) of several starts
    bands: Sequence[tuple[str, Array, Array, Array]] = ()


@dataclass(frozen=True, eq=False)
class StructureModes:
    """Modes of a structure without its balls."""

    system: System  # or what a picture knows of one
    modes: Modes
    structure: Structure | None


@dataclass(frozen=True, eq=False)
class Run:
    """A run, and its last cycles where they are read at every step."""

    whole: Response
    end: Response | None = None


# ---- modes ----------------------------------------------------------------------------------------


def write_mode_shapes(path: Path, system: System, modes: Modes, structure: Structure) -> None:
    """Write mode shapes at the nodes, with the parts that a picture shows on them."""
    import xarray

    data: dict[str, Any] = {
        name: ("mode", np.array(getattr(modes, name)), {"units": unit})
        for name, unit in (
            ("natural_frequency", "Hz"),
            ("damping_ratio", "1"),
            ("participation_factor", "kg^0.5"),
        )
    }
    shapes = np.asarray(system.expansion @ modes.vectors)
    text = "deflection and slope at each node in turn, mass-normalised"
    data["shape"] = (("dof", "mode"), shapes, {"units": "kg^-0.5, kg^-0.5/m", "long_name": text})
    data["node"] = ("node", np.array(system.nodes), {"units": "m", "long_name": "distance from the root"})
    data[ABOUT] = ((), json.dumps(structure_parts(structure, system)))
    write_netcdf(path, xarray.Dataset(data, attrs={"total_mass_kg": system.total_mass}))


def read_mode_shapes(folder: Path, summary: Mapping[str, Any]) -> StructureModes | None:
    """Modes with the system and the structure as pictures take them; None where the results have none.

    Results of earlier versions have no structure.
    """
    data = read_dataset(folder, "mode_shapes", summary)
    if data is None:
        return None
    names = ("natural_frequency", "damping_ratio", "participation_factor")
    modes = Modes(**{name: data[name].to_numpy() for name in names}, vectors=data["shape"].to_numpy())
    about = json.loads(data[ABOUT].item()) if ABOUT in data else {"points": {}, "contacts": []}
    system = _system(about, data["node"].to_numpy(), float(data.attrs["total_mass_kg"]))
    system = dataclasses.replace(system, modes=(modes.natural_frequency, modes.damping_ratio))
    return StructureModes(cast(System, system), modes, _structure(about) if ABOUT in data else None)


# ---- parts ----------------------------------------------------------------------------------------


def _parts(structure: Structure) -> dict[str, Any]:
    """The structure without its contacts, which are those of the system."""
    parts = {name: getattr(structure, name) for name in ("supports", "springs", "dashpots", "masses")}
    return {
        name: [dataclasses.asdict(part) for part in several]
        for name, several in (parts | {"segments": structure.beam.segments}).items()
    }


def structure_parts(structure: Structure, system: System) -> dict[str, Any]:
    """A structure with the places and contacts of its system, in what JSON has."""
    plain: dict[str, Any] = plain_data(
        _parts(structure) | {"points": dict(system.points), "contacts": _contacts(system)}
    )
    return plain


def read_parts(about: Mapping[str, Any]) -> tuple[Structure, DrawnSystem]:
    """The structure without its contacts, and its places and contacts, as `structure_drawing` or a run stored them."""
    return _structure(about), _system(about)


def read_run_parts(
    folder: Path,
    key: str,  # {"last_cycles", "snapshots"}
    summary: Mapping[str, Any],
) -> tuple[Structure, DrawnSystem] | None:
    """Structure, places and contacts of a run, from a file of it; None where the results do not have that file."""
    data = read_dataset(folder, key, summary)
    return None if data is None else read_parts(json.loads(data[ABOUT].item()))


def _structure(about: Mapping[str, Any]) -> Structure:
    """The structure that `_parts` wrote; results of earlier versions have fewer parts."""
    return Structure(
        beam=Beam(tuple(Segment(**segment) for segment in about["segments"])),
        supports=tuple(Support(**support) for support in about["supports"]),
        masses=tuple(PointMass(**body) for body in about.get("masses", ())),
        springs=tuple(Spring(**spring) for spring in about.get("springs", ())),
        dashpots=tuple(Dashpot(**dashpot) for dashpot in about.get("dashpots", ())),
    )


def _contacts(system: System) -> list[dict[str, Any]]:
    return [
        {
            "name": pair.name,
            "position": pair.position,
            "mass": pair.mass,
            "gaps": pair.gaps,
            # read by earlier versions
            "rigid": pair.parameters.is_rigid,
            "fixed_to": pair.fixed_to,
            "free_stiffness": pair.free_stiffness,
            "free_damping": pair.free_damping,
        }
        for pair in system.contacts
    ]


def _system(
    about: Mapping[str, Any],
    nodes: Array | None = None,  # (n,) m
    total_mass: float = math.nan,  # kg
) -> DrawnSystem:
    """Places and contacts that were stored; the laws are known by the statistics of their impacts."""
    laws = {name: given["law"] for name, given in about.get("statistics_of", {}).items()}
    contacts = tuple(
        DrawnContact(
            name=contact["name"],
            position=contact["position"],
            mass=_finite_or(contact["mass"], math.inf),
            gaps=(_finite_or(contact["gaps"][0], math.inf), _finite_or(contact["gaps"][1], math.inf)),
            # results of earlier versions do not have it
            fixed_to=contact.get("fixed_to", "base"),
            law=laws.get(contact["name"], ""),
            free_stiffness=contact.get("free_stiffness", math.nan),
            free_damping=contact.get("free_damping", math.nan),
        )
        for contact in about["contacts"]
    )
    return DrawnSystem(np.zeros(0) if nodes is None else nodes, about["points"], contacts, total_mass)


# ---- history --------------------------------------------------------------------------------------


def write_snapshots(path: Path, structure: Structure, response: Response, exaggeration: float | None) -> None:
    """Write the snapshots of a response, with the data that a movie needs beside them."""
    snapshots = response.snapshots
    if snapshots is None:
        raise AssertionError("only of a response with snapshots")
    units = {"displacement": "m, 1", "velocity": "m/s, 1/s", "contact_force": "N"}
    data: dict[str, Any] = {
        name: (("time", dim), np.array(getattr(snapshots, name)), {"units": units.get(name, "m")})
        for name, dim in SNAPSHOT_DIMS.items()
    }
    data["ball_velocity"][2]["units"] = "m/s"
    data["node"] = ("node", np.array(response.system.nodes), {"units": "m"})
    data |= _base_arrays(response)
    data[ABOUT] = ((), _about(structure, response) | {"exaggeration": exaggeration})
    _write(path, data, snapshots.time)


def write_last_cycles(
    path: Path,
    structure: Structure,
    response: Response,  # the run
    end: Response,  # its last cycles
) -> None:
    """Write the channels of the last cycles of a run at every step."""
    data: dict[str, Any] = {name: ("time", np.array(values), {"units": end.units[name]}) for name, values in
                            end.channels.items()}  # fmt: skip
    data |= _base_arrays(response)
    data[ABOUT] = ((), _about(structure, response))
    _write(path, data, end.time)


def _write(path: Path, data: dict[str, Any], time: Array) -> None:
    import xarray

    data[ABOUT] = ((), json.dumps(plain_data(data[ABOUT][1])))
    write_netcdf(path, xarray.Dataset(data, coords={"time": ("time", np.array(time), {"units": "s"})}))


def _about(structure: Structure, response: Response) -> dict[str, Any]:
    """Structure, base, contacts and statistics of a run, for its pictures."""
    return _parts(structure) | {
        "base": _base_numbers(response.base),
        "contacts": _contacts(response.system),
        "points": dict(response.system.points),
        "end": response.window[1],
        "statistics": dataclasses.asdict(response.statistics),
        "statistics_of": {name: dataclasses.asdict(one) for name, one in response.statistics_of.items()},
    }


def _base_numbers(base: Excitation) -> dict[str, Any]:
    """Numbers from which a motion is made again, but for the samples of a record."""
    if isinstance(base, Drives):
        moving = None if base.base is None else _base_numbers(base.base)
        return {"base": moving, "forces": [_base_numbers(force) for force in base.forces]}
    if isinstance(base, Sum):
        return {"parts": [_base_numbers(part) for part in base.parts]}
    if isinstance(base, PointForce):
        return {"at": base.at, "name": base.name, "history": _base_numbers(base.history)}
    if isinstance(base, HammerBlow):
        return force_table(base)
    if isinstance(base, RecordedBase):
        return {"interval": base.interval, "initial_velocity": base.initial_velocity}
    if any(type(base) is kind.noun for kind in PARTS.values()):
        return table_of(base, PARTS)
    # another motion is shown as a sine
    numbers = {"amplitude": base.amplitude, "frequency": base.frequency, "phase": getattr(base, "phase", 0.0)}
    return {"kind": "sine", **numbers}


def _base_arrays(response: Response) -> dict[str, Any]:
    """The samples of a record; none of a sine."""
    base = getattr(response.base, "base", response.base)
    if not isinstance(base, RecordedBase):
        return {}
    return {BASE_SAMPLES: ("base_sample", np.array(base.samples), {"units": "m/s^2"})}


def _base(data: xarray.Dataset, about: Mapping[str, Any]) -> Any:
    """The drives that `_base_numbers` and `_base_arrays` wrote."""
    return _excitation(about["base"], data[BASE_SAMPLES].to_numpy() if BASE_SAMPLES in data else None)


def _excitation(numbers: Mapping[str, Any], samples: Array | None) -> Any:
    if "forces" in numbers:
        moving = numbers["base"]
        forces = tuple(_excitation(force, None) for force in numbers["forces"])
        return Drives(None if moving is None else _excitation(moving, samples), forces)
    if "parts" in numbers:
        return Sum(tuple(_excitation(part, None) for part in numbers["parts"]))
    if "history" in numbers:
        return PointForce(numbers["at"], _excitation(numbers["history"], None), numbers["name"])
    if "at" in numbers:
        return force_of(numbers)
    return made_of(numbers, PARTS) if "kind" in numbers else RecordedBase(samples, **numbers)


def read_film(folder: Path, summary: Mapping[str, Any]) -> tuple[Response, Structure, float | None] | None:
    """A response with snapshots, its structure and the scale of its motion (None: chosen); None without snapshots."""
    data = read_dataset(folder, "snapshots", summary)
    if data is None:
        return None
    about = json.loads(data[ABOUT].item())
    arrays = {name: data[name].to_numpy() for name in SNAPSHOT_DIMS}
    snapshots = Snapshots(time=data["time"].to_numpy(), **arrays)
    response = _response(folder, summary, about, data["node"].to_numpy(), _base(data, about))
    return dataclasses.replace(response, snapshots=snapshots), _structure(about), about["exaggeration"]


def read_last_cycles(folder: Path, summary: Mapping[str, Any]) -> Response | None:
    """The last cycles of a run at every step, with all of its impacts; None where there are none."""
    data = read_dataset(folder, "last_cycles", summary)
    if data is None:
        return None
    about = json.loads(data[ABOUT].item())
    response = _response(folder, summary, about, np.zeros(0), _base(data, about))
    others = (ABOUT, BASE_SAMPLES)
    channels = {str(name): values.to_numpy() for name, values in data.data_vars.items() if name not in others}
    units = {name: data[name].attrs["units"] for name in channels}
    return dataclasses.replace(response, time=data["time"].to_numpy(), channels=channels, units=units)


def _response(
    folder: Path, summary: Mapping[str, Any], about: Mapping[str, Any], nodes: Array, base: Excitation
) -> Response:
    """A response without a history: its impacts, its end, and the places and contacts of its system."""
    sticking = read_table(folder, FILES["sticking"].name, summary)
    return Response(
        time=np.array([about["end"]]),
        channels={},
        units={},
        impacts=_impacts(folder, summary),
        sticking=StickingPhases.none() if sticking is None else StickingPhases(**sticking),
        statistics=_statistics(about["statistics"]),
        statistics_of={name: _statistics(given) for name, given in about["statistics_of"].items()},
        steady=no_steady_motion(),
        energy=None,
        snapshots=None,
        base=base,
        system=cast(System, _system(about, nodes)),
    )


BESIDE_CHANNELS = ("base_displacement", "base_velocity", "base_acceleration", "base", "time")
"""Variables of a history that are the motion of its base."""


def read_run(
    folder: Path, summary: Mapping[str, Any], history: xarray.Dataset, system: System | DrawnSystem, base: Any
) -> Response:
    """A run with the channels and energies of its history, and with its impacts, but with no statistics."""
    time = np.asarray(history["time"].to_numpy(), dtype=float)
    channels = {
        str(name): np.asarray(values.to_numpy(), dtype=float)
        for name, values in history.data_vars.items()
        if values.dims == ("time",) and not str(name).startswith("energy_") and name not in BESIDE_CHANNELS
    }
    nothing = impact_statistics(np.zeros((6, 1)), 1.0, 1.0, "")
    return Response(
        time=time,
        channels=channels,
        units={name: str(history[name].attrs.get("units", "1")) for name in channels},
        impacts=_impacts(folder, summary),
        sticking=StickingPhases.none(),
        statistics=nothing,
        statistics_of=dict.fromkeys((pair.name for pair in system.contacts), nothing),
        steady=no_steady_motion(),
        energy=_ledger(history, time),
        snapshots=None,
        base=base,
        system=cast(System, system),
    )


def _ledger(history: xarray.Dataset, time: Array) -> EnergyLedger | None:
    """The energies of a history; None where it has none."""
    names = [item.name for item in dataclasses.fields(EnergyLedger) if f"energy_{item.name}" in history]
    if not names:
        return None
    work_of = {str(name)[len(WORK_OF) :]: history[name].to_numpy() for name in history if str(name).startswith(WORK_OF)}
    columns = {name: history[f"energy_{name}"].to_numpy() for name in names}
    return EnergyLedger(time=time, **columns, structure_loss_of_mode=np.zeros((time.size, 0)), work_of=work_of)


WORK_OF = "energy_work_of_"
"""Beginning of the variables of a history that are the work of one of several drives."""


def _statistics(given: Mapping[str, Any]) -> ImpactStatistics:
    return ImpactStatistics(**{name: _finite_or(value, math.nan) for name, value in given.items()})


def _finite_or(value: Any, other: float) -> Any:
    """A value of a JSON file, which has null for what is not finite."""
    return other if value is None else value


def _impacts(folder: Path, summary: Mapping[str, Any]) -> Impacts:
    data = read_dataset(folder, "impact_data", summary)
    require(data is not None, "file", str(folder / FILES["impact_data"].name), "", "is missing")
    data = cast("xarray.Dataset", data)
    columns = {name: data[name].to_numpy() for name in IMPACT_UNITS if name not in DERIVED}
    columns["impactor"] = columns["impactor"].astype(str)
    modes = data["energy_to_modes"].to_numpy() if "energy_to_modes" in data else np.zeros((columns["time"].size, 0))
    laws = (pair.rpartition(": ") for pair in str(data.attrs["contact_law"]).split("; ") if pair)
    law = {name: value for name, _, value in laws}
    return Impacts(**columns, energy_to_modes=modes, law=law, dropped=int(data.attrs["dropped"]))


DERIVED = ("contact_law", "energy_to_higher_modes")
"""Columns of a table of impacts that follow from others."""


# ---- sweep ----------------------------------------------------------------------------------------


def read_curves(folder: Path, summary: Mapping[str, Any]) -> SweptCurves | None:
    """Response curves by words for their cases, with the even grid; None where the results have no sweep."""
    data = read_dataset(folder, "sweep_data", summary)
    if data is None:
        return None
    curves = {}
    for case in data["case"].to_numpy():
        one = data.sel(case=case)
        columns: dict[str, Any] = {name: one[name].to_numpy() for name in (*SWEEP_UNITS, "steadiness", "frequency")}
        about = {name: data.attrs[name] for name in ("at", "start")}
        level: dict[str, Any] = {"amplitude": None}
        if "base_acceleration_m_s2" in data.attrs:
            given = np.asarray(data.attrs["base_acceleration_m_s2"], dtype=float)
            level["acceleration"] = given.reshape(-1, 2) if given.ndim else given.item()
        else:
            level["amplitude"] = float(data.attrs["base_amplitude_m"])
        dwell: dict[str, Any] = {"cycles": None}
        for name, attribute in (("cycles", "cycles"), ("duration", "duration_s"), ("window", "window_s")):
            if attribute in data.attrs:
                dwell[name] = data.attrs[attribute].item()
        curves[str(case)] = FrequencyResponse(**columns, **about, **dwell, **level, law="")
    frequency, carried = data["frequency"].to_numpy(), carried_of(summary)
    words = {"empty": f"without {carried}", "ball": f"with {carried}"}
    named = {words[case]: curves[case] for case in words if case in curves}
    return SweptCurves(named, frequency[data["grid"].to_numpy() == "even"], read_bands(folder, summary))


def read_convergence(columns: Mapping[str, Any], units: Mapping[str, str], axis: str, summary: Mapping[str, Any] | None,
                     accuracy: float) -> ConvergenceTable:  # fmt: skip
    """The table that its columns and its rows of the summary of all tables were written from.

    Without a summary, as of statistics over several starts, names and units are those of the columns, and orders are
    not known.
    """
    keys = [name.removesuffix("_error") for name in columns if name.endswith("_error")]
    cases = np.asarray(columns["number"], dtype=float).size
    mine = None if summary is None else np.asarray(summary["axis"]) == axis

    def each(ending: str) -> Array:
        missing = np.zeros(cases)
        return np.stack([np.asarray(columns.get(f"{key}{ending}", missing), dtype=float) for key in keys], axis=1)

    def of_summary(name: str) -> Any:
        if mine is None or summary is None:
            # the finest case is the reference of statistics
            return each("")[-1] if name == "reference" else np.full(len(keys), math.nan)
        return np.asarray(summary[name], dtype=float)[mine]

    names = np.array([key.replace("_", " ") for key in keys])
    return ConvergenceTable(
        axis=axis,
        label=np.asarray(columns["case"]).astype(str),
        number=np.asarray(columns["number"], dtype=float),
        size=np.asarray(columns["size"], dtype=float),
        failure=np.asarray(columns["failure"]).astype(str),
        name=names if mine is None or summary is None else np.asarray(summary["quantity"])[mine],
        unit=np.array([units.get(key, "1") for key in keys]),
        value=each(""),
        error=each("_error"),
        order=each("_order"),
        scatter=each("_scatter"),
        **{name: of_summary(name) for name in ("fitted_order", "expected_order", "reference", "floor", "recommended")},
        accuracy=accuracy,
    )


def read_bands(folder: Path, summary: Mapping[str, Any]) -> list[tuple[str, Array, Array, Array]]:
    """Words, frequencies (Hz), smallest and largest peaks (m) of several starts in each frame; else none."""
    columns = read_table(folder, FILES["curves_of_starts"].name, summary)
    if columns is None:
        return []
    frames = {"base": "relative to the base", "space": "in the inertial frame", "static": "in the static position"}
    count = summary.get("starts_of_sweep")
    words = {start: f"{count} starts of the {carried_of(summary)}" if count else f"starts from rest {frame}"
             for start, frame in frames.items()}  # fmt: skip
    return [
        (f"with {carried_of(summary)}, {text}", columns["frequency"], columns[f"{start}_low"], columns[f"{start}_high"])
        for start, text in words.items()
        if f"{start}_low" in columns
    ]
