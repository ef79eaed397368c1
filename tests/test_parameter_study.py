"""Parameter studies: cases are those of single runs, statistics those of order, and what was ended goes on."""

from __future__ import annotations

import hashlib
import math
import os
import subprocess
import sys
import warnings
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import xarray
from builders import (
    REFERENCE,
    build,
    paper_study,
    paper_study_text,
    read_study,
    rigid_study,
    study_conclusions,
    study_text,
    with_ball,
)

import femimpact as fi
from femimpact.app.parametric.dataset import BLOCKS, median_ranks, over_starts
from femimpact.app.parametric.paths import paths_of_study, study_with
from femimpact.app.parametric.runs import evaluated
from femimpact.app.parametric.verb import block_cases
from femimpact.app.report.result_conclusions import study_lead
from femimpact.app.tasks.study_command import definition_of
from femimpact.figures.study_labels import unsure_cells
from femimpact.files import dataset_columns
from femimpact.units import prefixed

pytestmark = pytest.mark.impacts

GAP, RESTITUTION = "impactor.ball.gap", "impactor.ball.contact.restitution"


study = partial(rigid_study, modes=3, elements=10)


def small(**more):
    """A grid of four cases."""
    given = {"axes": {GAP: [2e-3, 4e-3], RESTITUTION: [0.5, 0.7]}, "measures": ["peak", "rms"], "cycles": 12}
    return fi.parameter_study(study(), **{**given, **more})


# ---- values ------------------------------------------------------------------------------------------


def test_a_case_that_cannot_be_run_without_its_balls_is_a_row_with_its_reason(monkeypatch):
    run_cases = fi.EventDriven.run_cases

    def unsteady(method, system, *given, **others):
        if not system.balls:
            raise fi.DivergenceError("the motion grows")
        return run_cases(method, system, *given, **others)

    monkeypatch.setattr(fi.EventDriven, "run_cases", unsteady)
    found = fi.parameter_study(study(), {GAP: [2e-3, 4e-3]}, ["peak", "peak_ratio"], cycles=12)
    assert [str(reason) for reason in found["failure"].to_numpy()] == ["without its balls: the motion grows"] * 2
    assert np.isnan(found["peak_ratio"]).all()


def test_a_case_is_the_sweep_of_its_own_structure():
    found = small(measures=["peak", "rms", "first_harmonic", "impacts_per_cycle", "cycle_mean_force", "mean_impulse"])
    given = study()
    for gap in (2e-3, 4e-3):
        for e in (0.5, 0.7):
            own = with_ball(given.structure, gap=gap, contact=fi.Rigid(e))
            system = fi.reduce(fi.assemble(own, elements=10), 3)
            curve = fi.frequency_sweep(system, given.base.amplitude, [given.base.frequency], fi.EventDriven(), 12)
            case = found.sel({GAP: gap, RESTITUTION: e})
            for name in ("peak", "rms", "first_harmonic", "impacts_per_cycle", "cycle_mean_force", "mean_impulse"):
                # the same system but for its gap and its law, which no mode hangs on: the same bits
                assert float(case[name]) == curve[name][0], name


@pytest.mark.parametrize(
    ("path", "values"),
    [
        ("beam.thickness", [0.9e-3, 1.1e-3]),
        ("mass.box.mass", [0.02, 0.03]),
        ("damping.ratio", [0.002, 0.01]),
        ("impactor.ball.mass", [2e-3, 5e-3]),
        ("base.amplitude", [1e-4, 3e-4]),
        ("base.frequency", [4.6, 5.2]),
        ("mesh.elements", [6, 12]),
        ("reduction.modes", [2, 4]),
    ],
)
def test_every_kind_of_axis_is_the_run_of_a_changed_study(path, values):
    # free flight and a few impacts: what rounding does to modes is not yet amplified
    found = fi.parameter_study(study(), {path: values}, ["peak"], cycles=3)
    for value in values:
        owner, *_, name = path.split(".")
        given = study()
        if owner == "beam":
            beam = fi.Beam((replace(given.structure.beam.segments[0], **{name: value}),))
            given = replace(given, structure=replace(given.structure, beam=beam))
        elif owner == "mass":
            given = replace(
                given, structure=replace(given.structure, masses=(replace(given.structure.masses[0], mass=value),))
            )
        elif owner == "damping":
            damping = replace(given.structure.damping, ratio=value)
            given = replace(given, structure=replace(given.structure, damping=damping))
        elif owner == "impactor":
            given = replace(given, structure=with_ball(given.structure, mass=value))
        else:
            given = replace(given, **{owner: replace(getattr(given, owner), **{name: value})})
        system = fi.reduce(fi.assemble(given.structure, elements=given.mesh.elements), given.reduction.modes)
        base = given.base
        curve = fi.frequency_sweep(system, base.amplitude, [base.frequency], fi.EventDriven(), 3)
        assert float(found["peak"].sel({path: value})) == pytest.approx(curve.peak[0], rel=1e-9)


def test_an_acceleration_of_a_ball_is_added_to_gravity_as_in_its_structure():
    given = study(structure=replace(study().structure, gravity=2.0))
    found = fi.parameter_study(given, {"impactor.ball.acceleration": [0.0, 1.5]}, ["peak"], cycles=3)
    for i, value in enumerate([0.0, 1.5]):
        own = with_ball(given.structure, acceleration=value)
        system = fi.reduce(fi.assemble(own, elements=10), 3)
        curve = fi.frequency_sweep(system, given.base.amplitude, [given.base.frequency], fi.EventDriven(), 3)
        assert float(found["peak"][i]) == pytest.approx(curve.peak[0], rel=1e-9)


def halves(structure):
    """Its beam in two segments, of which the first tapers."""
    (whole,) = structure.beam.segments
    near = replace(whole, name="near", length=0.5 * whole.length, end_width=0.015, end_thickness=0.8e-3)
    return fi.Beam((near, replace(near, name="far", width=0.015, thickness=0.8e-3, end_width=None, end_thickness=None)))


OTHERS = {
    "as it is": lambda structure: {},
    "stepped and tapered": lambda structure: {"beam": halves(structure)},
    "on a spring": lambda structure: {
        "springs": [fi.Spring("mount", "mid", 50.0), fi.Spring("link", "tip", 9.0, "mid")]
    },
    "pinned": lambda structure: {"supports": [fi.Support("pinned", "root"), fi.Support("pinned", 0.15)]},
    "with modal damping": lambda structure: {"damping": fi.ModalDamping((0.01, 0.02))},
    "undamped": lambda structure: {"damping": None},
}


