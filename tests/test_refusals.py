"""Bad input is one clear line for each fault: key, value, unit and what is allowed."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from builders import build, load_study, oscillator, paper_study_text, prepare, read_study
from nouns import BASE, NOUNS, STRUCTURE, response, small, system

import femimpact as fi
from femimpact import vtk

BEAM, SECTION = STRUCTURE.beam, STRUCTURE.beam.segments[0]
EXACT, STEPPED, SINE = fi.EventDriven(), fi.Newmark(2e-4), fi.Sine(1e-4, 5.0)
BALL, RIGID = STRUCTURE.impactors[0], fi.Rigid(0.8)
MESH = fi.fem.Mesh(np.linspace(0.0, 0.2, 5))
BARE = fi.Structure(BEAM)
MATERIAL = {"young_modulus": 70e9, "density": 2700.0}
MORE_NOUNS = {
    "Segment": lambda: SECTION,
    "Rayleigh": lambda: fi.Rayleigh(0.01, modes=(1, 2)),
    "KelvinVoigt": lambda: fi.KelvinVoigt(stiffness=1e4, restitution=0.5),
}
"""In place of those of `NOUNS`, whose other fields would be at fault too."""


def resting() -> fi.app.Study:
    """A study whose base is at rest."""
    head, _, rest = paper_study_text().partition("[base]")
    text = head + '[base]\nkind = "rest"\nhistory = 2.0\n[' + rest.partition("\n[")[2]
    return read_study(text.partition("[sweep]")[0], Path("study.toml"))


def channels_of(*recorded: str):
    """Pictures of channels of a run that are none, or zero throughout as the force of rigid impacts."""
    run = fi.integrate(small(), SINE, EXACT, 0.2, fi.Recorder(recorded))
    return fi.figures.channels(run)


FIELDS = [
    # noun, field, value, unit, allowed
    ("Segment", "length", 0.0, "m", "> 0"),
    ("Segment", "length", "0.2", "m", "a finite number > 0"),
    ("Segment", "length", True, "m", "a finite number > 0"),
    ("Segment", "young_modulus", -70e9, "Pa", "> 0"),
    ("Segment", "width", -0.02, "m", "> 0"),
    ("Segment", "width", (4e-3, 2e-3), "m", "must be one number: the other end of a tapered Segment is end_width"),
    ("Segment", "thickness", math.inf, "m", "a finite number > 0"),
    ("PointMass", "mass", -1e-3, "kg", ">= 0"),
    ("PointMass", "mass", None, "kg", "a finite number"),
    ("PointMass", "rotary_inertia", -1e-9, "kg m^2", ">= 0"),
    *(("PointMass", "at", at, "", "metres from the root") for at in (-0.1, math.nan, None, True)),
    ("Impactor", "mass", 0.0, "kg", "> 0"),
    ("Impactor", "gap", -1e-3, "m", ">= 0"),
    ("Impactor", "gap", (1e-3, -1e-3), "m", ">= 0"),
    ("Impactor", "gap", (1e-3, 1e-3, 1e-3), "m", "one number or two"),
    ("Impactor", "free_stiffness", -1.0, "N/m", ">= 0"),
    ("Impactor", "acceleration", math.inf, "m/s^2", "a finite number"),
    ("Impactor", "contact", "steel", "", "must be a contact law"),
    ("Stop", "fixed_to", "moon", "", "must be 'base' or 'space'"),
    ("Support", "kind", "welded", "", "guided"),
    ("Spring", "to", "mid", "", "must be another place"),
    ("Rayleigh", "ratio", -0.01, "", ">= 0 and < 1"),
    ("Rayleigh", "ratio", 1.0, "", ">= 0 and < 1"),
    ("Rayleigh", "ratio", (0.1, 0.1, 0.1), "", "one number or two"),
    ("Rayleigh", "modes", (0, 1), "", "a whole number >= 1"),
    ("Rayleigh", "modes", (1, 1), "", "two different values"),
    ("Rayleigh", "modes", (1, 2, 3), "", "two different values"),
    ("Rayleigh", "modes", (1, 2.5), "", "a whole number >= 1"),
    ("KelvinVoigt", "stiffness", 0.0, "N/m", "> 0"),
    ("KelvinVoigt", "restitution", 0.0, "", "> 0 and <= 1"),
    ("KelvinVoigt", "restitution", 1.2, "", "> 0 and <= 1"),
    ("SwitchingSpring", "stiffness", 0.0, "N/m", "> 0"),
    ("Sine", "amplitude", -1e-3, "m", ">= 0"),
    ("Sine", "frequency", 0.0, "Hz", "> 0"),
    ("Sine", "phase", math.nan, "rad", "a finite number"),
    ("Newmark", "dt", 0.0, "s", "> 0"),
    ("Newmark", "beta", 0.6, "", ">= 0 and <= 0.5"),
    ("Newmark", "gamma", 0.4, "", ">= 0.5 and <= 1"),
    ("Newmark", "divergence_limit", 1.0, "", "> 1"),
    ("Recorder", "every", 0, "steps", "a whole number >= 1"),
    ("Recorder", "every", 2.5, "steps", "a whole number >= 1"),
    ("Recorder", "interval", 0.0, "s", "a finite number > 0 s"),
    ("Recorder", "start", -1.0, "s", ">= 0"),
    ("Recorder", "snapshots", -1, "steps", "a whole number >= 0"),
    ("Recorder", "snapshots_start", -1.0, "s", ">= 0"),
    ("Recorder", "impacts", -1, "", "a whole number >= 0"),
    *(
        ("Recorder", "events", bad, "", "must be a whole number >= 0")
        for bad in (-1, 1.5, math.nan, "many", True, None)
    ),
    ("Recorder", "memory_limit", 0.0, "bytes", "> 0"),
    ("State", "time", -1.0, "s", ">= 0"),
]


@pytest.mark.parametrize(("noun", "key", "value", "unit", "allowed"), FIELDS)
def test_a_value_out_of_range_is_one_line_with_key_value_unit_and_range(noun, key, value, unit, allowed):
    good = MORE_NOUNS.get(noun, NOUNS[noun])()
    with pytest.raises(fi.InputError) as caught:
        replace(good, **{key: value})
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
    with pytest.raises(fi.InputError) as caught:
        fi.Structure(
            BEAM,
            masses=[fi.PointMass("box", 0.25, 0.02), fi.PointMass("in", 0.2, 0.02)],
            impactors=[replace(BALL, at=0.3)],
            supports=[fi.Support("clamped", "root"), fi.Support("pinned", 9.0)],
        )
    lines = str(caught.value).splitlines()
    assert [line.split(" =")[0] for line in lines] == ["mass.box.at", "impactor.ball.at", "support.pinned.at"]
    assert all("must be within the beam, 0 to 0.2 m" in line for line in lines)


def section(**given):
    return fi.Segment(length=0.1, **MATERIAL, **given)


def placed(**parts):
    """A structure of the beam and these parts, on four elements."""
    return fi.assemble(fi.Structure(BEAM, **parts), elements=4)


def run(channels=("tip",), method=EXACT, of=None, base=SINE, duration=0.1, initial=None, **record):
    return fi.integrate(of or small(), base, method, duration, fi.Recorder(channels, **record), initial)


def pinned(channel):
    """A call that reads a channel of a beam on a pin and a spring."""
    supports, springs = [fi.Support("pinned", "root")], [fi.Spring("front", 0.1, 1e5)]
    return lambda: run((channel,), STEPPED, of=placed(supports=supports, springs=springs))


def free(**parts):
    """Two bodies of 1 kg that nothing holds."""
    matrices = np.eye(2), np.zeros((2, 2)), [[1.0, -1.0], [-1.0, 1.0]]
    return fi.System.from_matrices(*matrices, points={"a": [1.0, 0.0]}, **parts)


def hertzian():
    return oscillator(impactors=[fi.Impactor("ball", "mass", 0.1, 1.0, fi.Hertz(stiffness=1e3))])


def study(*changes):
    """The paper's study with parts of its text replaced."""
    text = paper_study_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return read_study(text, Path("study.toml"))


