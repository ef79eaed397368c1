"""Sections of segments, glued balls and numbers of numpy: nouns of a structure are what they were made of."""

from dataclasses import replace

import numpy as np
import pytest

import femimpact as fi

LAW = fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
SEGMENT = {"length": 0.2, "young_modulus": 70e9, "density": 2700.0, "width": 0.02, "thickness": 1e-3}
BEAM = fi.Beam.uniform(**SEGMENT)
BALL = {"name": "ball", "at": "tip", "mass": 3e-3, "gap": 4e-3, "contact": LAW}


def test_area_and_second_moment_are_a_rectangle():
    # b h and b h^3/12 of 20 mm x 1 mm
    one = fi.Segment(0.1, 7e10, 2700, 0.02, 1e-3)
    other = fi.Segment(0.1, 7e10, 2700, area=2e-5, second_moment=0.02 * 1e-9 / 12)
    # rounding of a square root
    assert other.rectangle == pytest.approx(one.rectangle, rel=1e-14)
    assert other.bending_stiffness == pytest.approx(7e10 * 0.02 * 1e-9 / 12, rel=1e-14)
    assert other.mass_per_length == pytest.approx(2700 * 2e-5, rel=1e-14)


def test_round_bars_and_tubes_have_the_area_and_the_second_moment_of_circles():
    bar = fi.Beam.round(length=0.5, diameter=0.02, young_modulus=7e10, density=2700)
    tube = fi.Beam.tube(length=0.5, diameter=0.02, wall=2e-3, young_modulus=7e10, density=2700)
    for beam, hole in ((bar, 0.0), (tube, 0.016)):
        assert beam.mass == pytest.approx(2700 * 0.5 * np.pi * (0.02**2 - hole**2) / 4, rel=1e-14)
        expected = 7e10 * np.pi * (0.02**4 - hole**4) / 64
        assert beam.segments[0].bending_stiffness == pytest.approx(expected, rel=1e-14)


def test_lists_become_tuples_and_nouns_are_values(reference):
    assert isinstance(reference.masses, tuple)
    assert fi.Rayleigh(ratio=[0.01, 0.02], modes=[1, 2]) == fi.Rayleigh(ratio=(0.01, 0.02), modes=(1, 2))
    assert fi.Impactor(**{**BALL, "gap": [1e-3, 2e-3]}).gaps == (1e-3, 2e-3)
    assert fi.Impactor(**BALL).gaps == (4e-3, 4e-3)
    assert replace(reference) == reference
    assert hash(reference) == hash(replace(reference))
    with pytest.raises(AttributeError):
        reference.beam = BEAM


def test_a_glued_ball_is_a_point_mass_at_its_place(reference):
    glued = fi.structure.glue_impactors(reference)
    assert glued.impactors == ()
    assert glued.masses == (*reference.masses, fi.PointMass("ball", "tip", 3.43e-3))
    heavier = fi.assemble(glued, elements=4).total_mass - fi.assemble(reference, elements=4).total_mass
    # rounding of a sum near 0.04 kg
    assert heavier == pytest.approx(3.43e-3, rel=1e-12)


def test_numpy_numbers_are_numbers():
    assert fi.Newmark(np.float64(1e-4)).dt == 1e-4
    assert fi.Recorder(every=np.int64(3)).every == 3
    assert fi.assemble(fi.Structure(BEAM), elements=np.int64(4)).dofs == 8
