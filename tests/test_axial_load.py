"""A load along the beam: weight, spin, tension; against exact kinematics, the differential equation, and statics."""

from __future__ import annotations

import itertools
import math
import re
import runpy
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
import scipy.optimize
import scipy.special

import femimpact as fi
from femimpact.app.parametric.identity import plain_study
from femimpact.app.study.study_file import read_study, study_text
from femimpact.fem.axial import weight_shift
from femimpact.fem.mesh import with_nodes
from femimpact.units import in_si

pytestmark = pytest.mark.impacts

ROOT = Path(__file__).parents[1]
LENGTH = 0.3
BEAM = fi.Beam.uniform(length=LENGTH, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700)
EI, MASS = BEAM.segments[0].bending_stiffness, BEAM.segments[0].mass_per_length
STEPPED = fi.Beam((
    fi.Segment(name="root part", length=0.12, width=0.03, thickness=2e-3, young_modulus=70e9, density=2700,
               end_width=0.015, end_thickness=1e-3),
    fi.Segment(name="tip part", length=0.18, width=0.02, thickness=1e-3, young_modulus=210e9, density=7850),
))  # fmt: skip
BODIES = (
    fi.PointMass("disc", 0.07, 0.02, rotary_inertia=3e-5, offset=-0.01),
    fi.PointMass("box", "tip", 0.015, rotary_inertia=2e-5, offset=0.03),
)
LOADS = {
    "hanging": fi.Axial(acceleration=9.81),
    "standing": fi.Axial(acceleration=-1.5),
    "pulled": fi.Axial(tension=3.0),
    "flap": fi.Axial(spin=20.0, hub=0.05),
    "lag": fi.Axial(spin=20.0, hub=0.05, spin_plane="lag"),
    "all": fi.Axial(acceleration=3.0, spin=12.0, hub=0.1, tension=-0.2, spin_plane="lag"),
}


def added_stiffness(structure, elements=20):
    return (fi.assemble(structure, elements).K - fi.assemble(replace(structure, axial=None), elements).K).toarray()


def potential(structure, load, u, system):
    """Energy (J) of the load in a finite deflection: exact kinematics of a beam that does not stretch.

    The nodal values are the deflection and the sine of the turn of each section along the arc.
    """
    s = np.linspace(0.0, structure.beam.length, 60_001)
    s = np.unique(np.concatenate([s, structure.beam.joints]))
    middle, step = 0.5 * (s[1:] + s[:-1]), np.diff(s)
    nodal = system.expansion @ u

    def sine(x):
        return fi.system.hermite.hermite_rows(system.nodes, x, 1) @ nodal

    # Simpson over every step
    along = np.concatenate([[0.0], np.cumsum(step / 6 * sum(
        w * np.sqrt(1 - sine(x) ** 2) for w, x in ((1, s[:-1]), (4, middle), (1, s[1:]))))])  # fmt: skip
    across = fi.system.hermite.hermite_rows(system.nodes, s, 0) @ nodal
    joints = np.array(structure.beam.joints)
    density = np.empty(middle.size)
    for segment, start in zip(structure.beam.segments, joints[:-1], strict=True):
        inside = (middle > start) & (middle < start + segment.length)
        share = (middle[inside] - start) / segment.length
        width, thickness = [segment.width, segment.thickness] if segment.width else [0, 0]
        end = segment.end_width or width, segment.end_thickness or thickness
        density[inside] = segment.density * (width + share * (end[0] - width)) * (
            thickness + share * (end[1] - thickness))  # fmt: skip
    masses = [(density * step, 0.5 * (along[1:] + along[:-1]), 0.5 * (across[1:] + across[:-1]))]
    for body in structure.masses:
        place = structure.beam.length if body.at == "tip" else body.at
        turn = float(sine(np.array([place]))[0])
        x = np.interp(place, s, along) + body.offset * math.sqrt(1 - turn**2)
        masses.append((body.mass, x, np.interp(place, s, across) + body.offset * turn))
    energy = -load.tension * along[-1]
    for mass, x, w in masses:
        square = (load.hub + x) ** 2 + (w**2 if load.spin_plane == "lag" else 0.0)
        energy -= np.sum(mass * (load.acceleration * x + 0.5 * load.spin**2 * square))
    return energy


