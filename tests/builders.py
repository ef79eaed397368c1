"""What several tests build: the reference structure and its variants, an oscillator, tables of impacts, studies.

What several tests take from the layer of study files stands here.
"""
# ruff: noqa: F401

from __future__ import annotations

from dataclasses import replace

import numpy as np

import femimpact as fi
from femimpact.app.demo import paper_study, paper_study_text
from femimpact.app.parametric.identity import plain_study, study_key
from femimpact.app.report.result_conclusions import study_conclusions
from femimpact.app.report.result_page import write_report
from femimpact.app.results.result_directory import FILES, ResultFileWarning
from femimpact.app.study.findings import joined
from femimpact.app.study.findings import summary_of as summary_of_findings
from femimpact.app.study.parameter_plan import ParameterPlan
from femimpact.app.study.prepared import prepare
from femimpact.app.study.study import MeshChoice, OrbitsPlan, Output, Reduction, SweepPlan, build_systems, method_for
from femimpact.app.study.study_file import TABLES, load_study, read_study, same_study, study_schema, study_text
from femimpact.app.study.summary import findings_of, findings_of_history, findings_of_modes, findings_of_sweeps
from femimpact.app.tasks.run import run_simulation, run_study, task_of_run
from femimpact.app.tasks.study_command import write_parameter_study
from femimpact.app.tasks.task import run_task
from femimpact.cli import print_results
from femimpact.files import read_csv
from femimpact.integrators.methods import Method
from femimpact.response.history_file import history_writer

REFERENCE = fi.Structure(
    beam=fi.Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700),
    masses=[fi.PointMass("box", at="tip", mass=0.02290976)],
    impactors=[
        fi.Impactor(
            "ball", at="tip", mass=3.43e-3, gap=4e-3, contact=fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
        )
    ],
    damping=fi.Rayleigh(ratio=0.0029, modes=(1, 2)),
)
"""The structure behind the published 5.30 and 4.98 Hz."""


def build(study: fi.app.Study) -> tuple[fi.System, fi.System, Method]:
    """The full system, the one that is integrated, and the method with its step."""
    full, small = build_systems(study)
    return full, small, method_for(study, small)


def done(task: object, directory: object) -> fi.app.StudyResults:
    """The results of a task in a directory, done in silence."""
    return run_task(task, directory, False, lambda _what, _share: None)


def plan_lines(study: fi.app.Study) -> list[str]:
    """Lines on what a run of the study would do."""
    return task_of_run(prepare(study)).plan().lines


def summary_of(prepared: object, modes: object = None, response: object = None, sweeps: object = None) -> dict:
    """The summary of some parts of a study."""
    findings = findings_of(prepared)
    if modes is not None:
        findings = joined(findings, findings_of_modes(modes))
    if response is not None:
        findings = joined(findings, findings_of_history(prepared, response))
    if sweeps is not None:
        findings = joined(findings, findings_of_sweeps(prepared, sweeps))
    return summary_of_findings(findings)


def with_ball(structure: fi.Structure, **changes: object) -> fi.Structure:
    """The structure with one ball, its first one changed."""
    return replace(structure, impactors=(replace(structure.impactors[0], **changes),))


def reduced(structure: fi.Structure, modes: int = 8, elements: int = 20) -> fi.System:
    """The structure assembled and reduced to its first modes."""
    return fi.reduce(fi.assemble(structure, elements=elements), modes=modes)


def cantilever(
    law: object = None, *, box: float = 0.0229, places: tuple[object, ...] = ("tip",), stops: tuple[object, ...] = (),
    damping: float = 0.0029, elements: int = 30,
) -> fi.System:  # fmt: skip
    """The reference beam with a ball at each place and a stop at each other one, all of one law."""
    law = law or fi.Rigid(0.6)
    structure = fi.Structure(
        beam=REFERENCE.beam,
        masses=[fi.PointMass("box", at="tip", mass=box)] if box else [],
        impactors=[fi.Impactor(f"ball {i}", place, 3.43e-3, 4e-3, law) for i, place in enumerate(places)],
        stops=[fi.Stop(f"stop {i}", place, 1e-3, law) for i, place in enumerate(stops)],
        damping=fi.Rayleigh(ratio=damping, modes=(1, 2)),
    )
    return fi.assemble(structure, elements=elements)


def stepped_structure(**attachments: object) -> fi.Structure:
    """A cantilever of 0.25 m in two sections."""
    segments = (
        fi.Segment(0.15, 70e9, 2700, 0.02, 2e-3, name="thick"),
        fi.Segment(0.10, 70e9, 2700, 0.02, 1e-3, name="thin"),
    )
    return fi.Structure(fi.Beam(segments), **attachments)


