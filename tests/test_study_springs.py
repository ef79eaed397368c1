"""Springs, dashpots, modal damping, offset bodies and channels in study files: what is read is what is run."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders import prepare, read_study, same_study, study_text

import femimpact as fi

TEXT = """
[beam]
length = 0.3
width = 0.02
thickness = 1.5e-3
young_modulus = 70e9
density = 2700.0
[mesh]
elements = 6
[[mass]]
name = "box"
at = "tip"
mass = 0.02
offset = 4e-3
[[impactor]]
name = "ball"
at = "tip"
mass = 3e-3
gap = 4e-4
contact = { law = "rigid", restitution = 0.6 }
[[spring]]
name = "post"
at = 0.21
stiffness = 150.0
[damping]
ratios = [0.01, 0.02]
[reduction]
modes = 4
[base]
amplitude = 1e-3
frequency = 12.0
duration = 0.5
[method]
name = "event-driven"
[output]
every = 1
channels = ["root.reaction_force", "root.surface_stress", "shaker_force"]
figures = false
movie = false
paraview = false
"""


def study(text=TEXT):
    return read_study(text, Path("study.toml"))


def test_a_beam_that_only_springs_hold_is_written_without_supports():
    damped = TEXT.replace("ratios = [0.01, 0.02]", "ratio = 0.01\nfrequencies = [10, 90]")
    free = study(f"support = []\n{damped}")
    assert free.structure.supports == ()
    written = study_text(replace(free, duration=0.4))
    assert study(written).structure == free.structure


def test_the_structure_is_what_the_tables_say():
    found = study().structure
    assert found.springs == (fi.Spring("post", 0.21, 150.0),)
    assert found.damping == fi.ModalDamping((0.01, 0.02))
    assert found.masses[0].offset == 4e-3
    small = prepare(study()).small
    assert fi.solve_modes(small, 2).damping_ratio == pytest.approx([0.01, 0.02], rel=1e-9)


def test_dashpots_are_read_and_those_that_couple_modes_need_all_dofs():
    text = TEXT.replace("[damping]", '[[dashpot]]\nname = "damper"\nat = 0.21\ndamping = 0.5\n[damping]')
    assert study(text).structure.dashpots == (fi.Dashpot("damper", 0.21, 0.5),)
    with pytest.raises(fi.InputError, match="damping"):
        prepare(study(text))


def test_a_study_that_was_changed_is_written_with_all_its_tables():
    changed = replace(study(), base=replace(study().base, frequency=13.0))
    again = read_study(study_text(changed), Path("study.toml"))
    assert same_study(again, changed)
    assert again.structure == changed.structure
    assert again.output.channels == ("root.reaction_force", "root.surface_stress", "shaker_force")


def test_channels_of_the_study_are_in_its_history(tmp_path):
    results = fi.run_study(study(), tmp_path / "out", parts=("simulate",))
    history = results.history
    for name, unit in (("root.reaction_force", "N"), ("root.surface_stress", "Pa"), ("shaker_force", "N")):
        assert history[name].attrs["units"] == unit
        assert np.abs(history[name].values).max() > 0.0


@pytest.mark.parametrize("name", ["tip.velocty", "tip.reaction_force"])
def test_a_channel_that_cannot_be_read_is_refused_before_the_run(name):
    with pytest.raises(fi.InputError, match=r"output\.channels = .*(unknown|no such reaction)"):
        prepare(study(TEXT.replace("shaker_force", name)))


def test_a_spring_of_no_place_is_named():
    with pytest.raises(fi.InputError, match=r"spring\.post\.at"):
        prepare(study(TEXT.replace("at = 0.21", 'at = "nowhere"')))