@pytest.mark.parametrize("load", LOADS.values(), ids=LOADS)
@pytest.mark.parametrize("beam", [BEAM, STEPPED], ids=["uniform", "tapered and stepped"])
def test_the_added_stiffness_is_the_energy_of_exact_kinematics(beam, load):
    structure = fi.Structure(beam, BODIES, axial=load)
    system = fi.assemble(structure, elements=6)
    shape = np.random.default_rng(3).standard_normal(system.dofs)
    shape[0::2] *= 0.1
    small = 1e-4 * shape
    # even in the deflection: half the second difference is the quadratic part, but for its fourth order
    exact = potential(structure, load, small, system) - potential(structure, load, 0.0 * small, system)
    added = added_stiffness(structure, 6)
    assert exact == pytest.approx(0.5 * small @ added @ small, rel=1e-5)


def by_shooting(load, body, mode, guess):
    """Omega (rad/s) of a uniform cantilever by Runge-Kutta over its differential equation, with a body at the tip."""
    m, e, inertia = (body.mass, body.offset, body.rotary_inertia) if body else (0.0, 0.0, 0.0)
    pull = load.tension + m * (load.acceleration + load.spin**2 * (load.hub + LENGTH + e))
    lag = load.spin**2 * (load.spin_plane == "lag")

    def normal(x):
        far = load.acceleration + load.spin**2 * load.hub
        return pull + MASS * (far * (LENGTH - x) + load.spin**2 * 0.5 * (LENGTH**2 - x**2))

    def determinant(omega):
        def rate(x, y):
            w, turn, moment, shear = y[0::4], y[1::4], y[2::4], y[3::4]
            # the transverse force of what lies beyond x is shear = N w' - (EI w'')'
            out = np.empty_like(y)
            out[0::4], out[1::4] = turn, moment / EI
            out[2::4], out[3::4] = normal(x) * turn - shear, -(omega**2 + lag) * MASS * w
            return out

        end = scipy.integrate.solve_ivp(rate, (0, LENGTH), [0, 0, 1.0, 0, 0, 0, 0, 1.0], method="DOP853",
                                        rtol=1e-12, atol=1e-14).y[:, -1]  # fmt: skip
        w, turn, moment, shear = end[0::4], end[1::4], end[2::4], end[3::4]
        centre = m * (omega**2 + lag) * (w + e * turn)
        field = load.acceleration + load.spin**2 * (load.hub + LENGTH + e)
        rows = [shear - centre, moment + m * field * e * turn - e * centre - omega**2 * inertia * turn]
        return rows[0][0] * rows[1][1] - rows[0][1] * rows[1][0]

    return scipy.optimize.brentq(determinant, 0.999 * guess, 1.001 * guess, xtol=1e-12, rtol=1e-13)


SPIN = math.sqrt(EI / MASS) / LENGTH**2
SHOT = {
    "hanging": (fi.Axial(acceleration=9.81), None),
    "pressed": (fi.Axial(tension=-0.2 * EI / LENGTH**2), None),
    "eta 3": (fi.Axial(spin=3 * SPIN), None),
    "eta 12, lag": (fi.Axial(spin=12 * SPIN, hub=0.1, spin_plane="lag"), None),
    "hanging box": (fi.Axial(acceleration=9.81), BODIES[1]),
    "box that spins": (fi.Axial(spin=3 * SPIN, hub=0.05), BODIES[1]),
    "box that spins, lag": (fi.Axial(spin=3 * SPIN, hub=0.05, spin_plane="lag"), BODIES[1]),
}