@pytest.mark.parametrize(
    ("other", "path", "value"),
    [
        ("as it is", "beam.thickness", 1.2e-3),
        ("as it is", "mass.box.mass", 0.03),
        ("as it is", "beam.young_modulus", 60e9),
        ("as it is", "beam.length", 0.21),
        ("as it is", "gravity.acceleration", 9.81),
        ("stepped and tapered", "beam.near.end_thickness", 0.7e-3),
        ("stepped and tapered", "beam.far.density", 3000.0),
        ("on a spring", "spring.mount.stiffness", 80.0),
        ("pinned", "mass.box.mass", 0.03),
        ("with modal damping", "beam.thickness", 1.2e-3),
        ("undamped", "beam.thickness", 1.2e-3),
    ],
)
def test_modes_of_a_changed_structure_are_those_of_its_own_assembly(other, path, value):
    structure = study().structure
    # enough elements that the modes are not found by the dense solver
    given = study(structure=replace(structure, **OTHERS[other](structure)))
    given = replace(given, mesh=replace(given.mesh, elements=40))
    made = fi.app.ParameterStudy(given, {path: [value]}, ["peak"], cycles=3)
    (place,) = made.places
    found = made.systems.of({place: value})
    expected = fi.reduce(fi.assemble(study_with(given, {place: value}).structure, elements=40), 3)
    for name in ("K", "C", "M"):
        np.testing.assert_allclose(getattr(found, name).diagonal(), getattr(expected, name).diagonal(), rtol=1e-10)
    largest = np.abs(expected.expansion).max(axis=0)
    np.testing.assert_allclose(found.expansion / largest, expected.expansion / largest, rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(found.base_load, expected.base_load, rtol=1e-10)
    np.testing.assert_allclose(found.constant_load, expected.constant_load, rtol=1e-10)
    assert found.first_left_out == pytest.approx(expected.first_left_out, rel=1e-10)
    for one, other in zip(found.contacts, expected.contacts, strict=True):
        np.testing.assert_allclose(one.direction, other.direction, rtol=1e-10)
        assert one.effective_mass == pytest.approx(other.effective_mass, rel=1e-10)
        assert one.flexibility == pytest.approx(other.flexibility, rel=1e-10)
    for name, reaction in expected.reactions.items():
        for read in ("on_acceleration", "on_velocity", "on_displacement"):
            one, other_one = getattr(found.reactions[name], read), getattr(reaction, read)
            np.testing.assert_allclose(one, other_one, atol=1e-10 * np.abs(other_one).max())


@pytest.mark.parametrize("path", ["impactor.ball.mass", "damping.ratio", "beam.thickness", "mass.box.mass"])
def test_cases_with_systems_of_their_own_have_the_bits_that_they_have_alone(path):
    values = {
        "impactor.ball.mass": [2e-3, 3e-3, 5e-3], "damping.ratio": [2e-3, 5e-3, 0.02],
        "beam.thickness": [0.9e-3, 1e-3, 1.1e-3], "mass.box.mass": [0.02, 0.025, 0.03],
    }[path]  # fmt: skip
    measures = ["peak", "loss_per_cycle", "damping", "peak_ratio", "energy_residual", "root.reaction_force"]
    given = fi.app.ParameterStudy(study(), {path: values, GAP: [2e-3, 5e-3]}, measures, starts=2, cycles=12)
    together = evaluated(given, np.arange(6))
    assert not any(together.failures)
    for case in range(6):
        # of one system, by the call for one system
        np.testing.assert_array_equal(evaluated(given, np.array([case])).values, together.values[[case]])


def test_a_case_can_be_run_alone():
    given = fi.app.ParameterStudy(study(), {GAP: [2e-3, 4e-3], "base.phase": [0.0, 1.0]}, ["peak"], starts=2, cycles=12)
    values = evaluated(given, np.arange(4)).values
    for case in range(4):
        for start in range(2):
            run = fi.app.run_case(given, case, start)
            # the peak of a run is that of its last third, to the last bits of another way to the same instants
            assert run.steady.peak[0] == pytest.approx(values[case, start, 0], rel=1e-9)


def test_measures_of_energy_are_those_of_the_ledger_of_a_run():
    given = fi.app.ParameterStudy(study(), {GAP: [2e-3]}, ["loss_per_cycle", "damping", "peak_ratio"], cycles=12)
    loss, damping, ratio = evaluated(given, np.arange(1)).values[0, 0]
    run = fi.app.run_case(given, 0)
    energy = run.energy
    last = energy.time >= 8.0 / 4.9 - 1e-9
    lost = (energy.structure_loss + energy.contact_loss)[last]
    assert loss == pytest.approx((lost[-1] - lost[0]) / 4.0, rel=1e-9)
    # 16 instants of a cycle against the run's 64: below the largest by 1 - cos(pi/16) of the part that oscillates
    stored = energy.stored[last].max()
    assert 1.0 - 1e-9 <= damping * 4.0 * np.pi * stored / loss <= 1.03
    bare = fi.without_impactors(run.system)
    curve = fi.frequency_sweep(bare, 0.2037e-3, [4.9], fi.EventDriven(), 12)
    assert ratio == pytest.approx(run.steady.peak[0] / curve.peak[0], rel=1e-9)


def test_damping_of_a_structure_without_impacts_is_its_damping_ratio():
    given = study(structure=replace(study().structure, impactors=()), base=replace(study().base, frequency=5.3))
    given = replace(given, structure=replace(given.structure, damping=fi.Rayleigh(0.05, modes=(1, 2))))
    found = fi.parameter_study(given, {"base.amplitude": [1e-4]}, ["damping"], cycles=120)
    # loss per cycle over 4 pi E is zeta at resonance; the base is within 1e-3 of it, the other modes take as little
    assert float(found["damping"][0]) == pytest.approx(0.05, rel=5e-3)


def test_words_channels_and_functions_of_the_users_own_are_read_from_runs():
    def largest_speed(response):
        return np.abs(response["tip.velocity"]).max() if "tip.velocity" in response.channels else response.time[-1]

    found = small(axes={GAP: [2e-3]}, measures=["regime", "root.surface_stress", largest_speed])
    run = fi.app.run_case(fi.app.ParameterStudy(study(), {GAP: [2e-3]}, ["regime"], cycles=12), 0)
    assert str(found["regime"][0].item()) == run.regime.label
    assert found["root.surface_stress"].attrs["units"] == "Pa"
    assert float(found["root.surface_stress"][0]) > 0.0
    assert float(found["largest_speed"][0]) == run.time[-1]


def test_a_method_with_steps_runs_the_same_cases():
    given = study(
        structure=with_ball(REFERENCE, contact=fi.KelvinVoigt(restitution=0.6, contact_time=4e-3)),
        method={"name": "newmark"},
    )
    axes = {GAP: [2e-3, 4e-3], "base.frequency": [4.8, 5.0], "base.phase": [0.0, 0.7]}
    found = fi.parameter_study(given, axes, ["peak", "loss_per_cycle"], cycles=6)
    for gap, frequency, phase in [(2e-3, 5.0, 0.0), (4e-3, 4.8, 0.7)]:
        system = fi.reduce(fi.assemble(with_ball(given.structure, gap=gap), elements=10), 3)
        method = fi.Newmark.for_system(system)
        run = fi.integrate(system, fi.Sine(given.base.amplitude, frequency, phase), method, 6 / frequency)
        case = found.sel({GAP: gap, "base.frequency": frequency, "base.phase": phase})
        # the steps of a run and of a dwell end at the same one, beside the measured window's beginning
        assert float(case["peak"]) == pytest.approx(run.steady.peak[0], rel=1e-9)
        assert float(case["loss_per_cycle"]) > 0.0


# ---- starts ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("frame", ["base", "space", "static"])
def test_cases_of_a_method_with_steps_have_side_by_side_the_bits_that_they_have_alone(frame):
    # cases with different gaps, laws, amplitudes and starts in one call; the static state is one for each gap
    axes = {GAP: [1e-3, 4e-3], RESTITUTION: [0.5, 0.7], "base.amplitude": [2e-4, 3e-4], "base.start": [frame]}
    start = {"start.ball.speed": [0.01, 0.02]} if frame != "static" else {}
    measures = ["peak", "rms", "impacts_per_cycle", "peak_force", "energy_residual", "peak_ratio"]
    given = fi.app.ParameterStudy(paper_study(), {**axes, **start}, measures, cycles=6)
    together = evaluated(given, np.arange(given.table.size))
    assert not any(together.failures)
    assert together.values[:, 0, 2].max() > 0.0
    for case in range(0, given.table.size, 3):
        np.testing.assert_array_equal(evaluated(given, np.array([case])).values, together.values[[case]])


def test_a_sine_by_acceleration_has_its_amplitude_at_the_frequency_of_each_case():
    held, frequencies, levels = study(), [4.9, 5.3], [0.1, 0.2]
    held = replace(held, base=fi.Sine(acceleration=levels[0], frequency=5.1))
    amplitudes = {(a, f): a / (2.0 * np.pi * f) ** 2 for a in levels for f in frequencies}
    cases = [{"base.frequency": f, "base.amplitude": amplitudes[levels[0], f], GAP: 2e-3} for f in frequencies]
    options = {"measures": ["peak"], "cycles": 12, "starts": 3}
    # an axis of the amplitude takes the place of the level of the study
    by_amplitude = fi.parameter_study(held, cases, **options).peak_high.values
    assert by_amplitude[0] != by_amplitude[1]
    axes = {"base.frequency": frequencies, GAP: [2e-3]}
    np.testing.assert_array_equal(fi.parameter_study(held, axes, **options).peak_high.values[:, 0], by_amplitude)
    system = fi.reduce(fi.assemble(held.structure, elements=10), 3)
    found = fi.parameter_study(system, axes, excitation=held.base, method=fi.EventDriven(), **options)
    np.testing.assert_array_equal(found.peak_high.values[:, 0], by_amplitude)
    assert found.attrs["base"] == "sine, frequency 5.1, acceleration 0.1, phase 0.0, start base"
    # and an axis of the acceleration that of an amplitude
    found = fi.parameter_study(study(), axes | {"base.acceleration": levels}, **options)
    np.testing.assert_array_equal(found.peak_high.values[:, 0, 0], by_amplitude)
    assert "acceleration as its axis has it, frequency as its axis has it" in found.attrs["drive"]
    assert "amplitude" not in found.attrs["drive"]
    other = [case | {"base.amplitude": amplitudes[levels[1], case["base.frequency"]]} for case in cases]
    expected = fi.parameter_study(study(), other, **options).peak_high.values
    np.testing.assert_array_equal(found.peak_high.values[:, 0, 1], expected)
    with pytest.raises(fi.InputError, match=r"base\.acceleration: must be given alone: base\.amplitude is an axis too"):
        fi.parameter_study(study(), axes | {"base.acceleration": levels, "base.amplitude": [1e-3]}, **options)
    for wrong in (0.0, -1.0, "2 g"):
        with pytest.raises(fi.InputError, match=r"base\.acceleration = .*: must be a finite number > 0 m/s\^2"):
            fi.parameter_study(study(), axes | {"base.acceleration": [wrong]}, **options)


def test_a_level_by_acceleration_is_written_and_read_again_and_is_that_of_the_sweep():
    text = paper_study_text().replace("amplitude = 0.2037e-3", 'acceleration = "0.02 g"')
    given = read_study(text, Path("study.toml"))
    assert given.base == fi.Sine(acceleration=0.02 * 9.80665, frequency=given.base.frequency)
    other = replace(given, base=replace(given.base, frequency=5.2))
    assert read_study(study_text(other), Path("study.toml")).base == other.base
    assert other.base.level == given.base.level == given.sweep_level["acceleration"]
    assert given.sweep_level["amplitude"] is None
    changed = study_with(given, {fi.app.ParameterStudy(given, {"base.frequency": [5.2]}, ["peak"]).places[0]: 5.2})
    assert changed.base == other.base


def chirped(**changes):
    """The study of `study` on a short chirp of the base."""
    chirp = fi.Chirp(4.7, 5.3, 2.0, acceleration=0.3)
    return replace(study(**changes), base=chirp, duration=2.5, start="base", sweep=None)


def test_a_case_without_cycles_is_a_run_of_its_whole_history():
    def hits(response):
        return len(response.impacts)

    measures = ["peak", "rms", "impacts_per_second", "largest_approach_speed", "loss_per_second", "peak_ratio", hits]
    axes = {GAP: [1e-3, 4e-3], "base.acceleration": [0.2, 0.3], RESTITUTION: [0.5]}
    given = fi.app.ParameterStudy(chirped(), axes, measures)
    found = fi.parameter_study(chirped(), axes, measures)
    for case in (0, 3):
        gap, acceleration = (1e-3, 4e-3)[case // 2], (0.2, 0.3)[case % 2]
        own = with_ball(study().structure, gap=gap, contact=fi.Rigid(0.5))
        system = fi.reduce(fi.assemble(own, elements=10), 3)
        base = fi.Chirp(4.7, 5.3, duration=2.0, acceleration=acceleration)
        run = fi.integrate(system, base, fi.EventDriven(), 2.5)
        bare = fi.integrate(fi.without_impactors(system), base, fi.EventDriven(), 2.5)
        row = {name: float(found[name].values.reshape(-1)[case]) for name in found.data_vars if name != "failure"}
        assert row["peak"] == abs(run.largest("tip").value) == abs(fi.app.run_case(given, case).largest("tip").value)
        assert row["rms"] == pytest.approx(np.sqrt(np.mean(run["tip"] ** 2)), rel=1e-12)
        assert row["peak_ratio"] == pytest.approx(row["peak"] / abs(bare.largest("tip").value), rel=1e-12)
        assert row["hits"] == len(run.impacts) > 0
        # the run ends with the last whole sample
        assert row["impacts_per_second"] == pytest.approx(len(run.impacts) / run.time[-1], rel=1e-12)
        assert row["largest_approach_speed"] == run.impacts.approach_speed.max()
        lost = run.energy.structure_loss[-1] + run.energy.contact_loss[-1]
        assert row["loss_per_second"] == pytest.approx(lost / run.time[-1], rel=1e-9)


def test_starts_of_cases_without_cycles_lie_in_the_gap_and_the_first_state_has_the_name_of_the_study_file():
    given = fi.app.ParameterStudy(chirped(), {GAP: [2e-3], "base.initial": ["base", "space"]}, ["peak"], starts=4)
    values = evaluated(given, np.arange(2)).values
    assert np.unique(values).size == 8
    # of a chirp `start` is its first frequency, as in its study file
    units = {path: place.unit for path, place in given.known.items() if place.owner == "base"}
    assert units["base.start"] == "Hz"
    assert units["base.acceleration"] == "m/s^2"
    assert fi.app.ParameterStudy(study(), {"base.start": ["base", "space"]}, ["peak"]).known["base.start"].unit == ""


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"measures": ["first_harmonic"]}, "measures = 'first_harmonic': needs cycles of the base, which a motion of"),
        ({"cycles": 12}, "cycles = 12: must be left out: a motion of kind 'chirp' has no cycle"),
        ({"axes": {"base.frequency": [5.0]}}, "base.frequency: is no number of this base"),
        ({"axes": {"base.initial": ["moving"]}}, "base.initial = 'moving': must be 'base' or 'space' or 'static'"),
        ({"axes": {"base.acceleration": [-1.0]}}, "base.acceleration = -1.0 m/s^2: must be a finite number >= 0"),
    ],
)
def test_what_needs_cycles_is_refused_in_one_line_where_the_base_has_none(given, words):
    given = {"axes": {GAP: [2e-3]}, "measures": ["peak"], **given}
    with pytest.raises(fi.InputError) as caught:
        fi.parameter_study(chirped(), **given)
    assert str(caught.value).startswith(words)
    assert "\n" not in str(caught.value)


