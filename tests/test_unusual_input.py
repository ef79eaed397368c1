"""Structures that are allowed, and so unusual that a warning names the number."""

import warnings
from dataclasses import replace

import pytest

import femimpact as fi


def beam(**changes):
    return fi.Structure(beam=fi.Beam.uniform(**{**GIVEN, **changes}))


def with_ball(**changes):
    ball = {"mass": 3e-3, "gap": 3e-3, "contact": fi.Rigid(restitution=0.6), **changes}
    box = fi.PointMass("box", at="tip", mass=0.02)
    return fi.Structure(fi.Beam.uniform(**GIVEN), [box], [fi.Impactor("ball", at="tip", **ball)])


def with_box(**box):
    return fi.Structure(fi.Beam.uniform(**GIVEN), [fi.PointMass("box", at="tip", **box)])


GIVEN = {"length": 0.23, "width": 0.02, "thickness": 1e-3, "young_modulus": 70e9, "density": 2700.0}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        # 230 mm by 20 mm by 1 mm, typed as metres
        ({"length": 230.0, "width": 20.0, "thickness": 1.0}, r"beam\.mass = 1\.242e\+07 kg: more than 1000 kg"),
        ({"thickness": 0.1}, r"beam\.length = 2\.3 times the thickness: below 5"),
        ({"length": 5.0, "thickness": 1e-4}, r"first mode at 0\.00\d+ Hz: outside 0\.01 to 100000 Hz"),
        ({"length": 2.3e-4, "width": 2e-4, "thickness": 2e-5}, r"first mode at \d+(\.\d+)?e\+05 Hz: outside"),
    ],
)
def test_an_unusual_beam_is_taken_with_a_warning_that_names_the_number(changes, words):
    with pytest.warns(fi.InputWarning, match=words):
        system = fi.assemble(beam(**changes), elements=4)
    assert system.first_frequency > 0.0


@pytest.mark.parametrize(
    ("structure", "words"),
    [
        (beam(young_modulus=70e3), r"beam\.young_modulus = 7e\+04 Pa: outside 1e\+08 to 2e\+12 Pa .*in Pa\?"),
        (beam(young_modulus=70e15), r"beam\.young_modulus = 7e\+16 Pa: outside"),
        # g/cm^3
        (beam(density=2.7), r"beam\.density = 2\.7 kg/m\^3: outside 10 to 30000 kg/m\^3"),
        (beam(density=2.7e6), r"beam\.density = 2\.7e\+06 kg/m\^3: outside"),
        (beam(width=20.0), r"beam\.width = 20 m: more than the length of the beam, .* 20 mm are 0\.02 m"),
        (
            fi.Structure(
                fi.Beam.section(
                    length=0.23, area=2e-5, second_moment=1.7e-12, outer_fibre=0.6, young_modulus=70e9, density=2700.0
                )
            ),
            r"beam\.outer_fibre = 0\.6 m: more than the length of the beam",
        ),
        (with_ball(gap=3.0), r"impactor\.ball\.gap = 3 m: wider than the beam is long, 0\.23 m; .* 3 mm are"),
        (with_ball(gap=(2.0, 3.0)), r"impactor\.ball\.gap = 2 m: wider"),
        (with_ball(mass=3.0), r"impactor\.ball\.mass = 3 kg: more than beam and bodies together, 0\.03242 kg; .* 3 g"),
        (with_box(mass=2.0), r"mass\.box\.mass = 2 kg: more than 100 times the beam's .* 2 g are 0\.002 kg"),
        (with_box(mass=0.02, offset=-5.0), r"mass\.box\.offset = -5 m: longer than the beam, .* are -0\.005 m"),
    ],
)  # fmt: skip
def test_a_number_that_may_be_in_another_unit_is_named_with_what_is_usual(structure, words):
    with pytest.warns(fi.InputWarning, match=words):
        fi.assemble(structure, elements=4)


def test_box_and_ball_in_grams_are_both_named():
    ball = fi.Impactor("ball", at="tip", mass=3.4, gap=4e-3, contact=fi.Rigid(restitution=0.6))
    with pytest.warns(fi.InputWarning) as told:
        fi.assemble(replace(with_box(mass=23.0), impactors=(ball,)), elements=4)
    assert [str(one.message).split(" = ")[0] for one in told] == ["mass.box.mass", "impactor.ball.mass"]


def test_a_segment_is_named_and_one_wall_out_of_reach_may_be_meant():
    steel = fi.Segment(0.1, 210e9, 7850.0, 0.02, 1e-3, name="root piece")
    gauge = fi.Segment(0.1, 210e3, 7850.0, 0.02, 1e-3, name="tip piece")
    stop = fi.Stop("stop", at="tip", gap=(1e-3, 1.0), contact=fi.Rigid(restitution=0.6))
    with pytest.warns(fi.InputWarning) as told:
        fi.assemble(fi.Structure(fi.Beam((steel, gauge)), stops=[stop]), elements=4)
    assert [str(one.message).split(" = ")[0] for one in told] == ["beam.tip piece.young_modulus"]


@pytest.mark.parametrize(
    "structure",
    [
        beam(),
        with_ball(gap=0.0),
        # a sensor of half a kilogram on a strip of 12 g, with its centre beyond the tip
        with_box(mass=0.5, offset=0.1),
        # light foam, gold, diamond, polyethylene; a plate strip that is nearly as wide as it is long
        beam(young_modulus=2e8, density=20.0, width=0.2),
        beam(young_modulus=79e9, density=19300.0),
        beam(young_modulus=1.2e12, density=3515.0),
    ],
)
def test_a_usual_structure_is_taken_without_a_word(structure):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fi.assemble(structure, elements=4)