@pytest.mark.parametrize("case", SHOT)
def test_modes_are_those_of_the_differential_equation_with_order_4(case):
    load, body = SHOT[case]
    structure = fi.Structure(BEAM, [body] if body else [], axial=load)
    fine = 2 * math.pi * fi.solve_modes(fi.assemble(structure, 40), 2).natural_frequency
    exact = [by_shooting(load, body, mode, fine[mode]) for mode in (0, 1)]
    np.testing.assert_allclose(fine, exact, rtol=2e-6)
    errors = [2 * math.pi * fi.assemble(structure, n).first_frequency / exact[0] - 1.0 for n in (8, 16, 32)]
    assert min(errors) > 0.0
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 4.0, atol=0.25)


@pytest.mark.parametrize("share", [3.0, 0.4, -0.4, -0.99])
def test_a_beam_between_pins_under_tension_has_its_closed_form(share):
    tension, pins = share * math.pi**2 * EI / LENGTH**2, [fi.Support("pinned", "root"), fi.Support("pinned", "tip")]
    system = fi.assemble(fi.Structure(BEAM, supports=pins, axial=fi.Axial(tension=tension)), 40)
    n = np.arange(1, 3) * math.pi / LENGTH
    exact = (n**4 * EI + n**2 * tension) / MASS
    found = (2 * math.pi * fi.solve_modes(system, 2).natural_frequency) ** 2
    # the mesh's share of the square without tension, (n h)^4/720, and rounding of Cholesky's factor
    assert np.all(np.abs(found - exact) <= (1.2 * (n * LENGTH / 40) ** 4 / 720 + 1e-8) * n**4 * EI / MASS)


def test_what_hangs_on_a_spring_at_its_root_is_a_pendulum_and_does_not_stand():
    # a rod, stiff beside its weight, that turns about its end
    hung = fi.Structure(BEAM, supports=(), springs=[fi.Spring("pivot", "root", 1e9)], axial=fi.Axial(acceleration=0.1))
    frequency = math.sqrt(1.5 * 0.1 / LENGTH) / (2 * math.pi)
    assert fi.assemble(hung, 20).first_frequency == pytest.approx(frequency, rel=1e-5)
    with pytest.raises(fi.InputError, match="buckled"):
        fi.assemble(replace(hung, axial=fi.Axial(acceleration=-0.1)), 20)


def test_published_numbers_of_spinning_beams():
    # Wright and others (1982), omega L^2 sqrt(rho A/EI) of mode 1 over the same of the spin
    for eta, published in ((0.0, 3.5160), (3.0, 4.7973), (12.0, 13.1702)):
        flap, lag = (
            fi.assemble(fi.Structure(BEAM, axial=fi.Axial(spin=eta * SPIN, spin_plane=plane)), 40).first_frequency
            for plane in ("flap", "lag")
        )
        assert 2 * math.pi * flap / SPIN == pytest.approx(published, abs=6e-5)
        # without a body that has inertia both planes have the same modes
        assert (2 * math.pi * lag / SPIN) ** 2 == pytest.approx((2 * math.pi * flap / SPIN) ** 2 - eta**2, rel=1e-9)


def test_a_column_stands_up_to_its_critical_weight_and_is_refused_beyond():
    # J_(-1/3)(2/3 sqrt(q)) = 0: 7.8373
    root = scipy.optimize.brentq(lambda z: scipy.special.jv(-1 / 3, z), 1.5, 2.2)
    critical = (1.5 * root) ** 2
    assert critical == pytest.approx(7.8373, abs=5e-5)

    def column(share):
        return fi.Structure(BEAM, axial=fi.Axial(acceleration=-share * critical * EI / LENGTH**3 / MASS))

    assert 0.0 < fi.assemble(column(0.999), 40).first_frequency < 0.05 * fi.assemble(column(0.0), 40).first_frequency
    with pytest.raises(fi.InputError, match=r"^axial: .* the structure has buckled, at 0\.99\d+ of it$") as refused:
        fi.assemble(column(1.001), 40)
    assert len(refused.value.faults) == 1
    # as much of twice the load
    with pytest.raises(fi.InputError, match=r"at 0\.5000\d of it$"):
        fi.assemble(column(2.0), 40)


