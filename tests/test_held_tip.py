"""A beam that is held at its tip is read where it moves: in the middle, with a ball or a stop and without one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from builders import NO_PICTURES, short_study

import femimpact as fi
from femimpact.app.report.result_conclusions import conclusions_of
from femimpact.app.results.picture_data import read_results

BEAM = fi.Beam.uniform(length=0.3, width=0.02, thickness=0.8e-3, young_modulus=210e9, density=7850)
CLAMPED = fi.Structure(
    beam=BEAM,
    supports=[fi.Support("clamped", "root"), fi.Support("clamped", "tip")],
    damping=fi.Rayleigh(ratio=0.01, modes=(1, 3)),
)
STOP = fi.Stop("pin", "mid", (5e-4, 5e-4), fi.Rigid(0.7))


def system(**parts):
    return fi.reduce(fi.assemble(replace(CLAMPED, **parts), elements=12), modes=3)


@pytest.mark.parametrize(
    ("given", "place"),
    [
        (system(), "mid"),
        (system(stops=[STOP]), "mid"),
        # with the ball or the stop, and without them
        (system(masses=[fi.PointMass("box", 0.1, 0.01)], stops=[replace(STOP, at="box")]), "mid"),
        (
            system(supports=[*CLAMPED.supports, fi.Support("pinned", "mid")], masses=[fi.PointMass("box", 0.1, 0.01)]),
            "box",
        ),
        (fi.reduce(fi.assemble(fi.Structure(beam=BEAM), elements=12), modes=3), "tip"),
        (fi.reduce(fi.assemble(fi.Structure(beam=BEAM, stops=[STOP]), elements=12), modes=3), "tip"),
    ],
    ids=["alone", "stop", "at a body", "held in the middle", "free tip", "free tip with a stop"],
)
def test_default_place_moves(given, place):
    assert given.default_place == place
    assert np.any(given.point_row(place))


def test_sweep_study_and_run_read_the_middle():
    given, first = system(), system().first_frequency
    curve = fi.frequency_sweep(given, 1e-5, [first], fi.EventDriven(), 900)
    # steady at resonance: participation times amplitude over twice the damping ratio, with 3 modes kept
    steady = fi.transfer_function(given, [first], to=("mid",), of="base.displacement")["mid"][0]
    assert curve.at == "mid"
    assert curve.peak[0] == pytest.approx(1e-5 * abs(steady), rel=1e-6)
    study = fi.parameter_study(
        given, {"base.frequency": [first]}, ["peak"], excitation=fi.Sine(1e-5, first), cycles=900
    )
    assert float(study.peak[0]) == pytest.approx(curve.peak[0], rel=1e-12)
    run = fi.integrate(given, fi.Sine(1e-5, first), fi.EventDriven(), 900 / first)
    assert float(run.steady.peak[0]) == pytest.approx(curve.peak[0], rel=1e-9)
    axes, drive = {"base.frequency": [first]}, fi.Sine(1e-5, first)
    for read in (
        lambda: fi.frequency_sweep(given, 1e-5, [first], fi.EventDriven(), 9, at="tip"),
        lambda: fi.parameter_study(given, axes, ["peak"], excitation=drive, cycles=9, at="tip"),
    ):
        with pytest.raises(fi.InputError, match=r"at = 'tip': must be a place that moves; 'mid' does"):
            read()


def test_results_of_a_study_name_the_place(tmp_path):
    paper = short_study(2.0, **NO_PICTURES)
    ball = replace(paper.structure.impactors[0], at="mid", gap=1e-5)
    supports = (fi.Support("clamped", "root"), fi.Support("clamped", "tip"))
    given = replace(paper, structure=replace(paper.structure, supports=supports, masses=(), impactors=(ball,)))
    given = replace(given, base=replace(given.base, frequency=100.0), sweep=None)
    directory = fi.run_study(given, tmp_path / "out").directory
    results = read_results(directory)
    labels = {one.label: one for one in conclusions_of(results.findings)}
    peak = labels["Peak of the middle"]
    largest = results.findings.history.peak
    assert largest > 0.0
    assert float(peak.value) == pytest.approx(largest * {"mm": 1e3, "µm": 1e6, "nm": 1e9}[peak.unit], rel=1e-3)
    assert "Peak of the tip" not in labels