def test_fewer_starts_are_the_first_of_more_and_lie_in_the_gap():
    few, many = (
        fi.app.ParameterStudy(study(), {GAP: [1e-3, (2e-3, 4e-3)]}, ["peak"], starts=n, seed=3, cycles=3)
        for n in (3, 7)
    )
    a, b = (evaluated(given, np.arange(2)).values for given in (few, many))
    np.testing.assert_array_equal(a, b[:, :3])
    for start in range(7):
        first = fi.app.run_case(many, 1, start, fi.Recorder(("ball", "ball.velocity")))
        assert -4e-3 <= first["ball"][0] <= 2e-3
        assert abs(first["ball.velocity"][0]) <= 0.2037e-3 * 2 * np.pi * 4.9


@pytest.mark.parametrize("base", ["sine", "chirp"])
def test_starts_from_the_static_state_lie_in_the_gap_of_the_structure_that_sags(base):
    sagging = replace(study().structure, gravity=9.81)
    axes, starts = {GAP: [1e-3, (2e-3, 4e-3)], "impactor.ball.mass": [3e-3, 4e-3]}, 5
    if base == "sine":
        given = study(structure=sagging, start="static")
        given = fi.app.ParameterStudy(given, axes, ["peak"], starts=starts, cycles=3)
    else:
        still = replace(chirped(structure=sagging), start="static")
        given = fi.app.ParameterStudy(still, axes, ["peak"], starts=starts)
    assert not any(evaluated(given, np.arange(4)).failures)
    places = set()
    for case in range(4):
        plus, minus = (1e-3, 1e-3) if case < 2 else (2e-3, 4e-3)
        for start in range(starts):
            run = fi.app.run_case(given, case, start, fi.Recorder(("ball", "tip")))
            place = (run["ball"][0] - run["tip"][0] + minus) / (plus + minus)
            assert 0.0 <= place <= 1.0
            places.add(round(float(place), 9))
        # some 10 mm below the straight beam
        assert abs(run["tip"][0]) > 8e-3
    # the same draws for every case
    assert len(places) == starts