def oscillator(stiffness: float = 1.0, damping: float = 0.0, **more: object) -> fi.System:
    """One mass of 1 kg on a spring (N/m) and a dashpot (N s/m), given by matrices; its place is "mass"."""
    return fi.System.from_matrices([[1.0]], [[damping]], [[stiffness]], points={"mass": [1.0]}, **more)


def impact_table(
    frequency: float, time: object, side: object, speed: object, *, impactor: object = "ball",
    to_modes: object = None, dropped: int = 0,
) -> fi.response.Impacts:  # fmt: skip
    """Impacts in order of time with the columns that decide a regime; phases of a frequency, the others zero."""
    order = np.argsort(time, kind="stable")
    side, speed, impactor = (np.broadcast_to(values, order.shape)[order] for values in (side, speed, impactor))
    time, nothing = np.asarray(time, dtype=float)[order], np.zeros(order.size)
    return fi.response.Impacts(
        time=time,
        phase=np.mod(2 * np.pi * frequency * time, 2 * np.pi),
        impactor=impactor,
        side=side.astype(float),
        approach_speed=speed.astype(float),
        rebound_speed=0.6 * speed,
        impulse=5e-3 * speed,
        peak_force=nothing,
        duration=nothing,
        energy_loss=nothing,
        energy_to_modes=np.zeros((order.size, 0)) if to_modes is None else np.asarray(to_modes)[order],
        law={"ball": "rigid"},
        dropped=dropped,
    )


def short_study(duration: float, points: int = 5, **output: object) -> fi.app.Study:
    """The paper's study with a run of some seconds, a coarse sweep, and other output."""
    paper = paper_study()
    return replace(
        paper,
        duration=duration,
        sweep=SweepPlan(4.0, 6.0, points=points, cycles=24),
        output=replace(paper.output, **{"starts": 1, **output}),
    )


def rigid_study(modes: int, elements: int, **changes: object) -> fi.app.Study:
    """The paper's study with rigid impacts, event-driven on a few modes."""
    paper = paper_study()
    return replace(
        paper,
        **{
            "structure": with_ball(paper.structure, contact=fi.Rigid(0.6)),
            "method": {"name": "event-driven"},
            "reduction": replace(paper.reduction, modes=modes),
            "mesh": replace(paper.mesh, elements=elements),
            **changes,
        },
    )


NO_PICTURES = {"frames": 0, "figures": False, "paraview": False, "movie": False, "report": False}
"""Output of a study that draws nothing."""

SMALL_STUDY = (
    paper_study_text()
    .replace("duration = 120.0 ", "duration = 6.0 ")
    .replace("refine = 40 ", "refine = 6 ")
    .replace("cycles = 600 ", "cycles = 60 ")
    .replace("frames = 120 ", "frames = 6 ")
    .replace("\nstarts = 5 ", "\nstarts = 1 ")
)
"""The paper's study with a short run and a short sweep, and with few frames of all that is drawn."""

UNDRAWN_STUDY = (
    SMALL_STUDY.replace("frames = 6 ", "frames = 0 ")
    .replace("figures = true", "figures = false")
    .replace("paraview = true", "paraview = false")
    .replace("movie = true", "movie = false")
)
"""The same without pictures."""

SHORT_EXCITATIONS = {
    "sine": fi.Sine(0.6e-3, 5.2),
    "sine as a force": fi.PointForce("tip", fi.Sine(0.05, 5.2)),
    "chirp": fi.Chirp(4.0, 8.0, 0.4, amplitude=0.8e-3),
    "stepped sine": fi.SteppedSine([5.0, 6.0], 1, amplitude=0.8e-3),
    "shock": fi.Shock("half-sine", acceleration=60.0, duration=0.011),
    "hammer blow": fi.HammerBlow("tip", 20.0, 2e-3),
    "random": fi.RandomBase([(2.0, 1.0), (60.0, 1.0)], 1.0, seed=1),
    "random as a force": fi.PointForce("tip", fi.RandomBase([(2.0, 1e-3), (60.0, 1e-3)], 1.0, seed=2)),
    "record": fi.RecordedBase(4.0 * np.sin(0.9 * np.arange(60) ** 1.1), 8e-3),
    "record as a force": fi.PointForce("tip", fi.RecordedBase(0.1 * np.sin(0.9 * np.arange(60) ** 1.1), 8e-3)),
    "sum": fi.Sine(0.4e-3, 5.2) + fi.RandomBase([(2.0, 0.5), (40.0, 0.5)], 1.0, seed=3),
    "sum as a force": fi.PointForce(
        "tip", fi.Sine(0.03, 5.2) + fi.RandomBase([(2.0, 1e-3), (60.0, 1e-3)], 1.0, seed=4)
    ),
}
"""Each gives some impacts within 0.4 s."""