def test_a_node_is_put_where_the_normal_force_jumps():
    body = fi.PointMass("disc", 0.1234, 0.05, offset=0.01)
    structure = fi.Structure(STEPPED, [body], axial=fi.Axial(acceleration=40.0))
    bare = fi.uniform_mesh(replace(structure, masses=()), 20)
    system = fi.assemble(structure, mesh=bare)
    assert 0.1234 in system.nodes
    assert system.nodes.size == bare.nodes.size + 1
    regions = fi.fem.discretise(structure, mesh=bare).mesh.regions
    assert sum(members.size for members in regions.values()) == bare.elements + 1
    assert fi.assemble(replace(structure, axial=None), mesh=bare).nodes.size == bare.nodes.size
    # the frequency of another mesh with a node there, and of one much finer
    for elements, bound in ((21, 1e-5), (200, 1e-5)):
        other = fi.assemble(structure, elements).first_frequency
        assert system.first_frequency == pytest.approx(other, rel=bound)
    # bodies at one place, and at a node, are one node or none
    twice = replace(structure, masses=[body, replace(body, name="other"), fi.PointMass("end", "tip", 1e-3)])
    assert fi.assemble(twice, mesh=bare).nodes.size == bare.nodes.size + 1


def test_no_load_leaves_every_bit_and_is_not_in_the_key_of_a_study():
    structure = fi.Structure(STEPPED, BODIES, damping=fi.Rayleigh(ratio=0.01, modes=(1, 2)))
    plain, zero = (fi.assemble(replace(structure, axial=load), 12) for load in (None, fi.Axial()))
    assert (plain.K != zero.K).nnz == 0
    assert zero.first_frequency == pytest.approx(plain.first_frequency, rel=1e-13)
    path = ROOT / "femimpact" / "app" / "paper.toml"
    study = fi.load_study(path)
    keys = [
        plain_study(
            fi.app.ParameterStudy(
                replace(study, structure=replace(study.structure, axial=load)), {"base.frequency": [5.0]}, ["peak"]
            )
        )["study"]["structure"]
        for load in (None, fi.Axial(acceleration=9.81))
    ]
    assert "axial" not in keys[0]
    assert keys[1] == keys[0] | {"axial": {"noun": "Axial", "acceleration": 9.81}}


HANGING = fi.Structure(
    fi.Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700),
    [fi.PointMass("box", "tip", 0.02290976)],
    [fi.Impactor("ball", "tip", mass=3.43e-3, gap=4e-3, contact=fi.Rigid(0.6))],
    axial=fi.Axial(acceleration=9.81),
)


def with_tilt(structure, weight):
    """Omega^2 (rad^2/s^2) of the beam with a ball that flies in its tilted box, by all dofs: from the smallest."""
    system = fi.assemble(replace(structure, impactors=()), 40)
    ball, n = structure.impactors[0], system.dofs
    own = added_stiffness(replace(structure, impactors=(), masses=(fi.PointMass("b", "tip", ball.mass),)), 40)
    only = added_stiffness(replace(structure, impactors=(), masses=()), 40)
    held = system.K.toarray() + weight * (own - only)
    tip, turn = np.eye(n)[[-2, -1]]
    pull = weight * ball.mass * structure.axial.acceleration * np.outer(turn, np.append(-tip, 1.0))
    full = scipy.linalg.block_diag(held, [[0.0]])
    full[:n] += pull
    full[:, :n] += pull.T
    mass = scipy.linalg.block_diag(system.M.toarray(), [[ball.mass]])
    alone = scipy.linalg.eigh(held, system.M.toarray(), eigvals_only=True)
    return alone, scipy.linalg.eigh(full, mass, eigvals_only=True)