@pytest.mark.parametrize("base", ["sine", "sine by steps", "chirp"])
def test_a_ball_at_zero_is_at_zero_and_one_without_a_place_lies_where_it_lies(base):
    # 0.5 mm of sag in gaps of 4 mm
    sagging = replace(study().structure, gravity=0.5)
    position = "start.ball.position"
    if base == "chirp":
        given = replace(chirped(structure=sagging), start="static")
    else:
        more = {"method": {"name": "moreau-jean", "dt": 5e-4}} if base == "sine by steps" else {}
        given = study(structure=sagging, start="static", **more)
    cycles = {} if base == "chirp" else {"cycles": 3}
    places = [0.0, 1e-3, -1e-3]
    placed = fi.app.ParameterStudy(given, {position: places}, ["peak"], **cycles)
    lying = fi.app.ParameterStudy(given, {"start.ball.speed": [0.0, 1e-3]}, ["peak"], **cycles)
    record = fi.Recorder(("ball", "tip"))
    displacement, balls = fi.static_state(placed.nominal)
    for case, place in enumerate(places):
        run = fi.app.run_case(placed, case, record=record)
        assert run["ball"][0] == place
        # another basis of the modes rounds otherwise
        assert run["tip"][0] == pytest.approx(float(placed.nominal.point_row("tip") @ displacement), rel=1e-9)
        assert abs(run["tip"][0]) > 1e-4
    run = fi.app.run_case(lying, 0, record=record)
    assert run["ball"][0] == pytest.approx(float(balls[0]), rel=1e-9)
    assert abs(run["ball"][0]) > 1e-3
    # one compiled call has what each has alone
    found = evaluated(placed, np.arange(3))
    assert not any(found.failures)
    assert found.values[0, 0, 0] != evaluated(lying, np.arange(1)).values[0, 0, 0]
    alone = fi.app.ParameterStudy(given, {position: [0.0]}, ["peak"], **cycles)
    np.testing.assert_array_equal(evaluated(alone, np.arange(1)).values[0], found.values[0])


def test_of_two_balls_the_one_without_a_place_lies_where_it_lies():
    two = replace(study().structure, gravity=0.5)
    two = replace(two, impactors=(*two.impactors, replace(two.impactors[0], name="other")))
    given = study(structure=two, start="static")
    placed = fi.app.ParameterStudy(given, {"start.other.position": [0.0, 1e-3]}, ["peak"], cycles=3)
    own, other = fi.static_state(placed.nominal)[1]
    for case, place in enumerate([0.0, 1e-3]):
        run = fi.app.run_case(placed, case, record=fi.Recorder(("ball", "other")))
        assert run["ball"][0] == pytest.approx(float(own), rel=1e-9)
        assert run["other"][0] == place != other
    assert not any(evaluated(placed, np.arange(2)).failures)


@pytest.mark.parametrize("method", [fi.EventDriven(), fi.MoreauJean(dt=5e-4)])
def test_a_sweep_from_the_static_state_has_a_ball_at_zero_where_it_is_given(method):
    structure = replace(study().structure, gravity=0.5)
    system = fi.reduce(fi.assemble(structure, 6), 2)
    displacement, _ = fi.static_state(system)

    def peaks(start):
        return fi.frequency_sweep(
            system, 0.2037e-3, [4.9], method=method, cycles=3, initial=start, ledger=False
        )["peak"]  # fmt: skip

    zero = peaks(fi.State(ball_displacement=[0.0], equilibrium=True))
    np.testing.assert_array_equal(zero, peaks(fi.State(displacement=displacement, ball_displacement=[0.0])))
    assert zero != peaks(fi.State.static())


@pytest.mark.parametrize("n", [5, 6, 8, 13, 40])
def test_the_interval_of_the_median_holds_it_with_90_percent_and_no_narrower_one_does(n):
    def covered(k):
        """Share of all 2^n ways that n values lie on the sides of a median in which it is within the interval."""
        return sum(np.prod([(n - i) / (i + 1) for i in range(j)]) for j in range(k + 1, n - k)) / 2.0**n

    low, high = median_ranks(n)
    assert low + high == n - 1
    assert covered(low) >= 0.9
    assert covered(low + 1) < 0.9


def test_statistics_over_starts_do_not_depend_on_their_order_and_leave_out_what_failed():
    values = np.array([[3.0, 1.0, 2.0, np.nan, 5.0, 4.0], [np.nan] * 6])
    found = over_starts(values)
    assert (found[""][0], found["_low"][0], found["_high"][0]) == (3.0, 1.0, 5.0)
    assert (found["_median_low"][0], found["_median_high"][0]) == (1.0, 5.0)
    assert all(np.isnan(column[1]) for column in found.values())
    for name, column in over_starts(values[:, ::-1]).items():
        np.testing.assert_array_equal(column, found[name])


def test_groups_do_not_depend_on_which_way_the_values_are_counted():
    # of distances that are equal, as of whole numbers of impacts, the first may have a single start on its side
    values = np.random.default_rng(0).integers(1, 5, (200, 9)).astype(float)
    found = over_starts(values)["_groups"]
    np.testing.assert_array_equal(found, over_starts(-values)["_groups"])
    assert set(found) == {1.0, 2.0}


def test_two_groups_are_apart_by_a_tenth_of_the_median_with_two_starts_on_each_side():
    near, far, lone = [1.0, 1.01, 1.05, 1.06], [1.0, 1.01, 1.2, 1.21], [1.0, 1.01, 1.02, 1.5]
    np.testing.assert_array_equal(over_starts(np.array([near, far, lone]))["_groups"], [1.0, 2.0, 1.0])
    assert not any(over_starts(np.array([pair]))["_groups"][0] > 1 for pair in combinations([1.0, 2.0, 3.0], 3))


# ---- bits ----------------------------------------------------------------------------------------------


def test_a_case_has_the_same_bits_in_any_block_and_on_any_number_of_threads():
    axes = {GAP: [2e-3, 3e-3, 4e-3], "impactor.ball.mass": [3e-3, 4e-3], RESTITUTION: [0.5, 0.7]}
    given = fi.app.ParameterStudy(study(), axes, ["peak", "energy_residual"], starts=3, cycles=24)
    whole = evaluated(given, np.arange(12))
    for cases in (np.array([7]), np.array([11, 2, 5])):
        np.testing.assert_array_equal(evaluated(given, cases).values, whole.values[cases])
    one, two = (
        fi.parameter_study(study(), axes, ["peak", "energy_residual"], starts=3, cycles=24, threads=n) for n in (1, 2)
    )
    assert one.identical(two)
    assert sum(len(cases) for cases in block_cases(given)) == 12


# ---- on disk --------------------------------------------------------------------------------------------


