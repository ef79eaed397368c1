"""Results read back for pictures, page and terminal: the study and its structure, and what it has found."""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from femimpact.app.results.branch_file import FollowedBranches, followed_in
from femimpact.app.results.result_directory import FILES, SUMMARY, ResultFileWarning, unfinished_state
from femimpact.app.results.results import read_file, read_summary
from femimpact.app.study.findings import START_WORDS, Findings, read_findings
from femimpact.app.study.study import Study, build_systems
from femimpact.app.study.study_file import load_study
from femimpact.arrays import Array
from femimpact.convergence.table import ConvergenceTable
from femimpact.errors import require
from femimpact.excitation.excitation import has_cycle
from femimpact.files import read_units
from femimpact.response.cycles import no_steady_motion
from femimpact.response.energy import EnergyLedger
from femimpact.response.history import Snapshots
from femimpact.response.impacts import IMPACT_UNITS, Impacts, ImpactStatistics, StickingPhases, impact_statistics
from femimpact.response.response import Response
from femimpact.scene.placed import DrawnSystem, drawn_system
from femimpact.signals.densities import MODES, modes_of
from femimpact.structure.structure import Structure
from femimpact.sweep.curve import SWEEP_UNITS, FrequencyResponse
from femimpact.system.modes import Modes
from femimpact.system.system import System

if TYPE_CHECKING:
    import xarray

T = TypeVar("T")

SNAPSHOT_DIMS = {
    "displacement": "dof",
    "velocity": "dof",
    "ball_displacement": "ball",
    "ball_velocity": "ball",
    "contact_force": "contact",
}

NOWHERE = DrawnSystem(np.zeros(0), {})
"""Places and contacts of results whose study cannot be read."""


# ---- records ----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class SweptCurves:
    """Response curves by their names."""

    curves: Mapping[str, FrequencyResponse]
    coarse: Array | None = None  # Hz: the even grid
    # words, frequencies (Hz), and the smallest and the largest peaks (m) of several starts
    bands: Sequence[tuple[str, Array, Array, Array]] = ()


@dataclass(frozen=True, eq=False)
class StartRanges:
    """Medians and ranges of measures over one axis, of several starts in each frame."""

    key: str  # in `RANGES`
    frames: Mapping[str, xarray.Dataset]  # by the frame in which the runs start at rest


RANGES: Mapping[str, Mapping[str, str]] = {
    "curves_of_starts": {"frequency": "base frequency", "peak": "largest displacement"},
    "restitution": {
        "restitution": "restitution of the contact",
        "amplitude_ratio": "amplitude ratio without / with ball",
        "peak_frequency": "frequency of the largest peak",
    },
}
"""Words for the axis, and for the measures over it that are drawn, of tables in `FILES` over several starts."""


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


# ---- writing ----------------------------------------------------------------------------------------


def mode_shape_data(system: System, modes: Modes) -> xarray.Dataset:
    """Mode shapes at the nodes."""
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
    return xarray.Dataset(data, attrs={"total_mass_kg": system.total_mass})


def snapshot_data(response: Response, snapshots: Snapshots) -> xarray.Dataset:
    """The snapshots of a response."""
    import xarray

    units = {"displacement": "m, 1", "velocity": "m/s, 1/s", "ball_velocity": "m/s", "contact_force": "N"}
    data: dict[str, Any] = {
        name: (("time", dim), np.array(getattr(snapshots, name)), {"units": units.get(name, "m")})
        for name, dim in SNAPSHOT_DIMS.items()
    }
    data["node"] = ("node", np.array(response.system.nodes), {"units": "m"})
    time = ("time", np.array(snapshots.time), {"units": "s"})
    return xarray.Dataset(data, {"time": time}, {"end_s": response.window[1]})


def last_cycle_data(
    response: Response,  # the run
    end: Response,  # its last cycles
) -> xarray.Dataset:
    """Channels of the last cycles of a run at every step, with the statistics of the run."""
    import xarray

    data = {name: ("time", np.array(values), {"units": end.units[name]}) for name, values in end.channels.items()}
    time = ("time", np.array(end.time), {"units": "s"})
    about = {"end_s": response.window[1], **dataclasses.asdict(response.statistics)}
    return xarray.Dataset(data, {"time": time}, about)


