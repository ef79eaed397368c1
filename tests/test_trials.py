"""What a sceptical first user ran into once: it must not come back."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from builders import paper_study, paper_study_text, prepare, reduced, run_simulation, summary_of, with_ball

import femimpact as fi
from femimpact.app.tasks.run import run_modes

pytestmark = pytest.mark.impacts

BASE = fi.Sine(amplitude=0.2037e-3, frequency=4.9)


def test_a_ball_that_rides_on_its_wall_weighs_on_it(reference):
    system = reduced(with_ball(reference, acceleration=-9.81))
    method = fi.Newmark(fi.recommended_step(system))
    response = fi.integrate(system, BASE, method, 30.0, fi.Recorder(("contact_force",)))
    weight = 3.43e-3 * 9.81
    last = response.time >= 20.0
    # the mean force of a ball that stays on its wall is its weight; the base's cycles average out to 1 %
    assert response.statistics.cycle_mean_force == pytest.approx(weight, rel=0.01)
    assert response.statistics.peak_force == np.abs(response["contact_force"][last]).max()
    assert any("ball is in contact at the end" in note for note in response.notes)
    curve = fi.frequency_sweep(system, BASE.amplitude, [4.9], method, cycles=100)
    assert curve.cycle_mean_force[0] == pytest.approx(weight, rel=0.01)


def test_a_full_table_of_impacts_does_not_change_the_statistics(small):
    method = fi.Newmark(fi.recommended_step(small))
    runs = [fi.integrate(small, BASE, method, 10.0, fi.Recorder(("tip",), 100, impacts=n)) for n in (1000, 3)]
    assert len(runs[1].impacts) == 3 < len(runs[0].impacts)
    assert runs[0].statistics == runs[1].statistics
    assert runs[0].statistics.count > 3


def test_each_ball_has_its_own_statistics(reference):
    law = fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
    balls = (fi.Impactor("outer", "tip", 2e-3, 1e-3, law), fi.Impactor("inner", 0.15, 1e-3, 0.5e-3, law))
    system = reduced(dataclasses.replace(reference, impactors=balls))
    response = fi.integrate(system, BASE, fi.Newmark(fi.recommended_step(system)), 10.0)
    parts = response.statistics_of
    assert set(parts) == {"outer", "inner"}
    assert sum(part.count for part in parts.values()) == response.statistics.count
    # forces add up to rounding
    total = sum(part.cycle_mean_force for part in parts.values())
    assert total == pytest.approx(response.statistics.cycle_mean_force, rel=1e-12)


def test_a_restitution_that_the_beam_changes_is_warned_of():
    study = paper_study()
    ball = dataclasses.replace(study.structure.impactors[0], at="mid", gap=0.5e-3)
    study = dataclasses.replace(
        study,
        structure=dataclasses.replace(study.structure, impactors=(ball,)),
        base=dataclasses.replace(study.base, frequency=5.2),
        duration=20.0,
    )
    prepared = prepare(study)
    summary = summary_of(prepared, run_modes(prepared), run_simulation(prepared))
    # thrown at the middle of the beam, 0.8 comes back as 0.4: the second mode takes the rest
    assert summary["contact"]["observed_restitution"] < 0.6
    assert any("rebound with" in warning for warning in summary["warnings"])


@pytest.mark.parametrize("name", ["time", "base", "tip", "ball/x", "ball.x", "", "gap"])
def test_names_that_files_and_channels_need_are_refused(reference, name):
    with pytest.raises(fi.InputError, match="name"):
        with_ball(reference, name=name)


@pytest.mark.parametrize("other", [0.0, 1e-13])
def test_the_same_place_twice_holds_no_beam(reference, other):
    with pytest.raises(fi.InputError, match="must hold the beam"):
        dataclasses.replace(reference, supports=(fi.Support("pinned", "root"), fi.Support("pinned", other)))


def test_a_mesh_point_that_is_the_same_place_is_found_in_assembly(request):
    mesh = fi.read_mesh(request.config.rootpath / "meshes" / "stepped_cantilever.msh")
    beam = fi.Beam.uniform(length=0.25, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700)
    structure = fi.Structure(beam, supports=(fi.Support("pinned", "joint"), fi.Support("pinned", 0.1)))
    with pytest.raises(fi.InputError, match="must hold two places of the mesh"):
        fi.assemble(structure, mesh=mesh)


def test_a_dwell_shorter_than_the_transient_is_warned_of(small):
    empty = fi.without_impactors(small)
    method = fi.Newmark(fi.recommended_step(empty))
    short = fi.frequency_sweep(empty, 1e-4, [5.2, 5.3], method, cycles=24)
    # exp(-0.0029 x 2 pi x 16) = 75 % of the transient is there
    assert any("75 % of the first mode's transient" in warning for warning in short.warnings)
    long = fi.frequency_sweep(empty, 1e-4, [5.2, 5.3], method, cycles=600)
    assert not any("transient (damping" in warning for warning in long.warnings)


def test_too_few_steps_in_a_base_cycle_are_refused(small):
    with pytest.raises(fi.InputError, match=r"frequency = 5000\.0 Hz: must be <= 1250 Hz"):
        fi.integrate(small, fi.Sine(1e-4, 5000.0), fi.Newmark(1e-4), 1.0)


def test_numpy_scalars_and_arrays_are_numbers_too(small):
    response = fi.integrate(small, BASE, fi.Newmark(1e-4), np.float32(0.5), fi.Recorder("tip"))
    assert response.time[-1] == pytest.approx(0.5)
    law = fi.KelvinVoigt(stiffness=1e4, restitution=0.5)
    assert fi.Impactor("ball", "tip", 1e-3, np.array([1e-3, 2e-3]), law).gaps == (1e-3, 2e-3)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda s, m, r: fi.integrate(s, BASE, 1e-4, 1.0), "method = 'float': must be a Newmark, HHT"),
        (lambda s, m, r: fi.integrate(r, BASE, m, 1.0), "system = 'Structure': must be a System"),
        (lambda s, m, r: fi.integrate(s, BASE, m, 1.0, record=("tip",)), "record = 'tuple': must be a Recorder"),
        (lambda s, m, r: fi.frequency_sweep(s, 1e-4, [5.0], m, 3, threads="2"), "threads = '2'"),
        (lambda s, m, r: fi.frequency_sweep(s, 1e-4, "5", m, 3), "frequencies = '5' Hz: must be one or more"),
        (lambda s, m, r: fi.frequency_sweep(s, 1e-4, [5.0, None], m, 3), "frequencies = .*must be one or more"),
        (lambda s, m, r: fi.frequency_sweep(s, 1e-4, [5.0], m, 3, initial=0), "initial = 'int': must be a State"),
        (lambda s, m, r: fi.frequency_sweep(s, 1e-4, [5.0], m, 3, at=[1]), r"at = \[1\]: must be the name of a place"),
        (lambda s, m, r: fi.frequency_sweep(s, 1e-4, [5.0], m, 3, ledger="no"), "ledger = 'no': must be True or False"),
        (
            lambda s, m, r: fi.frequency_sweep(s, 1e-4, [5.0], m, 3, progress=1),
            "progress = 'int': must be True, or callable",
        ),
        (lambda s, m, r: fi.integrate(s, fi.PointForce(None, BASE), m, 1.0), "at: must be .*metres from the root"),
        (
            lambda s, m, r: fi.integrate(s, BASE, m, 1.0, initial=fi.State("a")),
            r"displacement = 'a' m: must be an array \(dofs,\) of finite numbers",
        ),
        (lambda s, m, r: fi.integrate(s, BASE, m, 1.0, initial=fi.State(ball_velocity=[1j])), "^ball_velocity = "),
        (lambda s, m, r: fi.assemble(None, elements=3), "structure: must be a Structure|structure = 'NoneType'"),
        (lambda s, m, r: fi.reduce(r, 3), "system = 'Structure': must be a System"),
        (lambda s, m, r: fi.recommended_step(r), "system = 'Structure': must be a System"),
        (
            lambda s, m, r: fi.System.from_matrices("a", 0.0, 1.0, points={"p": [1.0]}),
            "M = 'a': must hold finite numbers",
        ),
        (lambda s, m, r: fi.System.from_matrices(1.0, 0.0, 1.0, points="p"), "points = 'str': must be a Mapping"),
        (lambda s, m, r: fi.System.from_matrices(1.0, 0.0, 1.0, points={"p": "x"}), "points.p = 'x': must hold 1"),
        (lambda s, m, r: fi.System.from_matrices(1.0, 0.0, 1.0, points={"p": 1.0}, stops=[1]), "stops = 'int'"),
        (lambda s, m, r: fi.Sine((1e-4,), 5.0), r"amplitude = \(0.0001,\) m: must be a finite number"),
        (lambda s, m, r: fi.Newmark((1e-4,)), r"dt = \(0.0001,\) s: must be a finite number"),
        (lambda s, m, r: fi.Support(("clamped",), "root"), r"kind = \('clamped',\): must be 'clamped'"),
        (lambda s, m, r: dataclasses.replace(r, masses=r.masses[0]), "masses = 'PointMass': must be a list or a tuple"),
        (lambda s, m, r: dataclasses.replace(r, masses=["box"]), "masses = 'str': must be a PointMass"),
        (lambda s, m, r: fi.Beam(r.beam.segments[0]), "segments = 'Segment': must be a list or a tuple"),
        (
            lambda s, m, r: dataclasses.replace(r, damping=0.01),
            "damping = 0.01: must be a Rayleigh, a Mod",
        ),
    ],
)
def test_a_thing_of_the_wrong_kind_is_named(small, reference, call, words):
    with pytest.raises(fi.InputError, match=words):
        call(small, fi.Newmark(1e-4), reference)


def test_a_study_from_an_editor_that_writes_a_byte_order_mark_is_read(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(paper_study_text(), encoding="utf-8-sig")
    assert fi.load_study(path).structure == paper_study().structure