def digest(path):
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def test_what_was_ended_goes_on_with_the_same_bits(tmp_path, capsys):
    axes = {GAP: list(np.linspace(2e-3, 6e-3, 24))}
    whole = small(axes=axes, starts=2, directory=tmp_path / "whole")

    class Ended(Exception):  # noqa: N818 - it ends a study, and is no error
        pass

    def end_after(count):
        def progress(now):
            if now.finished >= count:
                raise Ended

        return progress

    for count in (8, 16):
        with pytest.raises(Ended):
            small(axes=axes, starts=2, directory=tmp_path / "ended", progress=end_after(count))
        partial = fi.app.load_parameter_study(tmp_path / "ended")
        done = partial["finished"].to_numpy() > 0
        assert count <= done.sum() < 24
        np.testing.assert_array_equal(partial["peak"].to_numpy()[done], whole["peak"].to_numpy()[done])
    capsys.readouterr()
    again = small(axes=axes, starts=2, directory=tmp_path / "ended")
    assert capsys.readouterr().err == f"found {done.sum()} of 24 finished\n"
    assert again.identical(whole)
    assert digest(tmp_path / "ended/study.nc") == digest(tmp_path / "whole/study.nc")
    with xarray.open_dataset(tmp_path / "ended/study.nc") as opened:
        assert opened.identical(whole)


def test_a_process_that_is_killed_loses_its_blocks_in_flight_alone(tmp_path, request):
    if request.config.getoption("--perturb-modes") is not None:
        pytest.skip("the process that is killed has the modes as they are")
    script = tmp_path / "script.py"
    script.write_text(
        "import os, signal, sys\n"
        f"sys.path[:0] = [{str(Path(__file__).parent)!r}]\n"
        "import test_parameter_study as t\n"
        "def progress(now):\n"
        "    if now.finished >= 12: os.kill(os.getpid(), signal.SIGKILL)\n"
        "axes = {t.GAP: [1e-3 + 1e-4 * i for i in range(24)]}\n"
        "t.small(axes=axes, starts=2, directory=sys.argv[1], progress=progress)\n"
    )
    axes = {GAP: [1e-3 + 1e-4 * i for i in range(24)]}
    found = {**os.environ, "PYTHONPATH": str(Path(fi.__file__).parent.parent)}
    ended = subprocess.run([sys.executable, script, tmp_path / "ended"], env=found, check=False)
    assert ended.returncode == -9
    assert fi.app.load_parameter_study(tmp_path / "ended")["finished"].sum() >= 12
    assert small(axes=axes, starts=2, directory=tmp_path / "ended").identical(small(axes=axes, starts=2))


def test_the_directory_of_another_study_is_refused_naming_the_first_difference(tmp_path):
    small(directory=tmp_path)
    with pytest.raises(fi.InputError, match=r"another study: starts is 1 there, 2 here"):
        small(directory=tmp_path, starts=2)
    with pytest.raises(fi.InputError, match=r"another study: axes.impactor.ball.gap\[1\] is 0.004 there, 0.005 here"):
        small(directory=tmp_path, axes={GAP: [2e-3, 5e-3], RESTITUTION: [0.5, 0.7]})
    other = study(structure=with_ball(study().structure, mass=3e-3))
    with pytest.raises(fi.InputError, match=r"another study: study.structure.impactors\[0\].mass is 0.00343 there"):
        fi.parameter_study(other, {GAP: [2e-3, 4e-3], RESTITUTION: [0.5, 0.7]}, ["peak", "rms"], cycles=12,
                           directory=tmp_path)  # fmt: skip


def test_a_second_process_is_refused_while_the_first_is_alive(tmp_path):
    def second(now):
        with pytest.raises(fi.InputError, match="another run is writing into it"):
            small(directory=tmp_path)

    small(directory=tmp_path, progress=second)
    small(directory=tmp_path)


def test_a_full_disk_is_an_error_that_names_the_file_and_leaves_what_was_finished(tmp_path, monkeypatch):
    import femimpact.app.parametric.dataset as block_files

    axes, written, really = {GAP: list(np.linspace(2e-3, 6e-3, 24))}, [], block_files.atomic_write

    def full_after_two(path, content):
        written.append(path)
        if len(written) > 3:
            raise OSError(28, "No space left on device", str(path))
        really(path, content)

    monkeypatch.setattr(block_files, "atomic_write", full_after_two)
    with pytest.raises(OSError, match="No space left on device"):
        small(axes=axes, starts=2, directory=tmp_path)
    monkeypatch.undo()
    # the first file says what the study is
    assert 0 < fi.app.load_parameter_study(tmp_path)["finished"].sum() < 24
    assert small(axes=axes, starts=2, directory=tmp_path).identical(small(axes=axes, starts=2))


# ---- what is refused, and what fails ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"axes": {"impactor.ball.gapp": [1e-3]}}, "impactor.ball.gapp: unknown; did you mean 'impactor.ball.gap'"),
        ({"axes": {GAP: []}}, r"axes.impactor.ball.gap = \[\]: must have one value or more"),
        ({"axes": {}}, "axes = 'none'"),
        ({"axes": {GAP: [1e-3, 2e-3, 1e-3]}}, r"axes.impactor.ball.gap = 0.001: is given twice"),
        ({"axes": {GAP: [1e-3, (1e-3, 1e-3)]}}, r"axes.impactor.ball.gap = \(0.001, 0.001\): is given twice"),
        ({"axes": {GAP: [1e-3, np.nan]}}, "axes.impactor.ball.gap = nan: must be finite"),
        ({"axes": {GAP: [1e-3, -1e-3]}}, "impactor.ball.gap = -0.001 m: must be a number >= 0 m"),
        ({"axes": {RESTITUTION: [0.5, 1.5]}}, "restitution = 1.5: must be"),
        ({"axes": {"base.start": ["base", "moon"]}}, "base.start = 'moon': must be 'base' or 'space'"),
        ({"axes": {"beam.thickness": [0.0]}}, "beam.thickness = 0.0 m: must be a finite number > 0"),
        ({"axes": {"start.ball.position": [0.0]}, "starts": 2}, "start.ball.position: must not be an axis with starts"),
        ({"measures": ["peek"]}, "measures = 'peek': unknown; did you mean 'peak'"),
        ({"measures": ["tip.velocty"]}, "must be a channel, whose largest value is measured: .* 'tip.velocity'"),
        ({"measures": ["peak", "peak"]}, "measures = 'peak': is asked for twice"),
        ({"measures": []}, "measures = 'none'"),
        ({"axes": {GAP: {"from": 1e-3, "to": 2e-3}}}, "is a distribution, and there is no sample"),
        ({"sample": {"points": 4}}, "must be a distribution in a sample"),
        ({"axes": {GAP: {"from": 1e-3, "to": 2e-3}}, "sample": {"points": 6}}, "must be a power of two"),
        ({"cycles": 2}, "cycles = 2: must be a whole number >= 3"),
    ],
)
def test_faults_are_named_before_the_first_case(changes, words):
    with pytest.raises(fi.InputError, match=words):
        small(**changes)


@pytest.mark.parametrize("name", ["failure", "peak_low", "peak_groups", "case", GAP, f"{GAP}.plus", "a/b", ""])
def test_a_function_whose_name_is_taken_is_refused_before_the_first_case(name):
    def measure(response):
        raise AssertionError("no case is run")

    measure.__name__ = name
    with pytest.raises(fi.InputError, match=f"measures = '{name}': (has a name that is taken|must have a name)"):
        small(measures=["peak", measure])


def test_an_argument_whose_name_is_taken_is_refused_before_the_first_case():
    with pytest.raises(fi.InputError, match="failure: is the name of another variable"):
        fi.parameter_study(lambda failure: study().structure, {"failure": [1.0]}, ["peak"], excitation=fi.Sine(1e-4, 5))