# ---- reading ----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class ResultReading:
    """A directory of results with the data read from it, and notes on what could not be read."""

    folder: Path  # with the files
    as_run: Study | None = None  # the study; that of its file by default, which no law of one's own can be read from
    missing: list[str] = field(default_factory=list)  # what could not be read or is not as it was, and why
    failures: list[str] = field(default_factory=list)  # what could not be read

    def attempt(self, what: str, make: Callable[[], T]) -> T | None:
        """The value of `make()`; where it fails None, and a line in `missing`."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                found: T | None = make()
            # what damaged results make a reader raise is without limit, and a report is made of the rest
            except Exception as error:
                words = " ".join(str(error).split()) or type(error).__name__
                text = words if words.startswith(str(self.folder)) else f"{what}: {words}"
                self.failures.append(self.miss(text))
                found = None
        for one in caught:
            if issubclass(one.category, ResultFileWarning):
                self.miss(str(one.message))
        return found

    def miss(self, text: str) -> str:
        """Note what is missing, with names of files alone: a report does not hang on where its directory is."""
        plain = text.replace(f"{self.folder}/", "").replace(f"{self.folder}: ", "")[:400]
        if plain not in self.missing:
            self.missing.append(plain)
        return plain

    def of_file(self, key: str, make: Callable[[xarray.Dataset], T], group: str | None = None) -> T | None:
        """What is made of a netCDF file of `FILES`, or of its group; None where there is none, or it cannot be read."""
        name = FILES[key].name
        data: xarray.Dataset | None = self.table(name, group)
        return None if data is None else self.attempt(name, lambda: make(data))

    def table(self, name: str, group: str | None = None) -> Any:
        """A file of the results, as `read_file`; None where there is none, or it cannot be read."""
        return self.attempt(name, lambda: read_file(self.folder, name, self.findings.checksums, group))

    def units(self, name: str) -> dict[str, str]:
        """Units of the columns of a table that was read."""
        return self.attempt(name, lambda: read_units(self.folder / name)) or {}

    @cached_property
    def study(self) -> Study | None:
        """The study of the results; None where there is none, or it cannot be read, as of what follows."""
        if self.as_run is not None:
            return self.as_run
        path = self.folder / FILES["study"].name
        return self.attempt(path.name, lambda: load_study(path)) if path.exists() else None

    @cached_property
    def best_design(self) -> tuple[Study, str] | None:
        """The study with the values of the best case, and whose they are; None without a best case."""
        path = self.folder / FILES["best_study"].name
        study = self.attempt(path.name, lambda: load_study(path)) if path.exists() else None
        return None if study is None else (study, "of the best case")

    @cached_property
    def findings(self) -> Findings:
        """What the summary says, without those of its keys that are damaged; nothing where there is none."""
        there = (self.folder / SUMMARY).exists()
        summary = (self.attempt(SUMMARY, lambda: read_summary(self.folder)) if there else None) or {}
        # key by key: a page shows what is sound, and its warnings above all
        sound = [key for key in summary if self.attempt(SUMMARY, partial(read_findings, {key: summary[key]}))]
        return read_findings({key: summary[key] for key in sound})

    @cached_property
    def system(self) -> DrawnSystem | None:
        """Places and contacts of the study's structure; its mesh is not read again."""
        study, points = self.study, self.findings.points
        if study is None:
            return None
        return self.attempt("places of the structure", lambda: drawn_system(study.structure, points))

    @cached_property
    def history(self) -> xarray.Dataset | None:
        """The history."""
        return self.of_file("history", lambda data: data)

    @cached_property
    def parameter_study(self) -> xarray.Dataset | None:
        """The dataset of a parameter study."""
        return self.of_file("parameter_study", lambda data: data)

    @cached_property
    def modes(self) -> StructureModes | None:
        """The mode shapes, with the system and the structure as pictures take them."""
        return self.of_file("mode_shapes", self._modes)

    def _modes(self, data: xarray.Dataset) -> StructureModes:
        names = ("natural_frequency", "damping_ratio", "participation_factor")
        modes = Modes(**{name: data[name].to_numpy() for name in names}, vectors=data["shape"].to_numpy())
        system = replace(
            self.system or NOWHERE,
            nodes=data["node"].to_numpy(),
            total_mass=float(data.attrs["total_mass_kg"]),
            modes=(modes.natural_frequency, modes.damping_ratio),
        )
        return StructureModes(cast(System, system), modes, None if self.study is None else self.study.structure)

    @cached_property
    def curves(self) -> SweptCurves | None:
        """Response curves by words for their cases, with the even grid."""
        return self.of_file("sweep_data", self._curves)

    def _curves(self, data: xarray.Dataset) -> SweptCurves:
        return curves_of(data, self.findings, self.table(FILES["curves_of_starts"].name) or {})

    @cached_property
    def ranges(self) -> list[StartRanges]:
        """Medians and ranges over several starts."""
        tables = [(key, FILES[key].name, self.table(FILES[key].name)) for key in RANGES]
        ranges = [
            self.attempt(name, partial(read_ranges, key, columns, self.units(name)))
            for key, name, columns in tables
            if columns is not None
        ]
        return [one for one in ranges if one is not None]

    @cached_property
    def followed(self) -> FollowedBranches | None:
        """Branches of periodic orbits."""
        return self.of_file("branches", followed_in)

    @cached_property
    def film(self) -> Response | None:
        """A response with snapshots, and without a history."""
        return None if self.system is None else self.of_file("history", self._film, "snapshots")

    def _film(self, data: xarray.Dataset) -> Response:
        arrays = {name: data[name].to_numpy() for name in SNAPSHOT_DIMS}
        snapshots = Snapshots(time=data["time"].to_numpy(), **arrays)
        system = replace(self.system or NOWHERE, nodes=data["node"].to_numpy())
        return replace(self._response([data.attrs["end_s"]], system), snapshots=snapshots)

    @cached_property
    def last_cycles(self) -> Response | None:
        """The last cycles of a run at every step, with all of its impacts."""
        return None if self.system is None else self.of_file("history", self._last_cycles, "last_cycles")

    def _last_cycles(self, data: xarray.Dataset) -> Response:
        statistics = {item.name: data.attrs[item.name] for item in dataclasses.fields(ImpactStatistics)}
        run = self._response([data.attrs["end_s"]], self.system or NOWHERE)
        return replace(
            run,
            time=data["time"].to_numpy(),
            channels={str(name): values.to_numpy() for name, values in data.data_vars.items()},
            units={str(name): values.attrs["units"] for name, values in data.data_vars.items()},
            statistics=ImpactStatistics(**statistics | {"count": int(statistics["count"])}),
        )

    @cached_property
    def run(self) -> Run | None:
        """The run of the results: from its history, and from its last cycles where they are there."""
        end, history = self.last_cycles, self.history
        if history is None:
            # impacts and last cycles are drawn without it
            return None if end is None else Run(replace(end, channels={}, units={}), end)
        whole = None if self.system is None else self.attempt(FILES["history"].name, lambda: self._run(history))
        return None if whole is None else Run(whole, end)

    def _run(self, history: xarray.Dataset) -> Response:
        """A run with the channels and energies of its history, and with its impacts, but with no statistics."""
        channels = {
            str(name): np.asarray(values.to_numpy(), dtype=float)
            for name, values in history.data_vars.items()
            if values.dims == ("time",) and not str(name).startswith("energy_") and name not in BESIDE_CHANNELS
        }
        units = {name: str(history[name].attrs.get("units", "1")) for name in channels}
        run = self._response(history["time"].to_numpy(), self._system_of_run())
        return replace(run, channels=channels, units=units, energy=_ledger(history, run.time))

    def _system_of_run(self) -> DrawnSystem:
        """Places and contacts, with the modes where spectra need them, and they need no file of a mesh."""
        study, system = self.study, self.system or NOWHERE
        if self.modes is not None:
            return cast(DrawnSystem, self.modes.system)
        if study is None or study.mesh.file or has_cycle(study.excitation):
            return system
        return replace(system, modes=modes_of(build_systems(study)[1], MODES))

    def _response(self, time: Any, system: DrawnSystem) -> Response:
        """A response without channels: its times, its impacts, its drive and its system."""
        sticking, impacts = (
            read_file(self.folder, FILES[key].name, self.findings.checksums) for key in ("sticking", "impact_data")
        )
        require(impacts is not None, "file", FILES["impact_data"].name, "", "is missing")
        nothing = impact_statistics(np.zeros((6, 1)), 1.0, 1.0, "")
        return Response(
            time=np.asarray(time, dtype=float),
            channels={},
            units={},
            impacts=_impacts(impacts),
            sticking=StickingPhases.none() if sticking is None else StickingPhases(**sticking),
            statistics=nothing,
            statistics_of=dict.fromkeys((pair.name for pair in system.contacts), nothing),
            steady=no_steady_motion(),
            energy=None,
            snapshots=None,
            base=cast(Study, self.study).excitation,
            system=cast(System, system),
        )


