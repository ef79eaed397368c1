"""`femimpact contact`: the table is what one collision gives, and the figure is that collision."""

import math
from functools import partial

import numpy as np
import pytest
from builders import build, load_study, paper_study_text, read_csv
from command import femimpact

import femimpact as fi
from femimpact.export.figures import OffScreen, collision_history, contact_laws
from femimpact.study.contact_table import UNITS, approach_speeds, contact_table

MASS = 3e-3
LINEAR = 'law = "kelvin-voigt", restitution = 0.78, contact_time = 2e-3'
SECOND = """
[[impactor]]
name = "second"
at = "tip"
mass = 0.002
gap = 0.004
contact = { law = "flores", stiffness = 1e7, restitution = 0.5 }

[damping] """
STUDY = paper_study_text().replace("\n[damping] ", SECOND)


contact = partial(femimpact, "contact", check=False)


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    folder = tmp_path_factory.mktemp("contact")
    (folder / "two.toml").write_text(STUDY, encoding="utf-8")
    done = contact("two.toml", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder, done.stdout


def test_it_leaves_a_table_and_a_figure_and_prints_the_table(ran):
    folder, printed = ran
    assert {path.name for path in (folder / "two-contact").iterdir()} == {"contact.csv", "contact_force.png"}
    for words in ("kelvin-voigt", "flores", "0.47044", "results in two-contact"):
        assert words in printed
    assert "…" not in printed
    assert "nan" not in printed


def test_the_table_read_back_is_one_collision_a_row(ran):
    folder, _ = ran
    table = read_csv(folder / "two-contact" / "contact.csv")
    _, small, method = build(load_study(folder / "two.toml"))
    assert list(table) == ["impactor", "law", *UNITS]
    assert list(table["impactor"]) == ["ball"] * 7 + ["second"] * 7
    assert list(table["law"]) == ["kelvin-voigt"] * 7 + ["flores"] * 7
    np.testing.assert_array_equal(table["restitution_asked"], [0.78] * 7 + [0.5] * 7)
    np.testing.assert_allclose(table["approach_speed"][:7], 10 ** np.linspace(-2, 0, 7), rtol=1e-12)
    for i, name in enumerate(table["impactor"]):
        pair = next(pair for pair in small.contacts if pair.name == name)
        speed = table["approach_speed"][i]
        found = fi.collide(pair.law, pair.effective_mass, speed)
        for column in ("restitution", "contact_time", "peak_force", "largest_penetration", "energy_loss"):
            assert table[column][i] == getattr(found, column)
        assert table["steps_per_contact"][i] == found.contact_time / method.dt
        assert table["restitution_with_step"][i] == fi.achieved_restitution(pair, method, speed).mean


def test_existing_results_are_kept_unless_forced_and_quiet_prints_nothing(ran):
    folder, _ = ran
    before = (folder / "two-contact" / "contact.csv").read_bytes()
    refused = contact("two.toml", "--speed-max", 2, cwd=folder)
    assert refused.returncode == 2
    assert "exists already" in refused.stderr
    assert (folder / "two-contact" / "contact.csv").read_bytes() == before
    limits = ("--speed-min", 0.1, "--speed-max", 2)
    forced = contact("two.toml", *limits, "-o", "two-contact", "--force", "--quiet", cwd=folder)
    assert (forced.returncode, forced.stdout) == (0, "")
    speeds = read_csv(folder / "two-contact" / "contact.csv")["approach_speed"]
    assert (speeds.min(), speeds.max()) == pytest.approx((0.1, 2.0), rel=1e-12)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--speed-min", 0), "speed_min = 0.0 m/s: must be a finite number > 0 m/s"),
        (("--speed-min", 1), "speed_max = 1.0 m/s: must be a finite number > speed_min, 1 m/s"),
        (("--speed-max", "inf"), "speed_max = inf m/s: must be a finite number > speed_min, 0.01 m/s"),
        (("--speed-max", "fast"), "fast"),
    ],
)
def test_bad_speeds_exit_with_2_and_leave_nothing(tmp_path, arguments, words):
    (tmp_path / "two.toml").write_text(STUDY, encoding="utf-8")
    done = contact("two.toml", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["two.toml"]


def test_a_study_without_a_contact_is_refused(tmp_path):
    text = paper_study_text()
    start, end = text.index("[[impactor]]"), text.index("[damping]")
    (tmp_path / "empty.toml").write_text(text[:start] + text[end:], encoding="utf-8")
    done = contact("empty.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert "table [[impactor]] is missing from the study" in done.stderr


def test_a_rigid_contact_needs_no_step(tmp_path):
    (tmp_path / "rigid.toml").write_text(
        paper_study_text().replace(LINEAR, 'law = "rigid", restitution = 0.78'), encoding="utf-8"
    )
    table = contact_table(load_study(tmp_path / "rigid.toml"))
    assert table["restitution"] == [0.78] * 7
    assert table["contact_time"] == [0.0] * 7
    for column in ("restitution_with_step", "steps_per_contact", "peak_force"):
        assert all(math.isnan(value) for value in table[column])


def test_not_a_number_is_no_speed():
    with pytest.raises(fi.InputError, match="speed_min = nan m/s"):
        approach_speeds(math.nan, 1.0)


@pytest.mark.parametrize("speed", [0.01, 1.0])
@pytest.mark.parametrize(
    "law",
    [
        fi.KelvinVoigt(restitution=0.6, contact_time=2e-3),
        fi.KelvinVoigt(restitution=0.05, contact_time=2e-3),
        fi.SwitchingSpring(free_stiffness=0.0, stiffness=1e4),
        fi.Hertz(1e9),
        fi.Flores(1e9, 0.2),
        fi.GonthierCarvalhoMartins(1e9, 0.9),
    ],
    ids=lambda value: getattr(value, "name", value),
)
def test_the_loop_drawn_is_the_collision_of_the_table(law, speed):
    found = fi.collide(law, MASS, speed)
    depth, rate, force = collision_history(law, MASS, speed)
    # integrated to 1e-9; extremes of 400 samples, with a curvature of a half period in them
    assert -rate[-1] / speed == pytest.approx(found.restitution, rel=1e-5)
    assert force.max() == pytest.approx(found.peak_force, rel=1e-3)
    assert depth.max() == pytest.approx(found.largest_penetration, rel=1e-4)
    # the loop's area, by trapezoids
    area = np.trapezoid(force, depth)
    started = 0.5 * MASS * speed**2
    assert area == pytest.approx(found.energy_loss, abs=2e-3 * started)


def test_a_figure_has_one_panel_a_contact_and_labels_every_loop():
    laws = [fi.KelvinVoigt(restitution=0.6, contact_time=2e-3), fi.Rigid(0.5), fi.Hertz(1e9)]
    axes = contact_laws([(law.name, law, MASS) for law in laws], [0.25, 0.5, 1.0], OffScreen())
    texts = [[text.get_text() for text in axis.texts] for axis in axes]
    assert texts == [
        ["1 m/s", "0.5 m/s", "0.25 m/s"],
        ["an impulse only: no force, no penetration"],
        ["1 m/s", "0.5 m/s", "0.25 m/s"],
    ]
