"""Bad input is one clear line for each fault: key, value, unit and what is allowed."""

from dataclasses import replace

import numpy as np
import pytest

import femimpact as fi

LAW = fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
SEGMENT = {"length": 0.2, "young_modulus": 70e9, "density": 2700.0, "width": 0.02, "thickness": 1e-3}
BEAM = fi.Beam.uniform(**SEGMENT)
BALL = {"name": "ball", "at": "tip", "mass": 3e-3, "gap": 4e-3, "contact": LAW}
NOUNS = {
    "segment": (fi.Segment, SEGMENT),
    "mass": (fi.PointMass, {"name": "box", "at": "tip", "mass": 0.02}),
    "ball": (fi.Impactor, BALL),
    "support": (fi.Support, {"kind": "clamped", "at": "root"}),
    "rayleigh": (fi.Rayleigh, {"ratio": 0.01, "modes": (1, 2)}),
    "kelvin-voigt": (fi.KelvinVoigt, {"stiffness": 1e4, "restitution": 0.5}),
    "spring": (fi.SwitchingSpring, {"free_stiffness": 0.0, "stiffness": 1e3}),
    "sine": (fi.Sine, {"amplitude": 1e-3, "frequency": 5.0}),
    "newmark": (fi.Newmark, {"dt": 1e-4}),
    "recorder": (fi.Recorder, {}),
}

FAULTS = [
    # noun, key, value, unit, allowed
    ("segment", "length", 0.0, "m", "> 0"),
    ("segment", "length", float("nan"), "m", "a finite number > 0"),
    ("segment", "length", "0.2", "m", "a finite number > 0"),
    ("segment", "length", True, "m", "a finite number > 0"),
    ("segment", "young_modulus", -70e9, "Pa", "> 0"),
    ("segment", "density", 0, "kg/m^3", "> 0"),
    ("segment", "width", -0.02, "m", "> 0"),
    ("segment", "thickness", float("inf"), "m", "a finite number > 0"),
    ("mass", "mass", -1e-3, "kg", ">= 0"),
    ("mass", "mass", None, "kg", "a finite number"),
    ("mass", "rotary_inertia", -1e-9, "kg m^2", ">= 0"),
    ("mass", "at", -0.1, "", "metres from the root"),
    ("mass", "at", float("nan"), "", "metres from the root"),
    ("mass", "at", None, "", "metres from the root"),
    ("mass", "at", True, "", "metres from the root"),
    ("ball", "mass", 0.0, "kg", "> 0"),
    ("ball", "gap", -1e-3, "m", ">= 0"),
    ("ball", "gap", (1e-3, -1e-3), "m", ">= 0"),
    ("ball", "gap", (1e-3, 1e-3, 1e-3), "m", "one number or two"),
    ("ball", "gap", (), "m", ">= 0"),
    ("ball", "free_stiffness", -1.0, "N/m", ">= 0"),
    ("ball", "acceleration", float("inf"), "m/s^2", "a finite number"),
    ("ball", "contact", "steel", "", "must be a contact law"),
    ("ball", "at", -1e-3, "", "metres from the root"),
    ("support", "kind", "welded", "", "guided"),
    ("support", "at", -0.1, "", "metres from the root"),
    ("rayleigh", "ratio", -0.01, "", ">= 0 and < 1"),
    ("rayleigh", "ratio", 1.0, "", ">= 0 and < 1"),
    ("rayleigh", "ratio", (0.1, 0.1, 0.1), "", "one number or two"),
    ("rayleigh", "modes", (0, 1), "", "a whole number >= 1"),
    ("rayleigh", "modes", (1, 1), "", "two different values"),
    ("rayleigh", "modes", (1, 2, 3), "", "two different values"),
    ("rayleigh", "modes", (1, 2.5), "", "a whole number >= 1"),
    ("kelvin-voigt", "stiffness", 0.0, "N/m", "> 0"),
    ("kelvin-voigt", "restitution", 0.0, "", "> 0 and <= 1"),
    ("kelvin-voigt", "restitution", 1.2, "", "> 0 and <= 1"),
    ("spring", "stiffness", 0.0, "N/m", "> 0"),
    ("spring", "free_stiffness", -1.0, "N/m", ">= 0"),
    ("sine", "amplitude", -1e-3, "m", ">= 0"),
    ("sine", "frequency", 0.0, "Hz", "> 0"),
    ("sine", "phase", float("nan"), "rad", "a finite number"),
    ("newmark", "dt", 0.0, "s", "> 0"),
    ("newmark", "beta", 0.6, "", ">= 0 and <= 0.5"),
    ("newmark", "gamma", 0.4, "", ">= 0.5 and <= 1"),
    ("newmark", "divergence_limit", 1.0, "", "> 1"),
    ("recorder", "every", 0, "steps", "a whole number >= 1"),
    ("recorder", "every", 2.5, "steps", "a whole number >= 1"),
    ("recorder", "start", -1.0, "s", ">= 0"),
    ("recorder", "snapshots", -1, "steps", "a whole number >= 0"),
    ("recorder", "snapshots_start", -1.0, "s", ">= 0"),
    ("recorder", "impacts", -1, "", "a whole number >= 0"),
    ("recorder", "memory_limit", 0.0, "bytes", "> 0"),
]