def read_results(folder: Path, study: Study | None = None) -> ResultReading:
    """A directory of results; that it is unfinished is missing from it."""
    results = ResultReading(folder, study)
    state = results.attempt("directory", lambda: unfinished_state(folder))
    if state:
        results.miss(state.replace(str(folder), "DIR"))
    return results


BESIDE_CHANNELS = ("base_displacement", "base_velocity", "base_acceleration", "base", "time")
"""Variables of a history that are the motion of its base."""


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


def _impacts(data: xarray.Dataset) -> Impacts:
    columns = {name: data[name].to_numpy() for name in IMPACT_UNITS if name not in DERIVED}
    columns["impactor"] = columns["impactor"].astype(str)
    modes = data["energy_to_modes"].to_numpy() if "energy_to_modes" in data else np.zeros((columns["time"].size, 0))
    laws = (pair.rpartition(": ") for pair in str(data.attrs["contact_law"]).split("; ") if pair)
    law = {name: value for name, _, value in laws}
    return Impacts(**columns, energy_to_modes=modes, law=law, dropped=int(data.attrs["dropped"]))


DERIVED = ("contact_law", "energy_to_higher_modes")
"""Columns of a table of impacts that follow from others."""


# ---- sweep ----------------------------------------------------------------------------------------


def curves_of(
    data: xarray.Dataset,
    findings: Findings,
    of_starts: Mapping[str, Any],  # columns of the peaks of several starts; empty without them
) -> SweptCurves:
    """Response curves by words for their cases, with the even grid and the ranges of several starts."""
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
    frequency, carried = data["frequency"].to_numpy(), findings.carried
    words = {"empty": f"without {carried}", "ball": f"with {carried}"}
    named = {words[case]: curves[case] for case in words if case in curves}
    return SweptCurves(named, frequency[data["grid"].to_numpy() == "even"], bands_of(of_starts, findings))