def test_of_a_system_only_contacts_excitation_and_start_can_be_axes():
    system = fi.reduce(fi.assemble(study().structure, elements=10), 3)
    base = fi.Sine(0.2037e-3, 4.9)
    found = fi.parameter_study(system, {GAP: [2e-3, 4e-3]}, ["peak"], excitation=base, cycles=12)
    whole = small(axes={GAP: [2e-3, 4e-3]}, measures=["peak"])
    np.testing.assert_array_equal(found["peak"], whole["peak"])
    with pytest.raises(fi.InputError, match=r"beam.thickness: does not follow from the contacts"):
        fi.parameter_study(system, {"beam.thickness": [1e-3]}, ["peak"], excitation=base)
    with pytest.raises(fi.InputError, match=r"base.frequency: must be given"):
        fi.parameter_study(system, {GAP: [1e-3]}, ["peak"])


def test_a_function_that_returns_a_structure_is_a_study_over_its_arguments():
    def structure(box, thickness=1e-3):
        given = study().structure
        beam = fi.Beam((replace(given.beam.segments[0], thickness=thickness),))
        return replace(given, beam=beam, masses=(replace(given.masses[0], mass=box),))

    axes = {"box": [0.02, 0.03], GAP: [2e-3, 4e-3]}
    base = fi.Sine(0.2037e-3, 4.9)
    found = fi.parameter_study(structure, axes, ["peak"], excitation=base, elements=10, modes=3, cycles=3)
    same = fi.parameter_study(study(), {"mass.box.mass": [0.02, 0.03], GAP: [2e-3, 4e-3]}, ["peak"], cycles=3)
    # modes are solved in another call: to rounding, of which 3 cycles make little
    np.testing.assert_allclose(found["peak"], same["peak"], rtol=1e-10)
    with pytest.raises(fi.InputError, match="box: is an argument of the function, and must be an axis"):
        fi.parameter_study(structure, {GAP: [2e-3]}, ["peak"], excitation=base)

    def with_gap(gap):
        return replace(study().structure, impactors=(replace(study().structure.impactors[0], gap=gap),))

    # an argument may have the name of a field
    numbers = {"excitation": base, "elements": 10, "modes": 3, "cycles": 3}
    by_function = fi.parameter_study(with_gap, {"gap": [2e-3, 4e-3]}, ["peak"], **numbers)
    by_path = fi.parameter_study(study(), {GAP: [2e-3, 4e-3]}, ["peak"], cycles=3)
    np.testing.assert_allclose(by_function["peak"], by_path["peak"], rtol=1e-10)


def test_a_case_that_fails_is_a_row_with_its_reason_and_leaves_the_others_as_they_are():
    # a place of the ball beyond the smaller gap, and a beam of nearly no mass: each alone is sound
    axes = {GAP: [1e-3, 4e-3], "start.ball.position": [0.0, 2e-3]}
    found = fi.parameter_study(study(), axes, ["peak"], cycles=12)
    assert np.isnan(found["peak"].sel({GAP: 1e-3, "start.ball.position": 2e-3}))
    assert "must start between its walls" in str(found["failure"].sel({GAP: 1e-3, "start.ball.position": 2e-3}).item())
    assert int(found["failed_starts"].sum()) == 1
    alone = fi.parameter_study(study(), {GAP: [4e-3], "start.ball.position": [2e-3]}, ["peak"], cycles=12)
    assert float(found["peak"][1, 1]) == float(alone["peak"][0, 0])


def test_progress_is_drawn_or_told_and_the_result_is_the_same(capsys):
    told = []
    expected = small(progress=told.append)
    assert [float(told[0]), float(told[-1])] == [0.0, 1.0]
    xarray.testing.assert_identical(small(progress=True), expected)
    assert "parameter study: 4 of 4 cases" in " ".join(capsys.readouterr().err.split())
    with pytest.raises(fi.InputError, match="progress = 'str': must be True, or callable with a StudyProgress"):
        small(progress="yes")


def test_the_dataset_tells_what_was_studied(tmp_path):
    system, base = fi.reduce(fi.assemble(study().structure, elements=10), 3), fi.Sine(2e-4, 4.9)
    axes, sample = {GAP: {"from": 2e-3, "to": 4e-3}}, {"points": 4, "method": "halton", "seed": 3}
    fi.parameter_study(system, axes, ["peak"], sample=sample, excitation=base, cycles=3, directory=tmp_path)
    with xarray.open_dataset(tmp_path / "study.nc") as found:
        about = {name: found.attrs[name] for name in ("study", "sample", "base")}
        assert about == {
            "study": "System of 3 dofs", "sample": "4 points, halton, seed 3",
            "base": "sine, frequency 4.9, amplitude 0.0002, phase 0.0, start base",
        }  # fmt: skip
        assert found.attrs["method"] == repr(fi.EventDriven())
        assert found[GAP].attrs["distribution"] == "uniform [0.002, 0.004]"
    text = small(axes={GAP: [2e-3]}).attrs["study"]
    assert read_study(text, Path("study.toml")).structure == study().structure


def test_an_error_in_a_function_of_the_users_own_is_not_caught():
    def broken(response):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        small(axes={GAP: [2e-3]}, measures=[broken])


# ---- forms of cases -----------------------------------------------------------------------------------------


def test_a_sample_has_the_moments_of_its_distributions():
    axes = {GAP: {"normal": [4e-3, 1e-4]}, RESTITUTION: {"from": 0.4, "to": 0.8}}
    given = fi.app.ParameterStudy(study(), axes, ["peak"], sample={"points": 1024, "seed": 2}, cycles=3)
    gap, restitution = (
        np.array(levels)[codes] for levels, codes in zip(given.table.levels, given.table.codes, strict=True)
    )
    # the error of a Sobol sequence is of the order of log(n)/n; 1/sqrt(n) = 0.03 would be that of chance
    assert gap.mean() == pytest.approx(4e-3, abs=0.01 * 1e-4)
    assert gap.std() == pytest.approx(1e-4, rel=0.01)
    assert restitution.mean() == pytest.approx(0.6, abs=1e-3)
    assert (restitution.min() >= 0.4) & (restitution.max() <= 0.8)


def test_a_list_of_cases_has_the_values_of_the_grid():
    grid = small()
    rows = [{GAP: gap, RESTITUTION: e} for gap, e in [(4e-3, 0.5), (2e-3, 0.7)]]
    listed = small(axes=rows)
    np.testing.assert_array_equal(listed["peak"], [grid["peak"][1, 0], grid["peak"][0, 1]])
    np.testing.assert_array_equal(listed[GAP], [4e-3, 2e-3])


def test_a_pair_of_gaps_is_one_value_with_both_as_coordinates():
    found = small(axes={GAP: [2e-3, (1e-3, 3e-3)]})
    np.testing.assert_array_equal(found[f"{GAP}.plus"], [2e-3, 1e-3])
    np.testing.assert_array_equal(found[f"{GAP}.minus"], [2e-3, 3e-3])


def test_an_axis_of_pairs_is_told_by_its_gaps_and_not_by_their_numbers():
    text = paper_study_text().replace('name = "newmark"', 'name = "event-driven"') + (
        '[study]\nmeasures = ["peak"]\ncycles = 3\n[study.axes]\n"impactor.ball.gap" = [[0.003, 0.004], 0.005]\n'
    )
    given = read_study(text, Path("study.toml"))
    found = fi.parameter_study(given, given.plan.axes, given.plan.measures, cycles=3)
    smallest = ("(3, 4) mm", "(5, 5) mm")[int(np.argmin(found["peak"].data))]
    assert "Axes: gap of ball: (3, 4); (5, 5) mm." in study_lead(found)
    assert f"at gap of ball {smallest}; the largest is" in study_conclusions(found)[0].note
    drawn = fi.figures.study(found, "peak", ax=fi.figures.OffScreen())
    assert [label.get_text() for label in drawn.get_xticklabels()] == ["(3, 4)", "(5, 5)"]