@pytest.mark.parametrize(("noun", "key", "value", "unit", "allowed"), FAULTS)
def test_a_value_out_of_range_is_one_line_with_key_value_unit_and_range(noun, key, value, unit, allowed):
    kind, good = NOUNS[noun]
    kind(**good)
    with pytest.raises(fi.InputError) as caught:
        kind(**{**good, key: value})
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(key)
    if value is not None:
        assert f"{key} = {value!r}{' ' + unit if unit else ''}: " in message
    assert allowed in message.partition(": ")[2]
    assert len(caught.value.faults) == 1
    assert isinstance(caught.value, ValueError)
    assert isinstance(caught.value, fi.FemimpactError)


def test_several_faults_are_all_listed_a_line_each():
    with pytest.raises(fi.InputError) as caught:
        fi.Segment(length=-1.0, young_modulus=0.0, density=-2.0, width=0.02)
    lines = str(caught.value).splitlines()
    assert [line.split()[0] for line in lines] == ["length", "young_modulus", "density", "section"]
    with pytest.raises(fi.InputError) as caught:
        fi.Newmark(dt=-1.0, beta=9.0, gamma=0.0)
    assert [fault.key for fault in caught.value.faults] == ["dt", "beta", "gamma"]


@pytest.mark.parametrize(
    "section",
    [
        {},
        {"width": 0.02},
        {"area": 1e-5},
        {"width": 0.02, "area": 1e-5},
        {"width": 0.02, "thickness": 1e-3, "area": 2e-5, "second_moment": 1e-12},
        {"wall": 1e-3},
        {"diameter": 0.02, "width": 0.02},
        {"diameter": 0.02, "outer_fibre": 0.01},
        {"width": 0.02, "thickness": 1e-3, "outer_fibre": 5e-4},
        {"area": 2e-5, "outer_fibre": 5e-4},
    ],
)
def test_a_section_is_given_one_way(section):
    with pytest.raises(fi.InputError, match="give width and thickness"):
        fi.Segment(length=0.1, young_modulus=7e10, density=2700, **section)


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


@pytest.mark.parametrize(
    ("section", "words"),
    [
        ({"diameter": 0.02, "wall": 0.01}, r"wall = 0\.01 m: must be below half the diameter, 0\.01 m"),
        ({"diameter": 0.02, "end_width": 0.01}, r"end_width = 0\.01 m: .*given by diameter does not taper"),
        ({"diameter": -0.02}, r"diameter = -0\.02 m: must be a finite number > 0 m"),
        ({"area": 2e-5, "second_moment": 1e-12, "outer_fibre": 0.0}, r"outer_fibre = 0\.0 m: must be a finite number"),
    ],
)
def test_bars_and_tubes_that_cannot_be_are_refused(section, words):
    with pytest.raises(fi.InputError, match=words):
        fi.Segment(length=0.1, young_modulus=7e10, density=2700, **section)


def test_places_beyond_the_beam_are_all_named():
    with pytest.raises(fi.InputError) as caught:
        fi.Structure(
            BEAM,
            masses=[fi.PointMass("box", 0.25, 0.02), fi.PointMass("in", 0.2, 0.02)],
            impactors=[fi.Impactor(**{**BALL, "at": 0.3})],
            supports=[fi.Support("clamped", "root"), fi.Support("pinned", 9.0)],
        )
    lines = str(caught.value).splitlines()
    assert [line.split(" =")[0] for line in lines] == ["mass.box.at", "impactor.ball.at", "support.pinned.at"]
    assert all("must be within the beam, 0 to 0.2 m" in line for line in lines)


@pytest.mark.parametrize(
    "supports",
    [
        [],
        [fi.Support("pinned", "root")],
        [fi.Support("guided", "root")],
        [fi.Support("guided", "root"), fi.Support("guided", "tip")],
        [fi.Support("pinned", "root"), fi.Support("pinned", "root")],
        [fi.Support("pinned", "root"), fi.Support("pinned", 0.0)],
        [fi.Support("pinned", "tip"), fi.Support("pinned", 0.2)],
        [fi.Support("pinned", "mid"), fi.Support("pinned", 0.1)],
    ],
)
def test_a_structure_that_can_move_as_a_rigid_body_is_refused(supports):
    with pytest.raises(fi.InputError, match="must hold the beam"):
        fi.Structure(BEAM, supports=supports)


