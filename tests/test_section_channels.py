"""Moments, stresses, reactions and the shaker in runs: sums of forces, statics, and the balance of power."""

from dataclasses import replace

import numpy as np
import pytest

import femimpact as fi
from femimpact.integrators.channel_rows import channel_rows, drive_of
from femimpact.response.channels import resolve_channels

pytestmark = pytest.mark.impacts

LAW = fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
BEAM = fi.Beam.uniform(length=0.3, width=0.02, thickness=1.5e-3, young_modulus=70e9, density=2700.0)
STEPPED = fi.Beam(
    (
        fi.Segment(0.1, 70e9, 2700.0, width=0.02, thickness=2e-3, name="thick"),
        fi.Segment(0.2, 210e9, 7850.0, width=0.01, thickness=1e-3, name="thin"),
    )
)
BASE = fi.Sine(2e-3, 11.0, 0.3)


def structure(**more):
    """A cantilever with a box, a ball on a centring spring, and a stop that is soon met."""
    parts = {
        "beam": BEAM,
        "masses": [fi.PointMass("box", "tip", 0.02, 1e-6)],
        "impactors": [fi.Impactor("ball", "tip", 3e-3, 3e-4, LAW, free_stiffness=2.0)],
        "stops": [fi.Stop("wall", 0.2, 1e-3, LAW)],
        "damping": fi.Rayleigh(0.01, modes=(1, 2)),
        "gravity": -9.81,
    }
    return fi.Structure(**(parts | more))


METHODS = {"newmark": fi.Newmark(2e-5), "event-driven": fi.EventDriven()}


def run(system, method, channels, base=BASE, duration=0.2):
    return fi.integrate(system, base, method, duration, fi.Recorder(channels=channels))


def all_modes(system):
    return fi.reduce(system, system.dofs)


@pytest.mark.parametrize("key", METHODS)
@pytest.mark.parametrize("fixed_to", ["base", "space"])
def test_reactions_and_stops_on_the_base_carry_what_the_shaker_gives(key, fixed_to):
    # damping in proportion to the mass acts between structure and base and is not a support's: take it away
    wall = fi.Stop("wall", 0.2, 1e-3, LAW, fixed_to=fixed_to)
    system = all_modes(fi.assemble(structure(damping=None, stops=[wall]), elements=4))
    response = run(system, METHODS[key], ("root.reaction_force", "shaker_force", "wall.contact_force"))
    carried = response["root.reaction_force"]
    if fixed_to == "base":
        carried = carried + response["wall.contact_force"]
    assert np.abs(response["wall.contact_force"]).max() > 0.0
    error = np.abs(carried - response["shaker_force"]).max()
    assert error < 1e-9 * np.abs(carried).max()


def test_physical_dofs_and_all_modes_read_the_same_reaction():
    whole = fi.assemble(structure(), elements=2)
    names = ("root.reaction_force", "root.reaction_moment", "0.02.bending_moment", "tip.acceleration")
    one, other = (run(system, fi.Newmark(2e-5), names, duration=0.02) for system in (whole, all_modes(whole)))
    for name in names:
        assert np.abs(one[name] - other[name]).max() < 1e-7 * np.abs(one[name]).max()


@pytest.mark.parametrize("key", METHODS)
def test_a_force_beside_the_root_acts_on_the_support_itself(key):
    # in the root's own element, where the interpolation hands part of it to the held dofs
    system = all_modes(fi.assemble(structure(damping=None, impactors=[], stops=[], gravity=0.0), elements=2))
    force = fi.PointForce(0.05, fi.Sine(1.5, 7.0))
    response = run(system, METHODS[key], ("root.reaction_force", "shaker_force"), force, 0.1)
    error = np.abs(response["root.reaction_force"] - response["shaker_force"]).max()
    assert error < 1e-9 * np.abs(response["shaker_force"]).max()