def test_a_study_file_goes_round_and_its_table_has_a_row_for_every_case():
    text = paper_study_text().replace('name = "newmark"', 'name = "event-driven"') + (
        '[study]\nmeasures = ["peak"]\nstarts = 5\ncycles = 6\n[study.axes]\n'
        '"impactor.ball.gap" = [0.002, [0.003, 0.004]]\nimpactor.ball.mass = { from = 0.003, to = 0.004, points = 3 }\n'
    )
    given = read_study(text, Path("study.toml"))
    again = read_study(study_text(replace(given, text="")), Path("study.toml"))
    assert again.plan == given.plan
    definition = definition_of(given)
    assert definition.table.shape == (2, 3)
    dataset = fi.parameter_study(given, given.plan.axes, given.plan.measures, starts=5, cycles=6)
    columns, units = dataset_columns(dataset)
    assert {len(column) for column in columns.values()} == {6}
    assert units["impactor.ball.mass"] == "kg"
    np.testing.assert_array_equal(columns["peak_low"] <= columns["peak"], True)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('"impactor.ball.gap" = []', r"study.axes.impactor.ball.gap = \[\]: must have one value or more"),
        ('"impactor.ball.gap" = [1e-3]\nimpactor.ball.gap = [2e-3]', "study.axes.impactor.ball.gap: is given twice"),
        ('"impactor.ball.gap" = [1e-3, 1e-3]', "study.axes.impactor.ball.gap = 0.001: is given twice"),
        (f'"impactor.ball.gap" = [1{"0" * 400}]', "study.axes.impactor.ball.gap = 1000.*: must be finite numbers"),
        ('"impactor.ball.gap" = { mean = 3 }', "study.axes.impactor.ball.gap = .*: must be a list of values"),
        ('"impactor.bal.gap" = [1e-3]', "study.axes.impactor.bal.gap: unknown; did you mean 'impactor.ball.gap'"),
    ],
)
def test_faults_of_a_study_file_have_the_path_they_have_there(line, words):
    text = f'{paper_study_text()}[study]\nmeasures = ["peak"]\n[study.axes]\n{line}\n'
    with pytest.raises(fi.InputError, match=words):
        definition_of(read_study(text, Path("study.toml")))


# ---- pictures --------------------------------------------------------------------------------------------------


def test_a_map_marks_what_the_starts_cannot_tell_apart():
    median = xarray.DataArray([[1.0, 1.01, 2.0]], dims=("a", "b"))
    given = xarray.Dataset({"m": median, "m_median_low": median - 0.02, "m_median_high": median + 0.02})
    # the steps to the neighbours are 0.01, then 0.99: an interval of 0.04 is wider than the first alone
    np.testing.assert_array_equal(unsure_cells(given, "m"), [[True, False, False]])


@pytest.mark.parametrize("largest", [3e-6, 3e-3, 0.3])
def test_a_mass_has_a_prefix_of_the_gram(largest):
    factor, unit = prefixed(largest, "kg")
    assert unit in ("g", "mg")
    assert factor * largest == pytest.approx(largest * {"g": 1e3, "mg": 1e6}[unit])
    assert factor * largest >= 1.0


def test_maps_of_three_axes_name_the_marks_that_they_have():
    # the step along the third axis, which no map shows, is wider than every interval: of the whole no cell is unsure
    median = xarray.DataArray(np.stack([np.ones((2, 2)), np.full((2, 2), 9.0)], axis=2), dims=("a", "b", "c"))
    given = {"m": median, "m_median_low": median - 0.1, "m_median_high": median + 0.1}
    given |= {name: xarray.zeros_like(median, dtype=int) for name in ("periodic_starts", "failed_starts", "finished")}
    found = xarray.Dataset(
        given, coords={name: [1.0, 2.0] for name in "abc"}, attrs={"starts": 5, "median_interval": ""}
    )
    assert not unsure_cells(found, "m").any()
    axes = fi.figures.study(found, "m", figure=fi.figures.OffScreen())
    assert all(len(one.patches) for one in axes.ravel())
    assert "corner marked: starts differ" in axes[0, 0].figure.get_suptitle()


@pytest.mark.parametrize("starts", [1, 5])
def test_marks_of_a_fine_map_are_on_the_cells_that_have_them(starts):
    axes = {GAP: list(np.linspace(1e-3, 6e-3, 16)), RESTITUTION: list(np.linspace(0.4, 0.8, 9))}
    found = fi.parameter_study(study(), axes, ["peak"], starts=starts, cycles=6)
    drawn = fi.figures.study(found, "peak", ax=fi.figures.OffScreen())
    marked = np.zeros((16, 9), dtype=bool)
    for place in [xy for line in drawn.lines for xy in line.get_xydata()]:
        marked[tuple(int(number) for number in place)] = True
    np.testing.assert_array_equal(marked, (found["periodic_starts"] < 1) if starts == 1 else np.zeros((16, 9)))
    corners = np.zeros((16, 9), dtype=bool)
    for patch in drawn.patches:
        for corner in patch.get_path().vertices.reshape(-1, 4, 2):
            corners[tuple(np.rint(corner[:3].mean(axis=0)).astype(int))] = True
    np.testing.assert_array_equal(corners, unsure_cells(found, "peak"))
    assert marked.any() == (starts == 1)
    assert corners.any() == (starts == 5)


def test_colours_are_logarithmic_where_one_cell_would_darken_the_others():
    values = np.array([[1.0, 2.0], [3.0, 52.0]])
    given = {name: (("a", "b"), np.ones((2, 2), dtype=int)) for name in ("periodic_starts", "finished")}
    given |= {"failed_starts": (("a", "b"), np.zeros((2, 2), dtype=int))}

    def colours(values, **more):
        found = xarray.Dataset(given | {"m": (("a", "b"), values)}, {name: [1.0, 2.0] for name in "ab"}, {"starts": 1})
        return fi.figures.study(found, "m", ax=fi.figures.OffScreen(), **more).images[0].norm

    # the middle of the scale is the geometric mean of its ends
    assert colours(values)(np.sqrt(52.0)) == pytest.approx(0.5)
    assert colours(values, norm="linear")(26.5) == pytest.approx(0.5)
    assert colours(values / 6.0 + 1.0)(np.mean([values.min(), values.max()]) / 6.0 + 1.0) == pytest.approx(0.5)
    # a value of no size has no logarithm
    assert colours(values - 1.0)(25.5) == pytest.approx(0.5)
    with pytest.raises(fi.InputError, match=r"norm = 'log'.*above 0"):
        colours(values - 1.0, norm="log")
    with pytest.raises(fi.InputError, match="norm"):
        colours(values, norm="cubic")


