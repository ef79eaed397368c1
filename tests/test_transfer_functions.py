"""Transfer functions against closed forms, against runs, and what is refused."""

import math

import numpy as np
import pytest
from nouns import STRUCTURE, system

import femimpact as fi

FREQUENCY = np.array([0.3, 1.0, 1.7, 4.0])
OMEGA, RATIO = 2 * math.pi * 1.5, 0.02


def oscillator(mass: float = 2.0, **more: object) -> fi.System:
    given = [[mass]], [[2 * RATIO * OMEGA * mass]], [[OMEGA**2 * mass]]
    return fi.System.from_matrices(*given, points={"tip": [1.0]}, **more)


def quotient(f: np.ndarray) -> np.ndarray:
    """1/(w0^2 - w^2 + 2 i z w0 w)."""
    omega = 2 * math.pi * f
    return 1.0 / (OMEGA**2 - omega**2 + 2j * RATIO * OMEGA * omega)


def test_an_oscillator_on_its_base_has_the_closed_form():
    omega = 2 * math.pi * FREQUENCY
    relative = -quotient(FREQUENCY)
    transmissibility = (OMEGA**2 + 2j * RATIO * OMEGA * omega) * quotient(FREQUENCY)
    found = fi.transfer_function(oscillator(), FREQUENCY, ["tip", "tip.velocity", "tip.absolute_acceleration"])
    np.testing.assert_allclose(found["tip"], relative, rtol=1e-13)
    np.testing.assert_allclose(found["tip.velocity"], 1j * omega * relative, rtol=1e-13)
    np.testing.assert_allclose(found["tip.absolute_acceleration"], transmissibility, rtol=1e-13)
    assert found.units == {"tip": "m/(m/s^2)", "tip.velocity": "m/s/(m/s^2)", "tip.absolute_acceleration": "1"}
    # by default the transmissibility, and of displacements it is the same
    np.testing.assert_array_equal(
        fi.transfer_function(oscillator(), FREQUENCY)["tip.absolute_acceleration"], found["tip.absolute_acceleration"]
    )
    same = fi.transfer_function(oscillator(), FREQUENCY, "tip.absolute_displacement", "base.displacement")
    np.testing.assert_allclose(same["tip.absolute_displacement"], transmissibility, rtol=1e-13)
    speed = fi.transfer_function(oscillator(), FREQUENCY, "tip", "base.velocity")["tip"]
    np.testing.assert_allclose(speed, 1j * omega * relative, rtol=1e-13)


def test_a_force_has_the_receptance_and_reciprocity():
    found = fi.transfer_function(oscillator(), FREQUENCY, "tip", force_at="tip")
    np.testing.assert_allclose(found["tip"], quotient(FREQUENCY) / 2.0, rtol=1e-13)
    assert found.units["tip"] == "m/N"
    assert found.of == "force at tip"
    there = fi.transfer_function(system(), FREQUENCY, "mid", force_at="tip")["mid"]
    back = fi.transfer_function(system(), FREQUENCY, "tip", force_at="mid")["tip"]
    np.testing.assert_allclose(there, back, rtol=1e-9)


def test_an_absorber_and_a_ball_count_with_their_closed_forms():
    stiffness, damping = 6.0, 0.08
    absorber = fi.Absorber("absorber", "tip", 0.1, stiffness, damping)
    found = fi.transfer_function(
        oscillator(absorbers=[absorber], impactors=[fi.Impactor("ball", "tip", 0.5, 1e-3, fi.Rigid(0.5))]),
        FREQUENCY, ["tip", "absorber", "ball.absolute_acceleration", "ball.contact_force"],
    )  # fmt: skip
    omega = 2 * math.pi * FREQUENCY
    spring = stiffness + 1j * omega * damping
    for i, w in enumerate(omega):
        free = 2.0 / quotient(FREQUENCY)[i]
        u, y = np.linalg.solve([[free + spring[i], -spring[i]], [-spring[i], spring[i] - 0.1 * w**2]], [-2.0, -0.1])
        assert found["tip"][i] == pytest.approx(u, rel=1e-12)
        assert found["absorber"][i] == pytest.approx(y, rel=1e-12)
    # the ball stays where it is in space, and nothing touches it
    assert np.abs(found["ball.absolute_acceleration"]).max() < 1e-14
    assert not np.any(found["ball.contact_force"])


def test_every_channel_of_a_steady_run_has_its_amplitude_and_phase():
    bare = fi.reduce(fi.assemble(fi.Structure(STRUCTURE.beam, damping=STRUCTURE.damping), 4), 3)
    names = ("tip.absolute_acceleration", "root.surface_stress", "shaker_force", "root.reaction_moment", "mid.rotation")
    sine = fi.Sine(1e-3, 9.0)
    for drive, given in ((sine, {}), (fi.PointForce("mid", sine), {"force_at": "mid"})):
        run = fi.integrate(bare, drive, fi.EventDriven(), 60.0, fi.Recorder(names, start=59.0))
        transfer = fi.transfer_function(bare, [9.0], names, **(given or {"of": "base.displacement"}))
        for name in names:
            exact = 1e-3 * (transfer[name][0] * np.exp(2j * np.pi * 9.0 * run.time)).imag
            # of the transient exp(-0.01 w1 59) is left, and the steady motion has rounding
            np.testing.assert_allclose(run[name], exact, atol=1e-9 * np.abs(exact).max())


def test_modes_and_the_whole_mesh_agree_below_the_modes_left_out():
    full = fi.assemble(fi.Structure(STRUCTURE.beam, damping=STRUCTURE.damping), 4)
    f = np.array([3.0, 20.0])
    modal = fi.transfer_function(fi.reduce(full, full.dofs), f, "tip")["tip"]
    np.testing.assert_allclose(fi.transfer_function(full, f, "tip")["tip"], modal, rtol=1e-9)


def test_the_dataset_has_units():
    data = fi.transfer_function(oscillator(), FREQUENCY, "tip").to_xarray()
    assert data["tip"].attrs == {"units": "m/(m/s^2)", "of": "base.acceleration"}
    assert data["frequency"].attrs["units"] == "Hz"
    assert np.iscomplexobj(data["tip"])