def test_the_power_of_the_shaker_is_what_energy_gains_and_losses_take():
    errors = []
    for dt in (4e-5, 2e-5):
        system = all_modes(fi.assemble(structure(gravity=0.0, stops=[]), elements=3))
        own = ("shaker_force", "ball.absolute_velocity")
        response = run(system, fi.Newmark(dt), (*own, Momentum()))
        speed, ledger, t = BASE.velocity(response.time), response.energy, response.time
        moved = response["base_load u'"]
        # from the frame of the base to the inertial one
        kinetic = ledger.kinetic + speed * moved + 0.5 * system.total_mass * speed**2
        relative = response["ball.absolute_velocity"] - speed
        ball_share = 0.5 * 3e-3 * (response["ball.absolute_velocity"] ** 2 - relative**2)
        energy = kinetic + ledger.strain + ledger.ball + ball_share + ledger.contact
        power = response["shaker_force"] * speed
        given = np.concatenate([[0.0], np.cumsum(0.5 * dt * (power[1:] + power[:-1]))])
        left = energy - energy[0] + ledger.structure_loss + ledger.contact_loss - given
        errors.append(np.abs(left).max() / np.abs(given).max())
        assert t.size == response.energy.time.size
    # sums over steps of second order
    assert errors[1] < 2e-4
    assert errors[0] / errors[1] > 2.5


class Momentum:
    """base_load u', the momentum of the structure relative to the base."""

    unit = "N s"
    name = "base_load u'"

    def reading(self, system):
        """A row of the velocity."""
        return replace(fi.response.channels.zero_reading(system), velocity=system.base_load)


def test_quasistatic_moments_and_stresses_are_those_of_the_textbook():
    # a force that grows so slowly that inertia is nothing: M = F (L - x), stress = M h/(2 I)
    beam = fi.Structure(beam=BEAM)
    system = fi.reduce(fi.assemble(beam, elements=8), 16)
    force = fi.PointForce("tip", fi.Sine(0.5, 0.01))
    names = ("root.bending_moment", "mid.bending_moment", "root.surface_stress", "root.surface_strain",
             "mid.shear_force", "root.reaction_force", "root.reaction_moment", "root.curvature")  # fmt: skip
    response = run(system, fi.EventDriven(samples_per_cycle=64), names, force, 25.0)
    applied, length = force.force(response.time[-1:])[0], 0.3
    stiffness = 70e9 * 0.02 * 1.5e-3**3 / 12.0
    expected = {
        "root.bending_moment": applied * length,
        "mid.bending_moment": applied * length / 2.0,
        "root.curvature": applied * length / stiffness,
        "root.surface_strain": -applied * length * 0.75e-3 / stiffness,
        "root.surface_stress": -70e9 * applied * length * 0.75e-3 / stiffness,
        "mid.shear_force": -applied,
        "root.reaction_force": -applied,
        "root.reaction_moment": -applied * length,
    }
    for name, value in expected.items():
        # what is left of the start's own motion, undamped: (0.01 Hz / f1) of the static one
        assert response[name][-1] == pytest.approx(value, rel=5e-3), name


@pytest.mark.parametrize("key", METHODS)
def test_a_reaction_with_modes_left_out_says_by_what_mass_it_differs(key):
    bare = structure(impactors=[], stops=[], damping=None, gravity=0.0)
    system, names = fi.assemble(bare, elements=4), ("root.reaction_force", "shaker_force")
    whole = run(all_modes(system), METHODS[key], names, duration=0.02)
    assert not [text for text in whole.notes if "differ from the sum" in text]
    kept = run(fi.reduce(system, 2), METHODS[key], names, duration=0.02)
    apart = kept["shaker_force"] - kept["root.reaction_force"]
    mass = apart[1:] / BASE.acceleration(kept.time[1:])
    assert np.ptp(mass) < 1e-9 * system.total_mass
    note = next(text for text in kept.notes if "differ from the sum" in text)
    assert f"by {abs(mass[0]):.3g} kg times" in note


def at_rest(system):
    """Shaker force and root force (N) at the end of a run from the static state, and the notes."""
    record = fi.Recorder(channels=("shaker_force", "root.reaction_force"))
    response = fi.integrate(system, fi.Sine(0.0, 5.0), fi.EventDriven(), 0.05, record, fi.State.static())
    return response["shaker_force"][-1], response["root.reaction_force"][-1], response.notes