def swept(**given):
    return fi.frequency_sweep(fi.without_impactors(small()), 1e-4, [4.0, 4.6], STEPPED, **given)


FLAT = ((20.0, 1.0), (200.0, 1.0))
CHIRP = NOUNS["Chirp"]()
FIVE = [5.0, 5.1, 5.2, 5.3, 5.4]

CALLS = [
    # structures
    *(
        ("give width and thickness", partial(section, **given))
        for given in (
            {},
            {"width": 0.02},
            {"area": 1e-5},
            {"width": 0.02, "area": 1e-5},
            {"wall": 1e-3},
            {"width": 0.02, "thickness": 1e-3, "area": 2e-5, "second_moment": 1e-12},
            {"diameter": 0.02, "width": 0.02},
            {"diameter": 0.02, "outer_fibre": 0.01},
            {"width": 0.02, "thickness": 1e-3, "outer_fibre": 5e-4},
            {"area": 2e-5, "outer_fibre": 5e-4},
        )
    ),
    (r"wall = 0\.01 m: must be below half the diameter, 0\.01 m", lambda: section(diameter=0.02, wall=0.01)),
    (r"end_width = 0\.01 m: .*given by diameter does not taper", lambda: section(diameter=0.02, end_width=0.01)),
    (r"diameter = -0\.02 m: must be a finite number > 0 m", lambda: section(diameter=-0.02)),
    (
        r"outer_fibre = 0\.0 m: must be a finite number",
        lambda: section(area=2e-5, second_moment=1e-12, outer_fibre=0.0),
    ),
    *(
        (
            rf"^{name} = .* m: must be one number: .* is end_{name}$",
            partial(fi.Beam.uniform, **{"length": 0.3, "width": 0.02, "thickness": 4e-3, **MATERIAL, name: pair}),
        )
        for name in ("width", "thickness")
        for pair in ((4e-3, 2e-3), [4e-3, 2e-3])
    ),
    *(
        ("must hold the beam", partial(fi.Structure, BEAM, supports=[fi.Support(*each) for each in supports]))
        for supports in (
            [("pinned", "root")],
            [("guided", "root")],
            [("guided", "root"), ("guided", "tip")],
            [("pinned", "root"), ("pinned", "root")],
            [("pinned", "root"), ("pinned", 0.0)],
            [("pinned", "tip"), ("pinned", 0.2)],
            [("pinned", "mid"), ("pinned", 0.1)],
        )
    ),
    (
        "distinct among masses, impactors, stops, springs, dashpots, absorbers and meetings",
        lambda: fi.Structure(BEAM, masses=[fi.PointMass("ball", "tip", 0.1)], impactors=[BALL]),
    ),
    ("must be distinct", lambda: fi.Structure(BEAM, springs=[fi.Spring("one", x, 1.0) for x in (0.1, 0.2)])),
    ("must have distinct names", lambda: fi.Beam((SECTION, SECTION))),
    ("must hold at least one segment", lambda: fi.Beam(())),
    (
        r"spring\.far\.at = 0\.41 m: must be within the beam",
        lambda: fi.Structure(BEAM, springs=[fi.Spring("far", 0.41, 1.0)]),
    ),
    (
        r"dashpot\.far\.to = 0\.5 m: must be within the beam",
        lambda: fi.Structure(BEAM, dashpots=[fi.Dashpot("far", 0.1, 1.0, to=0.5)]),
    ),
    *(
        ("give either two modes", partial(fi.Rayleigh, ratio=0.01, **given))
        for given in ({}, {"modes": (1, 2), "frequencies": (5.0, 50.0)})
    ),
    # places
    (r"spring\.spring\.at = 'sensor': unknown", lambda: placed(springs=[fi.Spring("spring", "sensor", 1.0)])),
    *((r"mass\.box\.at = ", partial(placed, masses=[fi.PointMass("box", at, 0.02)])) for at in ("box", "bax")),
    (
        r"impactor\.ball\.at = 'midbax': must be one of .*midbox",
        lambda: placed(masses=[fi.PointMass("midbox", "mid", 0.02)], impactors=[replace(BALL, at="midbax")]),
    ),
    # a channel of that name would be the place's, and the ball's history would be lost without a word
    *((f"'{name}'", partial(placed, impactors=[replace(BALL, name=name)])) for name in ("tip", "root", "mid")),
    (
        r"box\.at = 'tipp': must be one of root, tip, mid, or metres",
        lambda: placed(masses=[fi.PointMass("box", "tipp", 0.02)]),
    ),
    (
        r"mass\.box\.at = 'tipp': unknown; did you mean 'tip'\?",
        lambda: fi.assemble(fi.Structure(BEAM, masses=[fi.PointMass("box", "tipp", 0.02)]), mesh=MESH),
    ),
    # the body that is to be placed is no place for itself; for another item it is one
    (
        r"unknown; known: lamp, mid, root, tip; .*physical point .*\.vtu$",
        lambda: fi.assemble(
            fi.Structure(BEAM, masses=[fi.PointMass("box", "pocket", 0.02), fi.PointMass("lamp", "mid", 0.01)]),
            mesh=MESH,
        ),
    ),
    (
        r"ball\.at = 'pocket': unknown; known: lamp, mid, root, tip; ",
        lambda: fi.assemble(
            fi.Structure(BEAM, masses=[fi.PointMass("lamp", "mid", 0.01)], impactors=[replace(BALL, at="pocket")]),
            mesh=MESH,
        ),
    ),
    (
        r"support\.at = 0\.06: must be a node of the mesh",
        lambda: fi.assemble(
            fi.Structure(BEAM, supports=[fi.Support("clamped", "root"), fi.Support("pinned", 0.06)]), mesh=MESH
        ),
    ),
    # systems
    ("give either elements", lambda: fi.assemble(BARE)),
    ("give either elements", lambda: fi.assemble(BARE, elements=4, mesh=MESH)),
    ("give either elements", lambda: fi.fem.discretise(BARE)),
    (
        r"damping\.modes = \(1, 5\): must be at most 4, .*more elements",
        lambda: fi.assemble(fi.Structure(BEAM, damping=fi.Rayleigh(0.01, modes=(1, 5))), elements=2),
    ),
    (
        r"damping\.ratios = .* must be at most 4, the dofs of this mesh",
        lambda: fi.assemble(fi.Structure(BEAM, damping=fi.ModalDamping((0.01,) * 5)), elements=2),
    ),
    *(
        ("a negative one feeds energy in", partial(placed, damping=fi.Rayleigh(ratio, modes=(1, 2))))
        for ratio in ((0.001, 0.5), (0.5, 0.001))
    ),
    *(("must be a whole number from 1 to 8", lambda n=n: fi.reduce(placed(), n)) for n in (0, 1000, 2.5, True)),
    *(("must be a whole number from 1 to 8", lambda n=n: fi.solve_modes(placed(), n)) for n in (0, -1, 1.5, True, 9)),
    # the cubic of the last element goes on, but the beam does not
    *(
        (
            r"positions.* m: must be within the beam, 0 to 0\.2 m",
            lambda x=x, derivative=derivative: placed().deflection_rows(x, derivative),
        )
        for x in (-0.01, 0.24, math.nan, [0.1, 0.24], np.ma.array([0.1, 0.2], mask=[0, 1]))
        for derivative in range(4)
    ),
    (
        r"static_correction",
        lambda: fi.reduce(free(impactors=[fi.Impactor("ball", "a", 0.1, 1.0, RIGID)]), 1, static_correction=True),
    ),
    *(
        (words, lambda terms=terms: fi.system.add_terms(placed(), **terms))
        for terms, words in (
            ({"stiffness": np.eye(7)}, r"stiffness = \(7, 7\): must have the shape \(10, 10\)"),
            ({"mass": np.triu(np.ones((10, 10)))}, "mass = 1.0: must be symmetric"),
            ({"mass": -1e3 * np.eye(10)}, "mass: must leave the mass matrix positive definite"),
            ({"damping": -1e3 * np.eye(10)}, "C: must be positive semidefinite"),
            ({"load": np.ones(8)}, "load = .*must hold 10 finite numbers"),
        )
    ),
    *(
        ("add terms before reduce", lambda of=of: fi.system.add_terms(of(), load=np.ones(10)))
        for of in (small, lambda: oscillator(4.0))
    ),
    (
        r"^mesh\.regions\.thick = '2 elements': must be one row of neighbouring",
        lambda: fi.fem.discretise(
            fi.Structure(
                fi.Beam(
                    (
                        replace(SECTION, length=0.08, name="thick", end_width=0.01),
                        replace(SECTION, length=0.12, name="thin"),
                    )
                )
            ),
            mesh=fi.fem.Mesh(np.linspace(0.0, 0.2, 6), regions={"thick": [0, 3], "thin": [1, 2, 4]}),
        ),
    ),
    # contacts
    *(
        ("give exactly one pair", partial(fi.KelvinVoigt, **given))
        for given in (
            {},
            {"stiffness": 1e4},
            {"restitution": 0.5},
            {"contact_time": 1e-3},
            {"damping": 1.0, "restitution": 0.5},
            {"damping": 1.0, "contact_time": 1e-3},
            {"stiffness": 1e4, "contact_time": 1e-3},
            {"stiffness": 1e4, "damping": 1.0, "restitution": 0.5},
            {"stiffness": 1e4, "damping": 1.0, "restitution": 0.5, "contact_time": 1e-3},
        )
    ),
    *(
        (
            r"^contact_time = .* s: must give a contact .* with an effective_mass of 0\.003 kg",
            lambda time=time, call=call: call(fi.KelvinVoigt(restitution=0.6, contact_time=time)),
        )
        for time in (1e29, 1e-29)
        for call in (
            lambda law: fi.collide(law, 3e-3, 0.2),
            lambda law: fi.contact.contact_force(law, 1e-4, 0.0, 0.2, 3e-3),
        )
    ),
    # half a period of 3 g on a spring of 100 N/m is 18 ms; 10^7 steps of 1 ns are 10 ms
    (
        r"method\.dt = 1e-09 s: must let a collision of .* end",
        lambda: fi.integrators.achieved_restitution(
            placed(impactors=[replace(BALL, contact=fi.KelvinVoigt(stiffness=100.0, damping=0.0))]).contacts[0],
            fi.Newmark(1e-9),
            0.1,
            phases=1,
        ),
    ),
    (
        "contact = 'switching-spring': must be another law for a preloaded stop",
        lambda: fi.Stop("wall", "tip", (-1e-4, 1.0), fi.contact.SwitchingSpring(1.0, 1e4)),
    ),
    (
        "contact = 'switching-spring': must be another law for a preloaded stop",
        lambda: replace(
            placed(stops=[fi.Stop("wall", "tip", 1e-3, fi.contact.SwitchingSpring(1.0, 1e4))]).contacts[0],
            gaps=(-1e-4, 1.0),
        ),
    ),
    (r"gaps = .*: must be two numbers >= 0", lambda: replace(system().contacts[0], gaps=(-1e-4, 1e-3))),
    ("fixed_to = 'space': must be 'base' for a ball", lambda: replace(system().contacts[0], fixed_to="space")),
    (
        r"ball.contact = 'hunt-crossley': must be Rigid or KelvinVoigt",
        lambda: run(of=fi.reduce(placed(impactors=[replace(BALL, contact=fi.HuntCrossley(1e6, 0.6))]), 2)),
    ),
    (r"ball.contact = 'hertz': must be Rigid or KelvinVoigt", lambda: run("mass", of=hertzian())),
    # excitations
    *(
        (f"{words}: must give at most 2,000,000 cycles in all", call)
        for words, call in {
            "cycles = 2003520714822": lambda: fi.SteppedSine([4.0, 5.0], 2003520714822, amplitude=1e-3),
            "seconds = 1000000.0 s": lambda: fi.SteppedSine([4.0, 5.0], seconds=1e6, amplitude=1e-3),
            "duration = 100.0 s": lambda: fi.Chirp(1.0, 5e7, 100.0, amplitude=1e-3),
        }.items()
    ),
    ("nowhere", lambda: run(base=BASE + fi.HammerBlow("nowhere", 0.1, 1e-3))),
    # runs
    (r"must be on its normal modes for EventDriven: use reduce", lambda: run(of=placed())),
    (
        "undamped mode",
        lambda: run("mass", of=oscillator(), base=fi.Sine(1e-4, 1.0 / (2.0 * math.pi)), duration=1.0),
    ),
    *(
        (r"duration = .* must be a finite number >= one step", partial(run, method=STEPPED, duration=duration))
        for duration in (0.0, -1.0, 1e-5, math.nan, math.inf, "1")
    ),
    *(
        (field, partial(run, method=STEPPED, initial=fi.State(**{field: values})))
        for field, values in {
            "displacement": [0.0],
            "velocity": np.zeros(9),
            "ball_velocity": [0.0, 0.0],
            "ball_displacement": [0.1, 0.1],
        }.items()
    ),
    ("ball_displacement", lambda: fi.State(ball_displacement=[math.nan])),
    *(
        (
            r"initial\.ball\.gap.*must start between its walls.* it is ball_displacement of State less the beam's disp",
            lambda place=place: run(
                method=fi.MoreauJean(1e-4),
                of=fi.reduce(placed(impactors=[replace(BALL, contact=RIGID)]), 4),
                initial=fi.State(ball_displacement=[place]),
            ),
        )
        for place in (1.1e-3, -1.1e-3)
    ),
    ("must be 'base' or 'space'", lambda: fi.State.at_rest("moon")),
    (r"^mass = '3\.4 g' kg: .*: a number in SI units, .* study files$", lambda: fi.PointMass("box", "tip", "3.4 g")),
    (r"^gap = '4 mm' m: .*study files$", lambda: replace(BALL, gap="4 mm")),
    # a word is no number with a unit
    (r"^mass = 'heavy' kg: must be a finite number >= 0 and <= 1e\+30 kg$", lambda: fi.PointMass("a", "tip", "heavy")),
    (r"^length, width: a Beam has segments; Beam\.uniform", lambda: fi.Beam(length=0.2, width=0.02)),
    (
        r"^pair = 'Impactor': must be a ContactPair, one of those in system\.contacts$",
        lambda: fi.integrators.achieved_restitution(BALL, STEPPED, 0.1),
    ),
    (
        r"^axes\.impactor\.ball\.gap = \[0\.001, 0\.002, 0\.003\]: must be \(low, high\).*: a list.*worst_over$",
        lambda: fi.refine(
            placed(), "peak", {"impactor.ball.gap": [1e-3, 2e-3, 3e-3]}, worst_over=(), excitation=fi.Sine(1e-4, 5.0)
        ),
    ),
    ("must be held", lambda: fi.State.under_force(free(), 1.0)),
    *(
        (
            r"^record\.interval = 0\.001 s: is for EventDriven.*`every`",
            partial(
                run, method=method, of=fi.without_impactors(oscillator(1.0, 0.1)), channels=("mass",), interval=1e-3
            ),
        )
        for method in (fi.Newmark(1e-4), fi.MoreauJean(1e-4))
    ),
    (
        r"^record\.interval = 0\.05 s: must be <= 0\.025 s, 8 readings in a cycle",
        lambda: run(interval=0.05, duration=1.0),
    ),
    (r"^record\.events.*finds no events.*EventDriven$", lambda: run(method=STEPPED, events=10)),
    (r"^record\.memory_limit.*events \d+ MB", lambda: run(events=10**9)),
    # channels
    *(
        (words, partial(run, (name,)))
        for name, words in (
            ("tipp.velocity", r"did you mean 'tip'"),
            ("tip.velocty", r"unknown; did you mean 'tip\.velocity'"),
            ("tip.gap", r"unknown.*tip\.rotation"),
            ("ball.rotation", r"unknown.*ball\.gap"),
            ("", r"unknown"),
            ("tip.reaction_force", r"no such reaction.*known: root\.reaction_force, root\.reaction_moment$"),
            ("0.1.reaction_moment", r"no such reaction.*known: root\.reaction_force, root\.reaction_moment$"),
            ("root.force", r"unknown; did you mean 'root\.reaction_force'\?$"),
        )
    ),
    (
        r"no such reaction: the support there has no moment; take 'root\.reaction_force'$",
        pinned("root.reaction_moment"),
    ),
    *(
        (rf"'front\.{read}': is the force of a spring or dashpot, no channel: take displ", pinned(f"front.{read}"))
        for read in ("force", "reaction_force")
    ),
    (r"channels = 'tpi'", lambda: run().largest("tpi")),
    (r"largest: must be a response of `integrate`", lambda: replace(run(), largest_values=None).largest("tip")),
    (r"channel = 'tpi': unknown; did you mean 'tip'\? known: tip", lambda: run()["tpi"]),
    ("known: tip", lambda: run()["ball"]),
    *(
        ("must be a relative displacement, velocity or acceleration", lambda name=name: run((name,)).absolute(name))
        for name in ("ball.gap", "ball.contact_force")
    ),
    (
        "was not recorded",
        lambda: fi.Laser("mid", range=1.0).measure(run("mid", sink=lambda piece: None)),
    ),
    (r"Recorder\.sink", lambda: run(method=STEPPED, sink=lambda piece: None).to_pandas()),
    # sweeps, curves and convergence
    *(
        (words, partial(swept, **given))
        for given, words in (
            ({}, "give either cycles"),
            ({"cycles": 24, "duration": 6.0}, "give either cycles"),
            ({"cycles": 24, "window": 2.0}, "window = 2.0 s: goes with a duration"),
            ({"duration": 0.1}, "duration = 0.1 s"),
            ({"duration": 6.0, "window": 7.0}, "window = 7.0 s"),
            ({"duration": 6.1, "window": 0.3}, "window = 0.3 s: must hold a whole base cycle"),
            ({"duration": 10.0, "window": 5.0, "direction": "up"}, r"window = .* at most a third"),
        )
    ),
    *(
        (
            rf"amplitude = '{type(drive).__name__}': a sweep moves the base: .* axis force\.NAME\.frequency$",
            partial(fi.frequency_sweep, small(), drive, [4.0, 4.6], EXACT, cycles=24),
        )
        for drive in (fi.PointForce("tip", SINE), SINE + fi.PointForce("tip", SINE))
    ),
    (
        r"excitation = 'PointForce': must be a Sine of the base; under a force integrate on each number of modes$",
        lambda: fi.convergence.mode_convergence(small(), fi.PointForce("tip", SINE), EXACT, 2.0, [2, 3, 4]),
    ),
    *(
        (words, partial(estimator, frequency, amplitude))
        for estimator in (fi.fit_one_pole, fi.signals.half_power)
        for frequency, amplitude, words in (
            ([5.0, 5.1], [1.0, 2.0], "must hold at least"),
            ([5.0, 5.1, 5.2, 5.3, np.nan], [1.0, np.nan, np.inf, 1.0, 1.0], "must hold at least"),
            ([5.0, 5.1, 5.1, 5.2, 5.3], [1.0, 2.0, 2.0, 1.0, 0.5], "must not repeat"),
            (FIVE, [1.0, 2.0, 3.0], "must be as long as frequency"),
            (FIVE, [0.0, 0.0, 0.0, 0.0, 0.0], "not all zero"),
            (FIVE, [1.0, 2.0, -3.0, 1.0, 1.0], "must be >= 0"),
        )
    ),
    (
        r"^frequency = 1\.0 Hz: must not be a natural frequency",
        lambda: fi.transfer_function(oscillator((2.0 * math.pi) ** 2), 1.0),
    ),
    (
        r"^structure = 'Study': must be a Structure: pass its \.structure$",
        lambda: fi.convergence_study(study(), fi.convergence.OverMeshes.uniform(BARE, [2, 4, 8])),
    ),
    *(
        (words, lambda axis=axis, more=more: fi.convergence_study(BARE, axis(), *more))
        for words, axis, more in (
            (r"^base: must be a Sine", NOUNS["OverMeshes"], [fi.convergence.SteadyResponse()]),
            (
                r"must be a reaction of the system: root\.force, root\.moment",
                NOUNS["OverMeshes"],
                [fi.convergence.SupportReaction("tip.moment"), BASE],
            ),
            (
                r"watch: must hold a quantity that depends on the modes",
                NOUNS["OverModes"],
                [fi.convergence.Frequencies()],
            ),
        )
    ),
    *(
        (words, lambda of=of, rest=rest: fi.convergence.mode_convergence(of(), SINE, EXACT, *rest))
        for words, of, rest in (
            ("counts", system, (6.0, [2, 1, 3])),
            ("duration", system, (1.0, [1, 2, 3])),
            (r"system\.contacts", placed, (6.0, [1, 2, 3])),
        )
    ),
    # orbits
    (r"orbit = Sine.*: must be a PeriodicOrbit", lambda: fi.continue_orbit(BASE, "frequency", (1.0, 2.0))),
    (
        "points = 1: must be a whole number >= 2",
        lambda: fi.continue_orbit(NOUNS["PeriodicOrbit"](), "frequency", (0.1, 0.2), points=1),
    ),
    (
        "must have the same gap on both sides",
        lambda: fi.continue_orbit(
            fi.find_orbit(
                oscillator(1.0, 0.1, stops=[fi.Stop("wall", "mass", (1.0, 2.0), RIGID)]),
                fi.PointForce("mass", fi.Sine(0.1, 0.1)),
                guess=fi.State(),
            ),
            "stop.wall.gap",
            (0.5, 1.5),
        ),
    ),
    ("is missing", lambda: fi.app.load_branch("none.nc")),
    # files
    *(
        (
            key,
            lambda key=key, bad=bad: vtk.write_modes(
                "a.pvd", system(), fi.solve_modes(system(), 1), STRUCTURE, **{key: bad}
            ),
        )
        for key, bad in (("scale", 0.0), ("subdivisions", 0))
    ),
    *(
        (key, lambda key=key, bad=bad: vtk.write_deflection("a.pvd", response(), STRUCTURE, **{key: bad}))
        for key, bad in (("exaggeration", 0.0), ("exaggeration", math.nan), ("frame", "moon"), ("most", 0))
    ),
    ("snapshots=STRIDE", lambda: vtk.write_deflection("a.pvd", replace(response(), snapshots=None), STRUCTURE)),
    *(
        (words, lambda result=result, of=of: fi.vtk.to_pyvista(result(), STRUCTURE, *of()))
        for words, result, of in (
            ("must be the system whose modes they are", lambda: fi.solve_modes(system(), 1), lambda: ()),
            ("must be Modes or a Response", lambda: "modes", lambda: ()),
            ("must be modes of the system", lambda: fi.solve_modes(system(), 1), lambda: (small(),)),
        )
    ),
    # study files
    ("must be an existing TOML file", lambda: load_study("nowhere.toml")),
    (
        r"mesh.file.*must be an existing mesh file",
        lambda: build(study(("elements = 40 ", 'file = "nowhere.msh" '))),
    ),
    (
        r"coupled dofs.*in a study file add \[reduction\] modes = n$",
        lambda: prepare(study(("[reduction]\nmodes = 8", "#\n#"), ('name = "newmark"', 'name = "event-driven"'))),
    ),
    *(
        (rf"^beam\.{name} = \[0\.002, 0\.001\] m: .* is end_{name}$", partial(study, (old, f"{name} = [2e-3, 1e-3]")))
        for name, old in (("width", "width = 0.020"), ("thickness", "thickness = 0.001"))
    ),
    *(
        (
            r"> 0 (s|N/m\S*), and of 1e-30 to 1e\+30 in size$",
            partial(study, ('"kelvin-voigt", restitution = 0.78, contact_time = 2e-3', f"{law} = {size}")),
        )
        for law in ('"kelvin-voigt", restitution = 0.7, contact_time', '"hertz", stiffness')
        for size in ("1e300", "1e-300")
    ),
    # laws
    *(
        ("^" + re.escape(words), call)
        for call, words in (
            (lambda: fi.Hertz(0.0), "stiffness = 0.0 N/m^1.5: must be a finite number > 0 N/m^1.5"),
            (lambda: fi.Hertz(1e9, exponent=0.5), "exponent = 0.5: must be a finite number >= 1 and <= 5"),
            (lambda: fi.Hertz(1e9, reference_speed=0.0), "reference_speed = 0.0 m/s: must be a finite number > 0 m/s"),
            (lambda: fi.contact.Flores(1e9, 0.0), "restitution = 0.0: must be a finite number > 0 and <= 1"),
            (lambda: fi.HuntCrossley(1e9, 1.1), "restitution = 1.1: must be a finite number > 0 and <= 1"),
            (
                lambda: fi.contact.PowerLaw(1e9, 0.5),
                "restitution = 0.5: must be 1 for Hertz: the elastic law loses nothing",
            ),
            (lambda: fi.contact.PowerLaw(1e9, 0.5, "florez"), "loss = 'florez': must be 'none' or 'hunt-crossley' or"),
            (lambda: fi.Rigid(1.2), "restitution = 1.2: must be a finite number >= 0 and <= 1"),
            (lambda: fi.CustomLaw(3.0), "force = 3.0: must be a function of depth, rate, approach_speed"),
            (lambda: fi.contact.Material(0.0, 0.3), "young_modulus = 0.0 Pa: must be a finite number > 0 Pa"),
            (lambda: fi.contact.Material(1e9, 0.6), "poisson_ratio = 0.6: must be a finite number > -1 and <= 0.5"),
            (
                lambda: fi.contact.hertz_stiffness(0.0, fi.contact.STEEL, fi.contact.STEEL),
                "radius = 0.0 m: must be a finite number > 0 m",
            ),
            (
                lambda: fi.collide(fi.Hertz(1e9), 0.0, 1.0),
                "effective_mass = 0.0 kg: must be a finite number > 0 and <= 1e+15 kg",
            ),
            (
                lambda: fi.collide(fi.Hertz(1e9), 1.0, -1.0),
                "approach_speed = -1.0 m/s: must be a finite number > 0 m/s",
            ),
            (lambda: fi.collide(fi.CustomLaw(lambda *_: 0.0), 1.0, 1.0), "force: must let the ball go"),
        )
    ),
    # excitations
    *(
        (re.escape(words), partial(fi.RandomBase, **{"psd": FLAT, "duration": 2.0, **given}))
        for given, words in (
            ({"clip": 0.5}, "clip = 0.5: must be a finite number >= 1"),
            ({"fade": 2.0}, "fade = 2.0 s: must be at most half the duration"),
            ({"psd": ((-20.0, 1.0), (200.0, 1.0))}, "-20 among its values"),
        )
    ),
    *(
        (words, call)
        for call, words in (
            (lambda: fi.Chirp(1.0, 2.0, 1.0), r"amplitude: is missing: one of amplitude \(m\) and acceleration"),
            (lambda: fi.Sine(frequency=5.0), r"amplitude: is missing: one of amplitude \(m\) and acceleration"),
            (lambda: fi.Sine(1e-3), r"frequency: must be a finite number > 0 Hz"),
            (
                lambda: fi.Sine(acceleration=((4.0, 1.0), (6.0, 2.0)), frequency=5.0),
                "acceleration = .*: must be a finite",
            ),
            (
                lambda: fi.PointForce("tip", fi.Sine(acceleration=1.0, frequency=5.0)),
                "history = 'Sine': must have an amplitude, in newtons",
            ),
            (
                lambda: fi.Chirp(1.0, 2.0, 1.0, amplitude=1.0, acceleration=1.0),
                r"amplitude = 'both'.*must be given alone",
            ),
            (lambda: fi.Chirp(0.0, 2.0, 1.0, amplitude=1.0, kind="logarithmic"), r"start = 0.* Hz: must be .*> 0 Hz"),
            (lambda: fi.Chirp(1.0, 2.0, 0.0, amplitude=1.0), r"duration = 0.* s"),
            (lambda: fi.Chirp(1.0, 2.0, amplitude=1.0), r"duration.*octaves_per_minute be given"),
            (lambda: fi.Chirp(1.0, 2.0, amplitude=1.0, kind="linear", octaves_per_minute=1.0), r"kind.*logarithmic"),
            (lambda: fi.SteppedSine([], 3, amplitude=1.0), r"frequencies.*one or more"),
            (lambda: fi.SteppedSine([1.0, -2.0], 3, amplitude=1.0), r"frequencies.*> 0"),
            (lambda: fi.RandomBase([(5.0, 1.0)], 10.0), r"psd.*2 or more pairs"),
            (lambda: fi.RandomBase([(5.0, 1.0), (4.0, 1.0)], 10.0), r"psd = '5 and then 4' Hz: must have .* that rise"),
            (lambda: fi.RandomBase([(5.0, 1.0), (9.0, 0.0)], 10.0), r"psd = '0 among its values'.*all > 0"),
            (lambda: fi.RandomBase([(5.0, 1.0), (5.1, 1.0)], 1e-3), r"duration.*must hold 1 to"),
            (lambda: fi.RandomBase([(5.0, 1.0), (9.0, 1.0)], 9.0, amplitudes="rayleigh"), r"amplitudes = 'rayleigh'"),
            (lambda: fi.Shock("bump", acceleration=1.0, duration=1.0), r"kind = 'bump'"),
            (lambda: fi.excitation.Sum(()), r"parts.*must be one or more"),
            (
                lambda: fi.excitation.Sum((fi.PointForce("tip", CHIRP),)),
                r"parts = 'PointForce'.*a force acts elsewhere",
            ),
            (lambda: fi.RecordedBase.from_velocity([1.0, 2.0, 1.0, 0.0], 0.1, high_pass=6.0), r"high_pass = 6.*< 5 Hz"),
        )
    ),
    *(
        (re.escape(words), call)
        for call, words in (
            (lambda: fi.Chirp(10, 100, 1.0, acceleration=((10, 1), (8, 1))), "10 Hz is followed by 8 Hz"),
            (
                lambda: fi.Chirp(10, 100, 1.0, acceleration=((10, 0), (200, 1))),
                "rows of a frequency in Hz, which rises",
            ),
            (
                lambda: fi.Chirp(10, 100, 1.0, acceleration=((-10, 1), (200, 1))),
                "rows of a frequency in Hz, which rises",
            ),
            (lambda: fi.Chirp(10, 100, 1.0, acceleration=((10, 1),)), "rows of a frequency in Hz, which rises"),
            (lambda: fi.Chirp(10, 100, 1.0, acceleration=((10, 1), (90, 1))), "must reach from 10 to 100 Hz"),
            (lambda: fi.Chirp(10, 100, 1.0, amplitude=((10, 1), (90, 1))), "a level over frequency is an acceleration"),
            (lambda: fi.Chirp(10, 100, 1.0, acceleration=1.0, fade=0.6), "fade = 0.6 s: must be at most half"),
            (lambda: fi.Chirp(10, 100, 1.0, acceleration=1.0, fade=-0.1), "fade = -0.1 s: must be"),
            (
                lambda: fi.Chirp(5, 9, acceleration=1.0, kind="logarithmic", octaves_per_minute=True),
                "octaves_per_minute = True 1/min: must be a finite number > 0 1/min",
            ),
            (lambda: fi.SteppedSine([10], 5, acceleration=((20, 1), (90, 1))), "must reach from 10 to 10 Hz"),
            (lambda: fi.SteppedSine([10], 5, acceleration=1.0, seconds=1.0), "one of cycles and seconds"),
            (lambda: fi.SteppedSine([10], acceleration=1.0, seconds=0.0), "seconds = 0.0 s: must be"),
        )
    ),
    *(
        (re.escape(words), partial(fi.Shock, **{"kind": "trapezoid", "acceleration": 30.0, "duration": 0.011, **given}))
        for given, words in (
            ({"ramp": 0.6}, "ramp = 0.6: must be a finite number > 0 and <= 0.5"),
            ({"kind": "triangle", "ramp": 0.2}, "ramp = 0.2: must be left out"),
            ({"pulses": 3}, "period: must be >= 0.011 s"),
            ({"pulses": 3, "period": 0.01}, "period = 0.01 s: must be >= 0.011 s"),
            (
                {"pulses": 3, "period": 0.1, "compensated": True},
                "period = 0.1 s: must be >= 0.231 s, the length of one",
            ),
            ({"delay": -1.0}, "delay = -1.0 s: must be"),
            ({"compensation": "never"}, "compensation = 'never': must be 'after' or 'before'"),
        )
    ),
    # arguments of verbs
    *(
        (
            "^" + re.escape(words),
            partial(
                fi.integrate, **{"system": small(), "excitation": BASE, "method": STEPPED, "duration": 0.1, **given}
            ),
        )
        for given, words in (
            ({"excitation": []}, "excitation: must be one or more"),
            ({"excitation": "sine"}, "excitation = 'str': must be a Sine, a PointForce, a RecordedBase or another"),
            (
                {"excitation": [BASE, 5.0]},
                "excitation = 'float': must be a Sine, a PointForce, a RecordedBase or another",
            ),
            ({"excitation": [BASE, BASE], "record": fi.Recorder(sink=print)}, "record.sink: must serve one run"),
        )
    ),
    *(
        (
            re.escape(words),
            partial(
                fi.frequency_sweep,
                **{"system": small(), "amplitude": 1e-4, "frequencies": [5.0], "method": STEPPED, "cycles": 3, **given},
            ),
        )
        for given, words in (
            ({"frequencies": []}, "frequencies"),
            ({"frequencies": [5.0, -1.0]}, "frequencies"),
            ({"frequencies": [5.0, 2000.0]}, "frequencies = 2000.0 Hz"),
            ({"cycles": 2}, "cycles = 2"),
            ({"cycles": 10.5}, "cycles = 10.5"),
            ({"amplitude": -1e-3}, "amplitude = -0.001 m"),
            ({"at": "tpi"}, "did you mean 'tip'"),
            ({"at": 0.5}, "must be within the beam"),
            ({"initial": fi.State(ball_velocity=[1.0, 2.0])}, "initial.ball_velocity"),
        )
    ),
    *(
        (words, partial(fi.frequency_sweep, small(), frequencies=[5.0], method=EXACT, cycles=12, **given))
        for given, words in (
            ({}, "amplitude: must be given alone"),
            ({"amplitude": 1e-4, "acceleration": 1.0}, "amplitude = 'both'.*: must be given alone"),
            ({"acceleration": -1.0}, "acceleration = -1"),
            ({"amplitude": 1e-4, "direction": "left"}, "direction = 'left': must be one of up, down, both"),
            ({"amplitude": 1e-4, "channel": "tip", "at": "mid"}, "at = 'mid': goes without a channel"),
            ({"amplitude": 1e-4, "channel": "tip.colour"}, "colour"),
        )
    ),
    *(
        (
            re.escape(words),
            partial(fi.frequency_sweep, small(), frequencies=[4.0, 6.0], method=EXACT, cycles=30, acceleration=rows),
        )
        for rows, words in (
            (((4.5, 1.0), (6.0, 1.0)), "acceleration: must reach from 4 to 6 Hz; its rows go from 4.5 to 6 Hz"),
            (((4.0, 1.0), (3.0, 1.0)), "4 Hz is followed by 3 Hz"),
            (((4.0, 0.0), (6.0, 1.0)), "rows of a frequency in Hz, which rises"),
            (-1.0, "must be a finite number >= 0 m/s^2"),
        )
    ),
    *(
        (words, partial(fi.transfer_function, **{"system": oscillator(), **given}))
        for given, words in (
            ({"frequency": [0.0, 1.0]}, r"^frequency = 0\.0 Hz: must be one or more numbers of 1e-06 to 1e\+09$"),
            ({"frequency": [-1.0]}, r"^frequency = -1\.0 Hz: must be"),
            ({"frequency": []}, r"^frequency = 'array of shape \(0,\)'"),
            ({"frequency": [1.0], "of": "base"}, "^of = 'base': must be 'base.displacement' or"),
            ({"frequency": [1.0], "force_at": "tp"}, "^force_at = 'tp': "),
            ({"frequency": [1.0], "of": "base.velocity", "force_at": "tip"}, "^of = 'base.velocity': must be left out"),
            ({"frequency": [1.0], "to": "tip.velocty"}, r"^to = 'tip\.velocty'"),
        )
    ),
    *(
        (words, partial(call, fi.without_impactors(small())))
        for call, words in (
            (lambda s: fi.State.of_mode(s, 0, 1e-3), "mode = 0"),
            (lambda s: fi.State.of_mode(s, 9, 1e-3), "mode = 9"),
            (lambda s: fi.State.of_mode(s, 1, 1e-3, at="root"), "at = 'root': must be a place that moves in mode 1"),
            (lambda s: fi.State.under_force(s, 1.0, at="nowhere"), "nowhere"),
        )
    ),
    *(
        (words, partial(section, **{"width": 0.02, "thickness": 4e-3, **given}))
        for given, words in (
            ({"end_thickness": 0.0}, r"end_thickness = 0(\.0)? m: must be a finite number > 0 m"),
            ({"end_width": -0.01}, r"end_width = -0\.01 m: must be a finite number > 0 m"),
            (
                {"end_thickness": 1e-200},
                r"end_thickness = 1e-200 m: must be a finite number > 0 m, and of 1e-30 to 1e\+30",
            ),
            (
                {"width": None, "thickness": None, "area": 1e-5, "second_moment": 1e-12, "end_thickness": 1e-3},
                r"end_thickness = 0\.001 m: must be left out: a section given by area and second_moment does not taper",
            ),
        )
    ),
    *(
        (r"^response\.channels = 'none': must be one or more", partial(channels_of, *recorded))
        for recorded in ((), ("ball.contact_force",))
    ),
    (
        "^calibrate: needs a sine of the base, and \\[base\\] of this study",
        lambda: fi.calibrate(resting(), [5.0, 6.0], [1e-3, 1e-3], {"impactor.ball.gap": (1e-3, 2e-3)}),
    ),
    (r"^parts = 'Response': must be a dictionary, as \{", lambda: fi.report("run.html", response())),
]
"""What a message has to say, by a regular expression, and the call that it refuses."""


@pytest.mark.parametrize(("words", "call"), CALLS)
def test_a_call_that_cannot_be_is_refused_in_these_words(words, call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(fi.InputError, match=words) as caught:
        call()
    assert "\n" not in str(caught.value)