def read_convergence(columns: Mapping[str, Any], units: Mapping[str, str], axis: str, orders: Mapping[str, Any] | None,
                     accuracy: float) -> ConvergenceTable:  # fmt: skip
    """The table that its columns and its rows of the orders of all tables were written from.

    Without orders, as of statistics over several starts, names and units are those of the columns, and orders are
    not known.
    """
    keys = [name.removesuffix("_error") for name in columns if name.endswith("_error")]
    cases = np.asarray(columns["number"], dtype=float).size
    mine = None if orders is None else np.asarray(orders["axis"]) == axis

    def each(ending: str) -> Array:
        missing = np.zeros(cases)
        return np.stack([np.asarray(columns.get(f"{key}{ending}", missing), dtype=float) for key in keys], axis=1)

    def of_orders(name: str) -> Any:
        if mine is None or orders is None:
            # the finest case is the reference of statistics
            return each("")[-1] if name == "reference" else np.full(len(keys), math.nan)
        return np.asarray(orders[name], dtype=float)[mine]

    names = np.array([key.replace("_", " ") for key in keys])
    return ConvergenceTable(
        axis=axis,
        label=np.asarray(columns["case"]).astype(str),
        number=np.asarray(columns["number"], dtype=float),
        size=np.asarray(columns["size"], dtype=float),
        failure=np.asarray(columns["failure"]).astype(str),
        name=names if mine is None or orders is None else np.asarray(orders["quantity"])[mine],
        unit=np.array([units.get(key, "1") for key in keys]),
        value=each(""),
        error=each("_error"),
        order=each("_order"),
        scatter=each("_scatter"),
        **{name: of_orders(name) for name in ("fitted_order", "expected_order", "reference", "floor", "recommended")},
        accuracy=accuracy,
    )


def bands_of(columns: Mapping[str, Any], findings: Findings) -> list[tuple[str, Array, Array, Array]]:
    """Words, frequencies (Hz), smallest and largest peaks (m) of several starts in the first frame; else none."""
    start = next((start for start in START_WORDS if f"{start}_peak" in columns), None)
    if start is None:
        return []
    count, carried = findings.starts_of_sweep, findings.carried
    words = f"{count} starts of the {carried}" if count else f"starts {START_WORDS[start]}"
    low, high = columns[f"{start}_peak_low"], columns[f"{start}_peak_high"]
    return [(f"with {carried}, {words}", columns["frequency"], low, high)]


def read_ranges(key: str, columns: Mapping[str, Any], units: Mapping[str, str]) -> StartRanges:
    """Of the columns of a table in `RANGES` those of each frame."""
    import xarray

    axis, frames = next(iter(RANGES[key])), dict[str, xarray.Dataset]()
    for start in (start for start in START_WORDS if f"{start}_starts" in columns):
        names = {name: name.removeprefix(f"{start}_") for name in (axis, *columns)}
        data = {
            names[name]: (axis, values, {"units": units.get(name, ""), "long_name": RANGES[key].get(names[name], "")})
            for name, values in columns.items()
            if name == axis or names[name] != name
        }
        frames[start] = xarray.Dataset(data, attrs={"starts": int(columns[f"{start}_starts"][0])})
    return StartRanges(key, frames)