@pytest.mark.parametrize("modes", [1, 2, 5, 8])
def test_at_rest_the_shaker_carries_the_whole_weight_whatever_modes_are_kept(modes):
    whole = fi.assemble(structure(), elements=4)
    # the ball hangs on its spring: rounding of the static state, times the accelerations that it leaves
    assert at_rest(fi.reduce(whole, modes))[0] == pytest.approx(9.81 * (whole.total_mass + 3e-3), rel=1e-8)
    bare = fi.assemble(structure(impactors=[], stops=[]), elements=4)
    shaker, root, notes = at_rest(fi.reduce(bare, modes))
    assert shaker == pytest.approx(9.81 * bare.total_mass, rel=1e-9)
    said = [text for text in notes if "differ from the sum" in text]
    assert (f"by {abs(shaker - root):.3g} N of gravity" in said[0]) if modes < 8 else not said


@pytest.mark.parametrize("modes", [1, 3, 8])
@pytest.mark.parametrize("own", [False, True])
def test_gravity_reads_as_a_base_acceleration_of_the_opposite_sign(modes, own):
    # equivalence of both holds mode by mode, and so whatever is left out
    whole = fi.assemble(structure(stops=[]), elements=4)
    if own:
        more, up = 0.7 * np.eye(10), np.tile([1.0, 0.0], 5)
        whole = fi.add_terms(whole, mass=more, load=-9.81 * more @ up)
    system = fi.reduce(whole, modes)
    names = ("shaker_force", "root.reaction_force", "root.reaction_moment", "tip.acceleration", "mid.bending_moment")
    channels = resolve_channels(system, names)
    rows = channel_rows(system, drive_of(system, BASE), channels, springs_apart=False)
    by_base = rows.base[:, 2] + rows.drive[:, 0]
    # rounding of the mode shapes' rows at the root
    np.testing.assert_allclose(rows.constant, 9.81 * by_base, rtol=1e-9, atol=1e-12)
    assert by_base[0] != 0.0


def test_a_replaced_constant_load_has_a_resultant_of_its_own():
    whole = fi.assemble(structure(), elements=4)
    small = fi.reduce(whole, 1)
    # gravity of the free dofs; the rest of the weight is on the held ones
    assert small.constant_resultant == whole.constant_resultant == float(whole.rigid_translation @ whole.constant_load)
    assert replace(small, constant_load=None).constant_resultant == 0.0
    assert replace(whole, constant_load=2.0 * whole.constant_load).constant_resultant == pytest.approx(
        2.0 * whole.constant_resultant, rel=1e-14
    )


def test_a_section_that_jumps_has_two_stresses_and_one_moment():
    system = fi.assemble(fi.Structure(beam=STEPPED), elements=None, mesh=_stepped_mesh(16))
    names = ("0.1.bending_moment", "0.1.bending_moment_left", "0.1.surface_stress", "0.1.surface_stress_left")
    small = fi.reduce(system, 4)
    right, left, stress, stress_left = (run(small, fi.EventDriven(), (name,), duration=0.1)[name] for name in names)
    late = slice(right.size // 2, None)
    assert np.abs(right - left)[late].max() < 0.02 * np.abs(right[late]).max()
    # stress = M h/(2 I) = 6 M/(b h^2)
    ratio = (6.0 / (0.01 * 1e-3**2)) / (6.0 / (0.02 * 2e-3**2))
    peak = np.argmax(np.abs(stress))
    assert stress[peak] / stress_left[peak] == pytest.approx(ratio, rel=0.02)


def _stepped_mesh(elements):
    return fi.uniform_mesh(fi.Structure(beam=STEPPED), elements * 3)


@pytest.mark.parametrize("name", ["tip.reaction_force", "0.1.reaction_moment"])
def test_a_reaction_where_no_support_is_is_refused_with_those_there_are(name):
    system = all_modes(fi.assemble(structure(), elements=2))
    with pytest.raises(fi.InputError, match=r"no such reaction.*known: root\.force, root\.moment"):
        run(system, fi.Newmark(2e-5), (name,))
