"""A free beam on a single spring to the base: a rigid rotation is left free, and all else is as exact equations say."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import femimpact as fi
from femimpact.system.matrices import rigid_motions

pytestmark = pytest.mark.impacts

LENGTH, STIFFNESS = 0.3, 50.0
BEAM = fi.Beam.uniform(length=LENGTH, width=0.02, thickness=2e-3, young_modulus=70e9, density=2700.0)
EI, RHO_A, MASS = BEAM.segments[0].bending_stiffness, BEAM.segments[0].mass_per_length, BEAM.mass
BASE = fi.Sine(1e-3, 7.0, 0.4)


def on_one_spring(at="tip", **more):
    return fi.Structure(beam=BEAM, supports=(), springs=[fi.Spring("mount", at, STIFFNESS)], **more)


def shape(b, share, x, derivative=0):
    """(cos + cosh) + c (sin + sinh) of b x and its derivatives by b x: no moment, no shear force at x = 0."""
    z = b * x
    even = (math.cos, math.sin, lambda t: -math.cos(t), lambda t: -math.sin(t))
    cosine = (even[0], lambda t: -math.sin(t), even[2], math.sin)[derivative](z)
    sine = (math.sin, math.cos, lambda t: -math.sin(t), lambda t: -math.cos(t))[derivative](z)
    hyperbolic = (math.cosh, math.sinh)
    return cosine + hyperbolic[derivative % 2](z) + share * (sine + hyperbolic[(derivative + 1) % 2](z))


def wave_numbers(length, stiffness, still, count):
    """Of a beam free at x = 0, whose end has EI w''' = stiffness w and the derivative `still` zero; with the shares."""

    def share(b):
        return -shape(b, 0.0, length, still) / (shape(b, 1.0, length, still) - shape(b, 0.0, length, still))

    def force(b):
        # the shares' denominator times the end's force, so that there is no pole; scaled against cosh
        slope = shape(b, 1.0, length, still) - shape(b, 0.0, length, still)
        c = share(b)
        found = EI * b**3 * shape(b, c, length, 3) - stiffness * shape(b, c, length)
        return found * slope / (EI * b**3 * math.cosh(b * length) ** 2)

    grid = np.linspace(0.02, 6.0 * (count + 1), 6000) / length
    values = [force(b) for b in grid]
    roots = [brentq(force, *grid[i : i + 2], xtol=1e-13) for i in range(5999) if values[i] * values[i + 1] < 0.0]
    return [(b, share(b)) for b in roots[:count]]


def frequency_of(b):
    return b**2 * math.sqrt(EI / RHO_A) / (2.0 * math.pi)


@pytest.mark.parametrize("elements", [20, 100])
def test_a_spring_at_one_end_leaves_one_frequency_zero_and_the_others_exact(elements):
    """On 20 elements by the dense solver, on 100 by Lanczos."""
    system = fi.assemble(on_one_spring(), elements=elements)
    modes = fi.solve_modes(system, 4)
    exact = [frequency_of(b) for b, _ in wave_numbers(LENGTH, STIFFNESS, 2, 3)]
    assert system.first_frequency == modes.natural_frequency[0] == 0.0
    # the cubic element's error, (b h)^4/720 of a mode; that of 20 elements is 2e-5 for the last of these
    bound = 2.0 * (np.array(exact) / frequency_of(1.0)) ** 2 * (LENGTH / elements) ** 4 / 720.0 + 1e-10
    assert np.all(np.abs(modes.natural_frequency[1:] / exact - 1.0) <= bound)
    gram = modes.vectors.T @ system.M @ modes.vectors
    np.testing.assert_allclose(gram, np.eye(4), atol=1e-9)
    turned = system.deflection_rows([0.0, 0.5 * LENGTH, LENGTH]) @ modes.vectors[:, 0]
    # a slender bar about its end, of inertia m L^2/3
    np.testing.assert_allclose(np.abs(turned), math.sqrt(3.0 / MASS) * np.array([1.0, 0.5, 0.0]), atol=1e-9)


def test_a_spring_in_the_middle_leaves_the_rotation_to_itself():
    system = fi.assemble(on_one_spring("mid"), elements=40)
    modes = fi.solve_modes(system, 5)
    # symmetric about the spring: half a beam carries half of it, and its slope is zero there
    symmetric = [frequency_of(b) for b, _ in wave_numbers(0.5 * LENGTH, 0.5 * STIFFNESS, 1, 2)]
    # the spring is at a node of the odd modes of a free beam, cos(b L) cosh(b L) = 1
    odd = frequency_of(brentq(lambda z: math.cos(z) - 1.0 / math.cosh(z), 7.5, 8.2) / LENGTH)
    even = frequency_of(brentq(lambda z: math.cos(z) - 1.0 / math.cosh(z), 10.5, 11.5) / LENGTH)
    assert symmetric[1] < odd < even
    np.testing.assert_allclose(modes.natural_frequency[:4], [0.0, *symmetric, odd], rtol=1e-5)
    # a moving base does not turn it
    assert abs(modes.participation_factor[0]) <= 1e-9 * math.sqrt(MASS)


def exact_response(time, x, modes):
    """Deflection at x from rest relative to the base, of the rigid rotation about the tip and some modes."""
    start, rate = BASE.displacement(0.0), BASE.velocity(0.0)
    # what turns freely keeps its momentum: only the base moves away from it
    away = BASE.displacement(time) - start - rate * time
    total = -1.5 * (1.0 - x / LENGTH) * away
    forcing = 2.0 * math.pi * BASE.frequency
    for b, share in modes:
        scale = quad(lambda z, b=b, c=share: shape(b, c, z) ** 2, 0.0, LENGTH, epsabs=0.0)[0]
        part = quad(lambda z, b=b, c=share: shape(b, c, z), 0.0, LENGTH, epsabs=0.0)[0] / scale
        omega = 2.0 * math.pi * frequency_of(b)
        size = part * BASE.amplitude * forcing**2 / (omega**2 - forcing**2)
        steady = size * np.sin(forcing * time + BASE.phase)
        own = size * (
            math.sin(BASE.phase) * np.cos(omega * time) + forcing / omega * math.cos(BASE.phase) * np.sin(omega * time)
        )
        total = total + shape(b, share, x) * (steady - own)
    return total


def test_a_moving_base_turns_it_as_the_closed_form_says():
    full = fi.assemble(on_one_spring(), elements=24)
    system, record = fi.reduce(full, 4), fi.Recorder(("root", "mid"))
    modes = wave_numbers(LENGTH, STIFFNESS, 2, 3)
    exact = fi.integrate(system, BASE, fi.EventDriven(samples_per_cycle=128), 1.0, record)
    for name, x in (("root", 0.0), ("mid", 0.5 * LENGTH)):
        wanted = exact_response(exact.time, x, modes)
        # the mesh: frequencies to 1e-8 of the first and 1e-5 of the third elastic mode, over 300 of its periods
        np.testing.assert_allclose(exact[name], wanted, atol=2e-5 * np.abs(wanted).max())
    assert np.abs(wanted).max() > 5.0 * BASE.amplitude
    # Newmark's period is longer by (omega dt)^2/24: 1.2e-6 for the first elastic mode, 78 rad of which are run through
    for other in (system, full):
        stepped = fi.integrate(other, BASE, fi.Newmark(7e-5), 1.0, record)
        wanted = exact_response(stepped.time, 0.0, modes)
        np.testing.assert_allclose(stepped["root"], wanted, atol=2e-4 * np.abs(wanted).max())
        assert stepped.energy.residual < 1e-6


KELVIN_VOIGT = fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)


@pytest.mark.parametrize(
    ("method", "law", "bound"),
    [
        (fi.EventDriven(), fi.Rigid(0.6), 1e-10),
        (fi.EventDriven(), KELVIN_VOIGT, 1e-10),
        (fi.MoreauJean(5e-5), fi.Rigid(0.6), 1e-10),
        (fi.Newmark(5e-5, contact="energy-consistent"), KELVIN_VOIGT, 1e-10),
    ],
)
def test_energies_close_with_a_ball_in_a_box_at_the_free_end(method, law, bound):
    ball = fi.Impactor("ball", "root", 2e-3, 1e-3, law)
    damping = fi.Rayleigh(0.01, frequencies=(12.0, 117.0))
    full = fi.assemble(on_one_spring(impactors=[ball], damping=damping), elements=12)
    # the first mode at the ball is the bar's rotation about the spring, which feels m/3
    assert full.contacts[0].effective_mass == pytest.approx(1.0 / (1.0 / 2e-3 + 3.0 / MASS), rel=1e-9)
    system = fi.reduce(full, 4)
    phi = fi.solve_modes(full, 4).vectors
    np.testing.assert_allclose(system.C.diagonal(), np.diag(phi.T @ full.C @ phi), rtol=1e-9)
    run = fi.integrate(system, BASE, method, 3.0)
    assert len(run.impacts) > 20
    assert run.energy.residual < bound


def test_the_rotation_has_the_damping_of_its_mass_alone_on_a_fine_mesh():
    """C = alpha M + beta K, and a rotation without strain has no stiffness."""
    system = fi.assemble(on_one_spring(damping=fi.Rayleigh(0.02, frequencies=(10.0, 200.0))), elements=300)
    assert fi.reduce(system, 4).C.diagonal()[0] == pytest.approx(system.rayleigh[0], rel=1e-12)


@pytest.mark.parametrize("elements", [12, 30])
@pytest.mark.parametrize("modes", [2, 8])
def test_a_pressed_ball_leaves_the_rotation_free_whatever_the_modes(elements, modes):
    """Structure and ball turn together about the spring: of the matrix with the contact's spring, rounding is left."""
    ball = fi.Impactor("ball", "root", 2e-3, 1e-3, KELVIN_VOIGT)
    system = fi.reduce(fi.assemble(on_one_spring(impactors=[ball]), elements=elements), modes)
    run = fi.integrate(system, BASE, fi.EventDriven(), 3.0)
    assert len(run.impacts) > 20
    # sums of some thousand samples
    assert run.energy.residual < 1e-11


def test_a_place_that_the_rotation_leaves_still_has_the_first_elastic_mode():
    ball = fi.Impactor("ball", "tip", 2e-3, 1e-3, KELVIN_VOIGT)
    system = fi.assemble(on_one_spring(impactors=[ball]), elements=12)
    phi = float(system.point_row("tip") @ fi.solve_modes(system, 2).vectors[:, 1])
    assert system.contacts[0].first_mode == pytest.approx(phi, rel=1e-9)


def test_gravity_is_static_where_it_does_no_work_on_the_rotation():
    middle = fi.assemble(on_one_spring("mid", gravity=-9.81), elements=10)
    for system in (middle, fi.reduce(middle, middle.dofs)):
        u, _ = fi.static_state(system)
        root, mid, tip = system.deflection_rows([0.0, 0.5 * LENGTH, LENGTH]) @ u
        assert mid == pytest.approx(-9.81 * MASS / STIFFNESS, rel=1e-9)
        # each half is a cantilever under its own weight, q l^4/(8 EI)
        assert [root - mid, tip - mid] == pytest.approx(
            [-9.81 * RHO_A * (0.5 * LENGTH) ** 4 / (8.0 * EI)] * 2, rel=1e-7
        )
    words = (
        "initial = 'static': needs a structure that is held: K is singular, as a mechanism leaves a rigid motion free"
    )
    for at in ("tip", 0.16):
        with pytest.raises(fi.InputError, match=words):
            fi.static_state(fi.assemble(on_one_spring(at, gravity=-9.81), elements=10))


def test_a_stop_that_presses_a_mechanism_has_no_static_state():
    stop = fi.Stop("wall", "root", (-1e-4, math.inf), fi.KelvinVoigt(stiffness=1e4, damping=0.0))
    system = fi.assemble(on_one_spring("mid", stops=[stop]), elements=10)
    with pytest.raises(fi.InputError, match="held where stops press it, wall: K is singular, a mechanism"):
        fi.static_state(system)


def test_what_a_rigid_motion_does_not_have_is_refused_by_name():
    for damping, words in (
        (fi.Rayleigh(0.01, modes=(1, 2)), r"damping\.modes = \(1, 2\): must be elastic ones, from 2 on"),
        (
            fi.ModalDamping((0.01, 0.01)),
            r"damping\.ratios = 0\.01: must begin with 1 of 0: a rigid motion has no ratio",
        ),
    ):
        with pytest.raises(fi.InputError, match=words):
            fi.assemble(on_one_spring(damping=damping), elements=10)
    ball = fi.Impactor("ball", "root", 2e-3, 1e-3, KELVIN_VOIGT)
    with pytest.raises(fi.InputError, match="static_correction = True: needs a structure that is held"):
        fi.reduce(fi.assemble(on_one_spring(impactors=[ball]), elements=10), 4, static_correction=True)


@pytest.mark.filterwarnings("ignore:first mode:femimpact.errors.InputWarning")
@pytest.mark.parametrize("stiffness", [1e-6, 1e9])
def test_springs_however_soft_or_stiff_hold_where_they_are_two(stiffness):
    springs = [fi.Spring("a", "root", stiffness), fi.Spring("b", 0.01, stiffness)]
    system = fi.assemble(fi.Structure(beam=BEAM, supports=(), springs=springs), elements=10)
    assert rigid_motions(system).shape == (system.dofs, 0)
    assert rigid_motions(fi.assemble(on_one_spring(), elements=500)).shape[1] == 1
