"""Good calls of what `nouns.VERBS` leaves out: figures, files, and the methods of nouns."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
from builders import NO_PICTURES, history_writer, short_study
from nouns import (
    BASE,
    LAW,
    MOTIONS,
    NOUNS,
    STRUCTURE,
    curve,
    grid,
    parameter_study,
    piece,
    response,
    small,
    system,
)

import femimpact as fi
from femimpact import vtk
from femimpact.contact.laws import ContactParameters
from femimpact.files import read_csv, write_csv

SHEET = fi.figures.OffScreen()

RECORD = "time,acceleration\n0.0,1.0\n0.1,-1.0\n0.2,0.5\n"


@cache
def studied(axes: int) -> object:
    """A parameter study over so many axes; a list of cases for none."""
    values = {"impactor.ball.gap": [1e-3, 2e-3], "base.frequency": [5.0, 6.0], "base.phase": [0.0, 1.0]}
    given = dict(list(values.items())[:axes]) if axes else [{"impactor.ball.gap": 1e-3}, {"impactor.ball.gap": 2e-3}]
    return fi.parameter_study(**{**parameter_study(), "axes": given, "starts": 5})


@cache
def calibrated() -> fi.app.Calibration:
    bounds = {"impactor.ball.gap": (1e-3, 2e-3), "impactor.ball.contact.restitution": (0.4, 0.6)}
    more = {"starts": 2, "cycles": 3, "excitation": fi.Sine(1e-3, 5.0)}
    return fi.calibrate(small(), [5.0, 5.1, 5.2], [1e-3, 2e-3, 1e-3], bounds, **more)


def recorded_file() -> str:
    Path("recorded.csv").write_text("time,tip\ns,mm\n0.0,1.0\n0.1,2.0\n0.2,1.0\n", encoding="utf-8")
    return "recorded.csv"


def branch_file(path: str | Path = "branch.nc") -> str | Path:
    NOUNS["Branch"]().to_xarray().to_netcdf(path)
    return path


def studied_directory() -> str:
    fi.parameter_study(**parameter_study(), directory="studied")
    return "studied"


@cache
def modes() -> fi.system.Modes:
    return fi.solve_modes(system(), 2)


@cache
def drawn_run() -> fi.response.Response:
    """A run with all that a figure needs."""
    channels = ("tip", "tip.velocity", "ball", "ball.velocity", "ball.contact_force", "mid")
    return fi.integrate(small(), BASE, fi.Newmark(2e-4), 1.5, fi.Recorder(channels, snapshots=1000))


def of(made: Callable[[], object], name: str) -> Callable[..., object]:
    """A method of a noun that is made when it is called."""
    return lambda **given: getattr(made(), name)(**given)


def entry(noun: Callable[[], object], what: str) -> Callable[..., object]:
    """`noun[...]`, as a function of what messages call its argument."""
    return lambda **given: noun()[given[what]]


def written(path: object) -> None:
    with history_writer(path) as write:
        write(piece_without_snapshots())


def sent(piece: object) -> None:
    with history_writer("sent.nc") as write:
        write(piece)


@cache
def piece_without_snapshots() -> fi.response.HistoryPiece:
    kept = piece()
    return fi.response.HistoryPiece(kept.time, kept.channels, kept.units, kept.energy, None, kept.base)


def csv_file() -> Path:
    return write_csv("table.csv", {"a": [1.0, 2.0]}, {"a": "m"})


@cache
def four_modes() -> fi.System:
    return fi.reduce(system(), 4)


@cache
def study() -> fi.app.Study:
    return short_study(0.1, **NO_PICTURES)


def study_file() -> Path:
    Path("study.toml").write_text(study().text, encoding="utf-8")
    return Path("study.toml")


def results() -> Path:
    return fi.run_study(study(), "results", parts=("modes",), force=True).directory


def matrix_file() -> Path:
    np.savez("matrices.npz", K=np.eye(2), M=np.eye(2))
    return Path("matrices.npz")


def record_file() -> Path:
    Path("record.csv").write_text(RECORD, encoding="utf-8")
    return Path("record.csv")


FIGURES = {
    "beam_mesh": lambda: {"mesh": grid().mesh, "structure": STRUCTURE, "ax": SHEET},
    "bifurcation": lambda: {"responses": [drawn_run()], "channel": "tip", "phase": 0.5, "ax": SHEET},
    "channels": lambda: {"response": drawn_run(), "end": drawn_run(), "figure": SHEET},
    "contact_force": lambda: {"response": drawn_run(), "cycles": 4, "averaged": True, "figure": SHEET},
    "contact_laws": lambda: {"contacts": [("ball", LAW, 3e-3)], "speeds": [0.1, 0.2], "figure": SHEET},
    "convergence": lambda: {"table": NOUNS["ConvergenceTable"](), "names": ["a", "b"], "ax": SHEET},
    "convergence_panels": lambda: {"table": NOUNS["ConvergenceTable"](), "figure": SHEET},
    "damper_curve": lambda: {
        "curve": fi.design.damper_curve([0.3, 0.5], [0.6], starts=1, cycles=60), "title": "title", "figure": SHEET
    },
    "drive": lambda: {"excitation": BASE, "end": 1.5, "figure": SHEET},
    "energies": lambda: {"response": drawn_run(), "figure": SHEET},
    "impact_histograms": lambda: {"response": drawn_run(), "figure": SHEET},
    "impulse_phase": lambda: {"response": drawn_run(), "ax": SHEET},
    "mode_shapes": lambda: {
        "system": system(), "modes": modes(), "points": 20, "structure": STRUCTURE, "figure": SHEET
    },
    "motion": lambda: {"response": drawn_run(), "cycles": 2.0, "figure": SHEET},
    "phase_portrait": lambda: {"response": drawn_run(), "of": "ball", "cycles": 4, "phase": 0.5, "ax": SHEET},
    "response_columns": lambda: {"curves": {"a": curve()}, "figure": SHEET},
    "response_curve": lambda: {
        "curves": {"a": curve()}, "title": "title", "coarse": [5.0, 6.0], "published": [("paper", 5.3, 1e-3)],
        "bands": [("starts", [5.0, 6.0], [1e-3, 2e-3], [2e-3, 3e-3])],
        "join_all": True, "ax": SHEET,
    },
    "branch": lambda: {
        "branch": NOUNS["Branch"](), "ax": SHEET, "title": "4 modes", "swept": ([5.0, 5.1], [1e-3, 2e-3]),
    },
    "orbit": lambda: {"orbit": NOUNS["PeriodicOrbit"](), "of": "ball", "figure": SHEET},
    "decay": lambda: {"result": NOUNS["DecayEstimate"](), "ax": SHEET},
    "calibration": lambda: {"result": calibrated(), "title": "title", "figure": SHEET},
    "save_figure": lambda: {"drawn": fi.figures.study(studied(1), figure=SHEET), "path": "figure.png"},
    "spectrum": lambda: {"response": drawn_run(), "channel": "tip", "highest": 50.0, "ax": SHEET},
    "shock_response_spectrum": lambda: {
        "spectra": fi.shock_response_spectrum(MOTIONS["Shock"], [5.0, 6.0]), "pseudo_velocity": True, "ax": SHEET
    },
    "transfer_function": lambda: {
        "transfers": fi.transfer_function(small(), [5.0, 6.0], "tip"), "channel": "tip", "figure": SHEET
    },
    "study": lambda: {
        "dataset": studied(2), "measure": "peak", "title": "title", "norm": "log", "figure": SHEET
    },
}  # fmt: skip
"""Good arguments of every figure."""

CALLS = {
    **{f"figures.{name}": (getattr(fi.figures, name), good) for name, good in FIGURES.items()},
    "figures.write_mode": (fi.figures.write_mode, lambda: {
        "path": "mode.gif", "system": system(), "modes": modes(), "structure": STRUCTURE, "mode": 1, "frames": 2,
        "fps": 10,
    }),
    "amplitude_spectrum": (
        fi.signals.amplitude_spectrum, lambda: {"time": np.linspace(0.0, 1.0, 50), "values": np.ones(50)},
    ),
    # files
    "vtk.write_modes": (vtk.write_modes, lambda: {
        "path": "modes.pvd", "system": system(), "modes": modes(), "structure": STRUCTURE, "subdivisions": 1,
        "scale": 0.01,
    }),
    "vtk.write_mode": (vtk.write_mode, lambda: {
        "path": "mode.vtkhdf", "system": system(), "modes": modes(), "structure": STRUCTURE, "mode": 1, "frames": 2,
        "subdivisions": 1, "scale": 0.01,
    }),
    "vtk.write_deflection": (vtk.write_deflection, lambda: {
        "path": "deflection.vtkhdf", "response": drawn_run(), "structure": STRUCTURE, "exaggeration": 1.0, "most": 400,
        "frame": "base",
    }),
    "report": (fi.report, lambda: {
        "path": "page.html", "parts": {"run": drawn_run(), "curve": curve(), "columns": {"a": [1.0, 2.0]}},
        "structure": STRUCTURE, "title": "Title", "notes": ("a note",),
    }),
    "write_movie": (fi.figures.write_movie, lambda: {
        "path": "movie.gif", "response": drawn_run(), "structure": STRUCTURE, "exaggeration": 2.0, "fps": 2, "most": 2,
    }),
    "read_record": (fi.read_record, lambda: {
        "path": recorded_file(), "columns": None, "units": None, "sample_rate": None
    }),
    "write_record": (fi.excitation.write_record, lambda: {
        "path": "record.csv", "dataset": fi.read_record(recorded_file())
    }),
    "history_writer": (written, lambda: {"path": "history.nc"}),
    "history_writer's sink": (sent, lambda: {"piece": piece_without_snapshots()}),
    "files.read_csv": (read_csv, lambda: {"path": csv_file()}),
    "load": (fi.load, lambda: {"directory": results()}),
    "load_branch": (fi.app.load_branch, lambda: {"path": branch_file(), "number": 1}),
    "load_parameter_study": (fi.app.load_parameter_study, lambda: {"directory": studied_directory()}),
    "parameter_study": (fi.parameter_study, lambda: {
        **parameter_study(), "directory": "study", "client": None, "threads": 1, "progress": lambda now: None,
    }),
    "load_study": (fi.load_study, lambda: {"path": study_file()}),
    "show_versions": (fi.show_versions, dict),
    "read_matrix": (fi.system.read_matrix, lambda: {"path": matrix_file(), "name": "K"}),
    "run_study": (fi.run_study, lambda: {
        "study": study(), "directory": "new", "parts": ("modes",), "force": True, "report": lambda *_: None
    }),
    "mode_convergence": (fi.convergence.mode_convergence, lambda: {
        "system": four_modes(), "excitation": fi.Sine(1e-4, 24.0), "method": fi.Newmark(2e-4), "duration": 1.1,
        "counts": [1, 2, 3], "at": "tip",
    }),
    # methods of nouns
    "ContactPair.shares_place": (of(lambda: system().contacts[0], "shares_place"), lambda: {
        "other": system().contacts[1]
    }),
    "ContactParameters.of_function": (ContactParameters.of_function, lambda: {
        "contact_time": 1e-3, "restitution": 0.5
    }),
    "Discretisation.node_of": (of(grid, "node_of"), lambda: {"support": STRUCTURE.supports[0]}),
    "EventDriven.for_system": (fi.EventDriven.for_system, lambda: {
        "system": small(), "samples_per_cycle": 32, "most_events": 1000
    }),
    "Newmark.for_system": (fi.Newmark.for_system, lambda: {"system": small(), "dt": 1e-4, "refine": 1}),
    "PointForce.acceleration": (fi.PointForce("tip", BASE).acceleration, lambda: {"time": 0.1}),
    "PointForce.force": (fi.PointForce("tip", BASE).force, lambda: {"time": 0.1}),
    "PointForce.velocity": (fi.PointForce("tip", BASE).velocity, lambda: {"time": 0.1}),
    "RecordedBase.acceleration": (fi.RecordedBase([0.0, 1.0], 0.1).acceleration, lambda: {"time": 0.1}),
    "RecordedBase.velocity": (fi.RecordedBase([0.0, 1.0], 0.1).velocity, lambda: {"time": 0.1}),
    "RecordedBase.from_csv": (fi.RecordedBase.from_csv, lambda: {
        "path": record_file(), "scale": 9.81, "detrend": "mean", "columns": (0, "acceleration")
    }),
    "RecordedBase.from_text": (fi.RecordedBase.from_text, lambda: {
        "text": RECORD, "scale": 9.81, "detrend": "line", "columns": ("time", 1), "path": "shaker.csv"
    }),
    "Recorder.seen_from": (fi.Recorder(start=1.0).seen_from, lambda: {"time": 0.5}),
    "Response.largest": (of(response, "largest"), lambda: {"channel": "tip"}),
    "Response.largest_of": (of(response, "largest_of"), lambda: {"channels": ["tip"]}),
    "Branch.at": (of(NOUNS["Branch"], "at"), lambda: {"value": 1.0}),
    "PeriodicOrbit.steady": (of(NOUNS["PeriodicOrbit"], "steady"), lambda: {"channel": "tip"}),
    "PeriodicOrbit.to_xarray": (of(NOUNS["PeriodicOrbit"], "to_xarray"), lambda: {"channels": ["tip"]}),
    "Response.stroboscopic": (of(response, "stroboscopic"), lambda: {"phase": 0.5}),
    "Response[]": (entry(response, "channel"), lambda: {"channel": "tip"}),
    "FrequencyResponse[]": (entry(curve, "column"), lambda: {"column": "peak"}),
    "StroboscopicSection[]": (entry(NOUNS["StroboscopicSection"], "channel"), lambda: {"channel": "tip"}),
    "ConvergenceStudy[]": (entry(NOUNS["ConvergenceStudy"], "axis"), lambda: {"axis": "mesh"}),
    "State.is_static_on": (fi.State().is_static_on, lambda: {"system": small()}),
    "State.static_contacts": (fi.State.static().static_contacts, lambda: {"system": small(), "base": BASE}),
    "State.left_by_run": (fi.State().left_by_run, lambda: {"system": small(), "base": BASE}),
    "State.relative_to_base": (fi.State().relative_to_base, lambda: {"system": small(), "base": BASE}),
    "Structure.place_of": (STRUCTURE.place_of, lambda: {"at": "box"}),
}  # fmt: skip
"""Every other function with arguments, good ones of it."""