def test_the_weight_of_the_ball_is_left_out_and_its_shift_is_said():
    with pytest.warns(fi.InputWarning, match=r"ball along the beam is left out: .* first frequency by up to 0\.41 %"):
        system = fi.assemble(HANGING, 40)
    assert system.first_frequency == pytest.approx(5.4247, abs=5e-5)
    held, flying = with_tilt(HANGING, 1.0)
    assert math.sqrt(held[0]) / (2 * math.pi) == pytest.approx(5.4405, abs=5e-5)
    assert math.sqrt(flying[1]) / (2 * math.pi) == pytest.approx(5.4023, abs=5e-5)
    # the ball rolls off the tilted floor
    assert math.sqrt(-flying[0]) == pytest.approx(0.80, abs=5e-3)
    shifts = (math.sqrt(omega) / (2 * math.pi * system.first_frequency) - 1.0 for omega in (held[0], flying[1]))
    assert weight_shift(system, 9.81) == pytest.approx(max(map(abs, shifts)), rel=1e-2)
    # its weight is no part of N
    bare = fi.assemble(replace(HANGING, impactors=()), 40)
    assert (bare.K != system.K).nnz == 0


def test_a_heavy_ball_is_refused():
    heavy = replace(HANGING.impactors[0], mass=10e-3)
    with pytest.raises(fi.InputError, match=r"^axial.acceleration = 9\.81 m/s\^2: .* by up to 1\.2 %, and at most 1 %"):
        fi.assemble(replace(HANGING, impactors=[heavy]), 40)
    # tension alone has no weight
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fi.assemble(replace(HANGING, impactors=[heavy], axial=fi.Axial(tension=0.5)), 40)
    study = read_study(HANGING_TOML, Path("hanging.toml"))
    found = fi.parameter_study(study, {"impactor.ball.mass": [3e-3, 20e-3]}, ["peak"], cycles=30)
    assert np.isfinite(found["peak"].values).tolist() == [True, False]
    assert re.search(r"axial.acceleration.* at most 1 %", str(found["failure"].values[1]))


ABSORBER = fi.Absorber("damper", "tip", 1e-3, 2.0, 1e-3)


@pytest.mark.parametrize(("change", "words"), [
    ({"axial": 9.81}, "axial = .*must be an Axial"),
    ({"axial": fi.Axial(spin=5.0)}, r"axial.spin = 5.0 rad/s: must be 0 beside balls and absorbers"),
    ({"axial": fi.Axial(spin=5.0), "impactors": (), "absorbers": (ABSORBER,)}, r"axial.spin = 5.0 rad/s: must be 0"),
    ({"supports": ()}, "axial = .*must be None for a beam that nothing holds"),
])  # fmt: skip
def test_structures_are_refused(change, words):
    with pytest.raises(fi.InputError, match=words) as refused:
        replace(HANGING, **change)
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize("values", [
    {"spin": -1.0}, {"spin": 1e200}, {"tension": -1e300}, {"hub": -0.1}, {"tension": math.nan},
    {"acceleration": math.inf}, {"spin_plane": "edge"}, {"acceleration": "9.81 m/s^2"},
])  # fmt: skip
def test_fields_are_refused(values):
    with pytest.raises(fi.InputError, match=next(iter(values))) as refused:
        fi.Axial(**values)
    assert len(str(refused.value).splitlines()) == 1


