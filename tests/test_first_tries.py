"""What a first try gets wrong is answered by what would be right."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from builders import REFERENCE, oscillator, reduced
from command import femimpact
from test_readme import ROOT

import femimpact as fi

SHOCK = fi.Shock("half-sine", acceleration=100.0, duration=0.011)


def test_an_argument_that_a_function_does_not_have_is_answered_by_those_that_it_has():
    words = (
        r"shock_response_spectrum\(\) got an unexpected .* 'damping'; its arguments are of, frequency, ratio, channel,"
    )
    with pytest.raises(TypeError, match=words):
        fi.shock_response_spectrum(SHOCK, [10.0], damping=0.05)
    words = r"State.under_force\(\) missing a required argument: 'force'; its arguments are system, force, at: The "
    with pytest.raises(TypeError, match=words):
        fi.State.under_force(reduced(REFERENCE, 2))
    with pytest.raises(
        TypeError, match=r"Beam\.uniform\(\) got an unexpected keyword argument 'lenght'; its arguments"
    ):
        fi.Beam.uniform(lenght=0.2)


def test_a_channel_that_was_not_recorded_is_answered_by_how_to_keep_it_beside_the_others():
    system = reduced(REFERENCE, 2)
    run = fi.integrate(system, fi.Sine(1e-3, 5.0), fi.EventDriven(), 0.4, fi.Recorder(channels=("tip",)))
    words = r"run with fi\.Recorder\(channels=\('tip', \.\.\.\)\): names given replace the default ones"
    with pytest.raises(fi.InputError, match=rf"channel = 'tip\.velocity': unknown; .*known: tip; .*{words}"):
        run["tip.velocity"]
    with pytest.raises(fi.InputError, match=rf"channel = '0\.1': unknown; .*known: tip; .*{words}"):
        fi.figures.bifurcation([run], "0.1")
    pytest.importorskip("matplotlib")
    with pytest.raises(fi.InputError, match=rf"channel = 'ball': unknown; .*{words}"):
        fi.figures.motion(run)


def test_a_wrong_stiffness_is_not_said_of_a_damping_in_proportion_to_it():
    wrong = np.array([[1.0, -2.0], [-2.0, 1.0]])
    for damping in (wrong, np.eye(2)):
        with pytest.raises(fi.InputError, match=r"^K = -1\.0: must be positive semidefinite"):
            fi.System.from_matrices(np.eye(2), damping, wrong, points={"tip": [0.0, 1.0]})
    with pytest.raises(fi.InputError, match=r"^C = -1\.0: must be positive semidefinite"):
        fi.System.from_matrices(np.eye(2), wrong, np.eye(2), points={"tip": [0.0, 1.0]})


def test_a_ratio_over_the_frequency_says_what_it_compares():
    study = fi.load_study("meshes/stepped_cantilever.toml")
    axes = {"impactor.ball.gap": [1e-3, 2e-3], "base.frequency": [8.5, 9.0]}
    found = fi.parameter_study(study, axes, ["peak", "peak_ratio"], cycles=30)
    assert "compares cases of one frequency" in str(fi.best_case(found, "peak_ratio"))
    assert "compares cases of one frequency" not in str(fi.best_case(found, "peak"))


def test_the_title_of_the_spectrum_of_a_free_decay_says_how_all_of_it_is_taken():
    pytest.importorskip("matplotlib")
    for amplitude, is_said in ((0.0, True), (1e-3, False)):
        start = fi.State(displacement=[1e-3])
        run = fi.integrate(oscillator(4e3, 5.0), fi.Sine(amplitude, 10.0), fi.EventDriven(), 3.0, initial=start)
        title = fi.figures.spectrum(run).get_title(loc="left")
        assert title.startswith("last 10 cycles")
        assert ("of a free decay fi.spectrum(run, start=0.0) takes all" in title) == is_said
        whole = fi.spectrum(run, start=0.0)
        assert 1.0 / whole.resolution == pytest.approx(3.0, rel=1e-6)
        # the mode at 10 Hz has decayed by then
        assert not is_said or whole.values.max() > 1.5 * fi.spectrum(run).values.max()


def test_a_folder_without_its_option_is_answered_by_the_option(tmp_path):
    done = femimpact("demo", "folder", cwd=tmp_path, check=False)
    assert done.returncode == 2
    assert "results go to a folder by --output FOLDER" in done.stderr


def test_the_first_gap_to_try_is_read_as_the_page_on_studies_says():
    page = (ROOT / "docs" / "howto" / "parameter_studies.md").read_text(encoding="utf-8")
    call, said = re.search(r"`(next\(row\.value .*?\))` is its number, ([\d.]+) mm", page).groups()
    ball = replace(REFERENCE.impactors[0], mass=5e-3)
    beam = fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    box = fi.PointMass("box", "tip", 0.023)
    system = reduced(replace(REFERENCE, beam=beam, masses=(box,), impactors=(ball,)), 4)
    assert eval(call, {"fi": fi, "system": system}) == pytest.approx(1e-3 * float(said), abs=6e-6)


def test_a_round_rod_a_picture_and_a_structure_are_answered_by_their_calls():
    size = {"length": 0.5, "young_modulus": 210e9, "density": 7850}
    with pytest.raises(TypeError, match=r"Beam\.uniform\(\) .*, where `round`, `tube` and `section` make others"):
        fi.Beam.uniform(diameter=8e-3, **size)
    with pytest.raises(AttributeError, match=r"it is fi\.frequency_sweep; pictures are .*figures\.response_curve"):
        _ = fi.figures.frequency_response
    with pytest.raises(
        fi.InputError, match=r"study = 'Structure': .*fi\.reduce\(fi\.assemble\(structure, elements=40\)"
    ):
        fi.parameter_study(REFERENCE, {"impactor.ball.gap": [1e-3]}, ["peak"])