def test_names_are_distinct_among_masses_impactors_and_segments():
    with pytest.raises(fi.InputError, match="distinct among masses, impactors, stops, springs, dashpots and absorbers"):
        fi.Structure(BEAM, masses=[fi.PointMass("ball", "tip", 0.1)], impactors=[fi.Impactor(**BALL)])
    with pytest.raises(fi.InputError, match="must have distinct names"):
        fi.Beam((fi.Segment(**SEGMENT), fi.Segment(**SEGMENT)))
    with pytest.raises(fi.InputError, match="must hold at least one segment"):
        fi.Beam(())


@pytest.mark.parametrize("name", ["tip", "root", "mid"])
def test_a_ball_named_like_a_place_is_refused(name):
    # a channel of that name would be the place's, and the ball's history would be lost without a word
    with pytest.raises(fi.InputError):
        fi.assemble(fi.Structure(BEAM, impactors=[fi.Impactor(**{**BALL, "name": name})]), elements=4)


def test_a_place_that_no_mesh_gives_is_named():
    structure = fi.Structure(BEAM, masses=[fi.PointMass("box", "tipp", 0.02)])
    with pytest.raises(fi.InputError, match=r"box\.at = 'tipp': must be one of root, tip, mid, or metres"):
        fi.assemble(structure, elements=4)
    with pytest.raises(fi.InputError, match=r"mass\.box\.at = 'tipp': unknown; did you mean 'tip'\?"):
        fi.assemble(structure, mesh=fi.Mesh(np.linspace(0.0, 0.2, 5)))


def test_the_known_places_of_a_mesh_are_those_that_mend_the_fault():
    # the body that is to be placed is no place for itself; for another item it is one
    lamp, mesh = fi.PointMass("lamp", "mid", 0.01), fi.Mesh(np.linspace(0.0, 0.2, 5))
    boxed = fi.Structure(BEAM, masses=[fi.PointMass("box", "pocket", 0.02), lamp])
    with pytest.raises(fi.InputError, match=r"unknown; known: lamp, mid, root, tip; .*physical point .*\.vtu$"):
        fi.assemble(boxed, mesh=mesh)
    balled = fi.Structure(BEAM, masses=[lamp], impactors=[fi.Impactor(**{**BALL, "at": "pocket"})])
    with pytest.raises(fi.InputError, match=r"ball\.at = 'pocket': unknown; known: lamp, mid, root, tip; "):
        fi.assemble(balled, mesh=mesh)


def test_a_support_off_the_nodes_is_refused():
    structure = fi.Structure(BEAM, supports=[fi.Support("clamped", "root"), fi.Support("pinned", 0.06)])
    with pytest.raises(fi.InputError, match=r"support\.at = 0\.06: must be a node of the mesh"):
        fi.assemble(structure, mesh=fi.Mesh(np.linspace(0.0, 0.2, 5)))


@pytest.mark.parametrize("given", [{}, {"elements": 4, "mesh": fi.Mesh(np.linspace(0.0, 0.2, 5))}])
def test_assemble_takes_elements_or_a_mesh(given):
    with pytest.raises(fi.InputError, match="give either elements"):
        fi.assemble(fi.Structure(BEAM), **given)


def test_damping_modes_beyond_the_mesh_ask_for_more_elements():
    structure = fi.Structure(BEAM, damping=fi.Rayleigh(ratio=0.01, modes=(1, 5)))
    with pytest.raises(fi.InputError, match=r"damping\.modes = \(1, 5\): must be at most 4, .*more elements"):
        fi.assemble(structure, elements=2)


@pytest.mark.parametrize("modes", [0, 1000, 2.5, True])
def test_reduce_takes_one_to_all_modes(small, modes):
    with pytest.raises(fi.InputError, match="must be a whole number from 1 to 8"):
        fi.reduce(small, modes=modes)


def test_rayleigh_takes_modes_or_frequencies():
    for given in ({}, {"modes": (1, 2), "frequencies": (5.0, 50.0)}):
        with pytest.raises(fi.InputError, match="give either two modes"):
            fi.Rayleigh(ratio=0.01, **given)


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
    glued = fi.glue_impactors(reference)
    assert glued.impactors == ()
    assert glued.masses == (*reference.masses, fi.PointMass("ball", "tip", 3.43e-3))
    heavier = fi.assemble(glued, elements=4).total_mass - fi.assemble(reference, elements=4).total_mass
    # rounding of a sum near 0.04 kg
    assert heavier == pytest.approx(3.43e-3, rel=1e-12)


def test_numpy_numbers_are_numbers():
    assert fi.Newmark(np.float64(1e-4)).dt == 1e-4
    assert fi.Recorder(every=np.int64(3)).every == 3
    assert fi.assemble(fi.Structure(BEAM), elements=np.int64(4)).dofs == 8