def test_reactions_are_those_of_the_bent_beam():
    """Forces across the beam balance; the moment has the weight of all along the beam times its deflection."""
    structure = fi.Structure(BEAM, BODIES, gravity=-0.8, axial=fi.Axial(acceleration=9.81, tension=0.3))
    system = fi.assemble(structure, 60)
    u = fi.static_state(system)[0]
    force, moment = (
        system.reactions[name].on_displacement @ u - system.reactions[name].constant
        for name in ("root.force", "root.moment")
    )
    assert force == pytest.approx(0.8 * system.total_mass, rel=1e-8)
    x, step = np.linspace(0.0, LENGTH, 20_001, retstep=True)
    rows = [fi.system.hermite.hermite_rows(system.nodes, x, order) @ (system.expansion @ u) for order in (0, 1)]
    w, turn = rows
    across = MASS * np.trapezoid(x, dx=step)
    along = MASS * np.trapezoid(w, dx=step)
    for body in BODIES:
        place = LENGTH if body.at == "tip" else body.at
        across += body.mass * (place + body.offset)
        along += body.mass * (np.interp(place, x, w) + body.offset * np.interp(place, x, turn))
    assert moment == pytest.approx(0.8 * across + 9.81 * along + 0.3 * w[-1], rel=1e-6)


HANGING_TOML = """
[beam]
length = "230 mm"
width = "20 mm"
thickness = "1 mm"
young_modulus = "70 GPa"
density = 2700.0
[mesh]
elements = 20
[[mass]]
name = "box"
at = "tip"
mass = "23 g"
[[impactor]]
name = "ball"
at = "tip"
mass = "3 g"
gap = "4 mm"
contact = { law = "rigid", restitution = 0.6 }
[damping]
ratio = 0.003
modes = [1, 2]
[axial]
acceleration = "1 g"
tension = "10 mN"
[reduction]
modes = 3
[base]
amplitude = "0.2 mm"
frequency = "5.4 Hz"
duration = "8 s"
[method]
name = "event-driven"
"""
SPINNING_TOML = (
    HANGING_TOML[: HANGING_TOML.index("[[impactor]]")]
    + HANGING_TOML[HANGING_TOML.index("[damping]") :]
).replace('acceleration = "1 g"\ntension = "10 mN"', 'spin = "300 rpm"\nhub = "50 mm"\nspin_plane = "lag"')  # fmt: skip


def test_a_study_file_has_the_load_with_units():
    study = read_study(HANGING_TOML, Path("hanging.toml"))
    assert study.structure.axial == fi.Axial(acceleration=9.80665, tension=0.01)
    again = read_study(study_text(replace(study, text="")), Path("again.toml"))
    assert again.structure == study.structure
    spinning = read_study(SPINNING_TOML, Path("spinning.toml")).structure
    assert spinning.axial.spin == pytest.approx(10.0 * math.pi, rel=1e-15)
    assert (spinning.axial.hub, spinning.axial.spin_plane) == (0.05, "lag")
    for wrong, words in (
        ("300 1/s", "must have a unit that fits: rad/s, deg/s, rpm, Hz"),
        ("300 mm", "unit that fits"),
    ):
        with pytest.raises(fi.InputError, match=words):
            read_study(SPINNING_TOML.replace("300 rpm", wrong), Path("spinning.toml"))


def test_units_of_a_spin():
    assert in_si("spin", "3000 rpm", "rad/s") == pytest.approx(100 * math.pi, rel=1e-15)
    assert in_si("spin", "50 Hz", "rad/s") == pytest.approx(100 * math.pi, rel=1e-15)
    assert in_si("spin", "180 deg/s", "rad/s") == pytest.approx(math.pi, rel=1e-15)
    assert in_si("frequency", "3000 rpm", "Hz") == 50.0


