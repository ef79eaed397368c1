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


def test_a_study_from_an_editor_that_writes_a_byte_order_mark_is_read(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(paper_study_text(), encoding="utf-8-sig")
    assert fi.load_study(path).structure == paper_study().structure