def test_the_figure_of_a_study_follows_its_axes_and_refuses_what_does_not_fit_them():
    def peaks(*sizes, names="abcd", **coords):
        table = xarray.DataArray(np.arange(1.0, 1.0 + np.prod(sizes)).reshape(sizes), dims=list(names)[: len(sizes)])
        return xarray.Dataset({"m": table}, coords or {name: np.arange(table.sizes[name]) for name in table.dims})

    def drawn(dataset, **more):
        return fi.figures.study(dataset, **({"figure": fi.figures.OffScreen()} | more))

    line = drawn(peaks(3))
    # an axis of one value does not count
    np.testing.assert_array_equal(line.lines[0].get_ydata(), drawn(peaks(1, 3)).lines[0].get_ydata())
    assert not line.images
    assert len(drawn(peaks(3, 2)).images) == 1
    assert drawn(peaks(3, 2, 4)).shape == (1, 4)
    assert drawn(peaks(3, names=["case"], gap=("case", [1.0, 2.0, 4.0]), mass=("case", [1.0, 2.0, 3.0]))).shape == (
        1,
        2,
    )
    ax = line
    for dataset, more, words in (
        (peaks(), {}, "must have an axis"),
        (peaks(3, 2, 4), {"ax": ax, "figure": None}, "must be left out, over 3 axes: give figure="),
        (peaks(3, names=["case"], gap=("case", [1.0, 2.0, 4.0])), {"ax": ax, "figure": None}, "list of cases: give"),
        (peaks(3), {"ax": ax}, "must be left out beside figure="),
        (peaks(3), {"norm": "log"}, "norm = 'log': must be left out: colours are those of a map"),
        (peaks(3), {"measure": "n"}, "measure"),
        (peaks(3)["m"], {}, "must be a Dataset"),
    ):
        with pytest.raises(fi.InputError, match=words):
            drawn(dataset, **more)


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_a_figure_has_the_values_in_the_units_of_its_labels(axes):
    given = {GAP: [2e-3, 4e-3], RESTITUTION: [0.5, 0.7], "base.frequency": [4.8, 5.0]}
    found = fi.parameter_study(study(), dict(list(given.items())[:axes]), ["peak"], starts=5, cycles=6)
    sheet = fi.figures.OffScreen()
    if axes == 1:
        drawn = fi.figures.study(found, "peak", ax=sheet)
        np.testing.assert_allclose(drawn.lines[0].get_xydata(), np.column_stack([[2.0, 4.0], 1e3 * found["peak"]]))
    else:
        drawn = np.atleast_2d(fi.figures.study(found, "peak", figure=sheet))[0, 0]
        first = found["peak"] if axes == 2 else found["peak"][:, :, 0]
        np.testing.assert_allclose(drawn.images[0].get_array(), 1e3 * first.to_numpy().T)
    assert "(mm)" in drawn.get_xlabel() or axes == 3


# ---- workers of a cluster --------------------------------------------------------------------------


class Cluster:
    """A client of workers that are threads of this process, and say of themselves what they are told to say."""

    def __init__(self, *said):
        self.said = said

    def run(self, function):
        """Facts of every worker by its address."""
        return {f"tcp://10.0.0.{i}:40000": {**function(), **changes} for i, changes in enumerate(self.said)}

    def submit(self, function, *given, pure):
        """The result at once."""
        assert not pure
        return function(*given)

    def get_executor(self, **options):
        """Threads in place of workers."""
        return ThreadPoolExecutor(len(self.said))

    def nthreads(self):
        """One of each worker."""
        return {i: 1 for i, _ in enumerate(self.said)}


def test_workers_of_the_same_version_give_the_bits_of_this_process():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = small(client=Cluster({}, {}), starts=2)
    xarray.testing.assert_identical(found, small(starts=2))


@pytest.mark.parametrize("name", ["sources", "core", "numpy", "scipy"])
def test_a_worker_of_another_version_is_refused_before_the_first_case(name, tmp_path):
    with pytest.raises(fi.InputError) as caught:
        small(client=Cluster({}, {name: "0.0.1"}), directory=tmp_path / "out")
    assert str(caught.value).startswith(f"worker tcp://10.0.0.1:40000: has {name} 0.0.1, and this process ")
    assert not list((tmp_path / "out" / BLOCKS).glob("*.block"))


def test_a_worker_that_comes_after_the_others_were_checked_is_refused_by_its_first_block():
    class Late(Cluster):
        def submit(self, function, study, versions, *, pure):
            return function(study, {**versions, "scipy": "0.0.1"})

    words = r"^worker .*: has scipy .*, and the process with the client 0.0.1: install the same femimpact$"
    with pytest.raises(fi.InputError, match=words):
        small(client=Late({}))


def test_a_cluster_that_drops_the_work_is_one_line():
    class Dropping(Cluster):
        def get_executor(self, **options):
            class Pool(ThreadPoolExecutor):
                def submit(self, *given):
                    future = Future()
                    future.cancel()
                    future.set_running_or_notify_cancel()
                    return future

            return Pool(1)

    with pytest.raises(fi.InputError, match="client = 'Dropping': has dropped the work: its scheduler must be running"):
        small(client=Dropping({}))


NO_SCHEDULER = {
    "text": ("hello", "the file is not JSON"),
    "empty": ("", "the file is not JSON"),
    "nested": ("[" * 100_000, "the file is not JSON"),
    "without address": ('{"id": "x"}', "the file has no address"),
    "a list": ('["tcp://127.0.0.1:1"]', "the file has no address"),
    "a number": ('{"address": 8786}', "the address in the file has no port"),
    "without port": ('{"address": "host"}', "the address in the file has no port"),
}


@pytest.mark.parametrize("kind", [*NO_SCHEDULER, "missing", "folder", "pipe"])
def test_a_scheduler_file_that_is_none_is_one_line(kind, tmp_path):
    pytest.importorskip("distributed")
    from femimpact.app.parametric.verb import connected

    path, (text, words) = tmp_path / "scheduler.json", NO_SCHEDULER.get(kind, (None, "no port, and as a file: "))
    if text is not None:
        path.write_text(text)
    elif kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        if not hasattr(os, "mkfifo"):
            pytest.skip("no pipes with names")
        os.mkfifo(path)
    with pytest.raises(fi.InputError) as caught, connected(str(path)):
        pass
    (line,) = str(caught.value).splitlines()
    assert line.startswith(f"scheduler = {str(path)!r}: must be the address of a running scheduler")
    assert f"or its scheduler file: {words}" in line


def test_workers_without_femimpact_or_none_at_all_are_refused():
    class Bare(Cluster):
        def run(self, function):
            raise ModuleNotFoundError("No module named 'femimpact'")

    with pytest.raises(fi.InputError, match=r"must have workers with the same femimpact .*No module named"):
        small(client=Bare({}))
    with pytest.raises(fi.InputError, match="must have one worker or more"):
        small(client=Cluster())


def test_processors_of_several_kinds_are_warned_of_and_the_study_runs():
    with pytest.warns(fi.InputWarning, match=r"several kinds of processors \(.*old one.*\): the last bits may depend"):
        found = small(client=Cluster({}, {"processor": "v2 x86_64 an old one"}))
    assert found["finished"].all()


@pytest.mark.parametrize("open_side", [0, 1])
def test_a_stop_on_one_side_stays_open_on_the_other_whatever_its_gap(open_side):
    """A number is the gap of the side that is not open, a pair that of both sides; cases are runs of their own."""

    def sides(gap):
        return (math.inf, gap) if open_side == 0 else (gap, math.inf)

    def with_stop(gap):
        stop = fi.Stop("stop", "tip", gap, fi.KelvinVoigt(stiffness=1e3, restitution=0.7))
        return replace(study(), structure=replace(study().structure, impactors=(), stops=(stop,)))

    path, axis = "stop.stop.gap", [1e-3, 2e-3]
    alone = [
        float(fi.parameter_study(with_stop(sides(gap)), {"base.frequency": [5.3]}, ["peak"], cycles=30)["peak"][0])
        for gap in axis
    ]
    closed = float(fi.parameter_study(with_stop(axis[0]), {"base.frequency": [5.3]}, ["peak"], cycles=30)["peak"][0])
    assert abs(closed - alone[0]) > 0.02 * closed
    own = replace(with_stop(sides(1.5e-3)), base=replace(study().base, frequency=5.3))
    for given in (own, build(own)[1]):
        excitation = None if given is own else own.base
        for values in (axis, [sides(gap) for gap in axis]):
            found = fi.parameter_study(given, {path: values}, ["peak"], cycles=30, excitation=excitation)
            assert found["peak"].values.tolist() == pytest.approx(alone, rel=1e-12)
        mixed = fi.parameter_study(given, {path: [1e-3, sides(2e-3)]}, ["peak"], cycles=30, excitation=excitation)
        gaps = [mixed[f"{path}.{side}"].values.tolist() for side in ("plus", "minus")]
        assert list(zip(*gaps, strict=True)) == [sides(gap) for gap in axis]
    changed = study_with(own, {paths_of_study(own)[path]: 1e-3})
    assert changed.structure.stops[0].gap == sides(1e-3)