def test_a_study_over_the_spin_raises_the_resonance():
    study = read_study(SPINNING_TOML.replace('spin_plane = "lag"', 'spin_plane = "flap"'), Path("spinning.toml"))
    axes = {"axial.spin": [0.0, 30.0], "base.frequency": [5.0, 5.4]}
    peaks = fi.parameter_study(study, axes, ["peak"], cycles=40)["peak"]
    for spin, case in zip(axes["axial.spin"], peaks.transpose("axial.spin", "base.frequency").values, strict=True):
        moved = replace(study.structure, axial=replace(study.structure.axial, spin=spin))
        system = fi.reduce(fi.assemble(moved, 20), 3)
        for frequency, peak in zip(axes["base.frequency"], case, strict=True):
            run = fi.integrate(system, fi.Sine(0.2e-3, frequency), fi.EventDriven(), 40 / frequency)
            assert run.steady.peak[0] == pytest.approx(float(peak), rel=1e-6)


@pytest.mark.parametrize("case", ["hanging", "lag"])
def test_ledgers_close_and_methods_agree(case):
    stop = fi.Stop("stop", "tip", 3e-3, fi.KelvinVoigt(restitution=0.6, contact_time=4e-3))
    structure = fi.Structure(BEAM, BODIES, stops=[stop], damping=fi.Rayleigh(0.01, (1, 2)), axial=LOADS[case])
    system = fi.reduce(fi.assemble(structure, 12), 3)
    base = fi.Sine(1e-3, system.first_frequency)
    exact, stepped = (fi.integrate(system, base, way, 1.0) for way in (fi.EventDriven(), fi.Newmark(dt=2e-5)))
    assert len(exact.impacts) > 1
    assert exact.energy.residual < 1e-9
    assert stepped.energy.residual < 1e-4
    stepwise = np.interp(exact.time, stepped.time, stepped["tip"])
    assert np.abs(exact["tip"] - stepwise).max() < 0.02 * np.abs(stepwise).max()


def test_an_orbit_of_a_hanging_beam_is_one_of_its_runs():
    with pytest.warns(fi.InputWarning, match="is left out"):
        system = fi.reduce(fi.assemble(replace(HANGING, damping=fi.Rayleigh(0.003, (1, 2))), 20), 3)
    base = fi.Sine(1e-3, system.first_frequency)
    (orbit,) = fi.orbits.two_impact_orbits(system, base)
    assert orbit.is_stable
    run = fi.integrate(system, base, fi.EventDriven(), 1500 / base.frequency)
    assert run.steady.peak[0] == pytest.approx(orbit.steady("tip").peak[0], rel=1e-6)


def test_the_mesh_keeps_its_names_where_a_node_is_put():
    mesh = fi.fem.Mesh(np.linspace(0, 1, 5), points={"joint": 0.5}, regions={"a": [0, 1], "b": [2, 3]})
    more = with_nodes(mesh, [0.3, 0.3 + 1e-13, 0.5, 0.9, 1.0])
    np.testing.assert_allclose(more.nodes, [0, 0.25, 0.3, 0.5, 0.75, 0.9, 1.0])
    assert more.points == mesh.points
    assert [more.regions[name].tolist() for name in "ab"] == [[0, 1, 2], [3, 4, 5]]
    assert with_nodes(mesh, [0.25]) is mesh
    for a, b in itertools.pairwise(more.nodes):
        assert b > a


def test_the_page_on_a_load_along_the_beam(monkeypatch, tmp_path, capsys):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("agg")
    monkeypatch.chdir(tmp_path)
    pictures = runpy.run_path(str(ROOT / "docs" / "pictures" / "make_pictures.py"))
    page = pictures["page_of"]("axial_load")
    pictures["prepare"](page, tmp_path)
    with pytest.warns(fi.InputWarning) as warned:
        pictures["ran"](page)
    said = [line for block in pictures["blocks"](page, "text") for line in block.splitlines()]
    # of the four blocks one is the warning
    assert [str(one.message) for one in warned] == [line for line in said if line.startswith("axial.acceleration")]
    assert capsys.readouterr().out.splitlines() == [line for line in said if not line.startswith("axial.acceleration")]
    assert Path("campbell.png").stat().st_size > 10_000
    pyplot.close("all")
