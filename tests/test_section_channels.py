"""Moments, stresses, reactions and the shaker in runs: sums of forces, statics, and the balance of power."""

import re
from dataclasses import replace

import numpy as np
import pytest

import femimpact as fi
from femimpact.integrators.channel_rows import channel_rows, drive_of
from femimpact.response.channels import resolve_channels
from femimpact.units import read_unit

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


STEEL = {"young_modulus": 210e9, "density": 7850.0}
IPE_100 = {"area": 10.3e-4, "second_moment": 171e-8}
BARE = fi.Structure(beam=fi.Beam.section(length=1.0, **IPE_100, **STEEL))
"""A section whose surface is not known."""
MODULI = {
    "rectangle": (fi.Beam.uniform(length=1.0, width=0.04, thickness=0.01, **STEEL), 0.04 * 0.01**2 / 6.0),
    "round bar": (fi.Beam.round(length=1.0, diameter=0.02, **STEEL), np.pi * 0.02**3 / 32.0),
    "tube": (
        fi.Beam.tube(length=1.0, diameter=60.3e-3, wall=3e-3, **STEEL),
        np.pi * (60.3e-3**4 - 54.3e-3**4) / (32.0 * 60.3e-3),
    ),
    "IPE 100": (fi.Beam.section(length=1.0, outer_fibre=0.05, **IPE_100, **STEEL), 171e-8 / 0.05),
    "angle, the nearer side": (
        fi.Beam.section(length=1.0, area=2e-3, second_moment=2.354e-6, outer_fibre=0.0325, **STEEL),
        2.354e-6 / 0.0325,
    ),
}
"""Beams, and the section modulus (m^3) of each."""


@pytest.mark.parametrize("key", MODULI)
def test_the_stress_is_the_moment_over_the_section_modulus(key):
    beam, modulus = MODULI[key]
    system = fi.assemble(fi.Structure(beam=beam), elements=4)
    bent = np.linalg.solve(system.K.toarray(), 7.0 * system.point_row("tip"))
    stress, strain = (
        fi.response.channels.channel_of(system, f"root.{name}").reading(system).displacement @ bent
        for name in ("surface_stress", "surface_strain")
    )
    assert stress == pytest.approx(-7.0 / modulus, rel=1e-9)
    assert strain == pytest.approx(-7.0 / modulus / 210e9, rel=1e-9)


NEEDED = r"needs outer_fibre \(m\) of segment 'beam'"


@pytest.mark.parametrize("name", ["root.surface_stress", "tip.surface_strain", "0.5.surface_stress_left"])
def test_without_an_outer_fibre_stress_and_strain_are_refused(name):
    system = fi.reduce(fi.assemble(BARE, elements=4), 2)
    with pytest.raises(fi.InputError, match=f"^{name}: {NEEDED}"):
        run(system, fi.EventDriven(), (name,))
    with pytest.raises(fi.InputError, match=f"{name}: {NEEDED}"):
        fi.frequency_sweep(system, 1e-4, [5.0], fi.EventDriven(), 60, channel=name)


def test_without_an_outer_fibre_moments_are_read_and_no_stress_is_watched():
    system = fi.reduce(fi.assemble(BARE, elements=4), 2)
    assert run(system, fi.EventDriven(), ("root.bending_moment",))["root.bending_moment"].any()
    over, sine = [fi.convergence.OverMeshes([fi.uniform_mesh(BARE, n) for n in (2, 4)])], fi.Sine(1e-4, 5.0)
    with pytest.raises(fi.InputError, match=f"SurfaceStress: {NEEDED}"):
        fi.convergence_study(BARE, over, [fi.convergence.SurfaceStress("root")], sine)


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


def test_a_reaction_under_several_drives_says_by_what_of_each_it_differs():
    bare = structure(impactors=[], stops=[], damping=None, gravity=0.0)
    forces = [fi.PointForce(at, fi.Sine(0.3, frequency)) for at, frequency in ((0.1, 23.0), (0.2, 17.0))]
    system, names = fi.reduce(fi.assemble(bare, elements=4), 2), ("root.reaction_force", "shaker_force")
    kept = fi.integrate(system, BASE + forces[0] + forces[1], fi.EventDriven(), 0.2, fi.Recorder(names))
    drives = np.column_stack([BASE.acceleration(kept.time), *(force.force(kept.time) for force in forces)])
    (mass, *shares), residual, *_ = np.linalg.lstsq(drives, kept["shaker_force"] - kept["root.reaction_force"])
    assert residual < 1e-16 * np.abs(kept["shaker_force"]).max() ** 2
    of_forces = ", ".join(
        f"by {abs(share):.3g} of the force at {force.at}" for share, force in zip(shares, forces, strict=True)
    )
    assert any(f"by {abs(mass):.3g} kg times the base's acceleration, {of_forces}, and" in text for text in kept.notes)


BEAMS = {
    "with a mass": structure(impactors=[], stops=[], damping=None, gravity=0.0),
    "of two segments, one tapered": fi.Structure(
        fi.Beam((
            fi.Segment(0.15, 70e9, 2700, 0.02, 2e-3, name="thick"),
            fi.Segment(0.1, 200e9, 7800, 0.02, 2e-3, name="thin", end_width=0.01, end_thickness=0.5e-3),
        ))
    ),
}  # fmt: skip
READ = ("root.surface_stress", "0.1.bending_moment", "root.shear_force", "0.1.curvature", "0.1.surface_strain", "0.05",
        "tip.rotation")  # fmt: skip


STATIC = re.compile(r"of (\S+) of the structure's (\S+)(?: ([^,]*?))? under (.*?)(?:, (?=of )|: what)")


def static_values(notes, load):
    """By channel what its note says of a load: values at rest of the modes kept, and of the whole structure."""
    found = {}
    for text in notes:
        for kept, full, unit, under in STATIC.findall(text):
            if under == load:
                factor = (read_unit(unit) or (unit, 1.0))[1]
                found[text.partition(": ")[0]] = factor * float(kept), factor * float(full)
    return found


@pytest.mark.parametrize("force_at", [None, 0.1, "tip"])
@pytest.mark.parametrize("beam", BEAMS)
def test_what_few_modes_lack_under_slow_loads_is_the_difference_of_the_static_values(beam, force_at):
    """The whole structure and the modes kept, both at a thousandth of the first frequency."""
    whole, load = fi.assemble(BEAMS[beam], elements=10), f"1 N at {force_at}" if force_at else "1 m/s^2 of the base"
    slow = [1e-3 * whole.first_frequency]
    exact = fi.transfer_function(whole, slow, READ, force_at=force_at)
    assert not exact.notes
    for modes, least in ((1, 5), (2, 4), (4, 1)):
        kept = fi.transfer_function(fi.reduce(whole, modes), slow, READ, force_at=force_at)
        said = static_values(kept.notes, load)
        assert len(said) >= least
        for name in READ:
            lacks, of = (exact[name] - kept[name])[0].real, exact[name][0].real
            if name in said:
                read, full = said[name]
                # five digits of each
                assert full - read == pytest.approx(lacks, rel=1e-4, abs=1e-4 * max(abs(full), abs(read)))
                assert abs(lacks) > 0.999e-3 * abs(of)
            else:
                assert abs(lacks) < 1.001e-3 * abs(of)


@pytest.mark.parametrize("key", METHODS)
def test_runs_and_sweeps_name_what_few_modes_lack(key):
    bare = BEAMS["with a mass"]
    whole, name = fi.assemble(bare, elements=4), "root.surface_stress"
    assert not static_values(run(all_modes(whole), METHODS[key], (name,), duration=0.02).notes, "1 m/s^2 of the base")
    system = fi.reduce(whole, 1)
    said = static_values(run(system, METHODS[key], (name,), duration=0.02).notes, "1 m/s^2 of the base")
    assert set(said) == {name}
    # of a channel that was not recorded
    assert (
        static_values(run(system, METHODS[key], ("tip",), duration=0.02).largest(name).notes, "1 m/s^2 of the base")
        == said
    )
    if key == "event-driven":
        curve = fi.frequency_sweep(system, 1e-4, [1.0], METHODS[key], 4, channel=name)
        assert static_values(curve.notes, "1 m/s^2 of the base") == said


def test_static_values_of_weight_are_those_of_the_static_state():
    whole = fi.assemble(structure(impactors=[], stops=[]), elements=4)
    kept, start = fi.reduce(whole, 2), fi.State.static()
    record = fi.Recorder(channels=("root.shear_force", "root.surface_stress"))
    full, few = (
        fi.integrate(system, fi.Sine(0.0, 5.0), method, 0.05, record, start)
        for system, method in ((whole, fi.Newmark(1e-3)), (kept, fi.EventDriven()))
    )
    said = static_values(few.notes, "constant forces")
    assert set(said) == set(full.channels)
    for name, values in said.items():
        assert values == pytest.approx((few[name][0], full[name][0]), rel=1e-3)


def test_static_values_of_a_contact_are_those_of_a_force_at_its_place():
    system, force = fi.reduce(fi.assemble(structure(), elements=4), 2), fi.PointForce("tip", fi.Sine(1.0, 5.0))
    notes = run(system, fi.EventDriven(), ("root.shear_force", "0.1.bending_moment"), force, 0.02).notes
    of_ball, of_force, of_stop = (static_values(notes, f"1 N {words}") for words in ("of ball", "at tip", "of wall"))
    assert of_ball == of_force
    at_stop = run(system, fi.EventDriven(), tuple(of_stop), fi.PointForce(0.2, fi.Sine(1.0, 5.0)), 0.02).notes
    # a stop pushes against w
    assert of_stop == {name: (-a, -b) for name, (a, b) in static_values(at_stop, "1 N at 0.2").items()}


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
        whole = fi.system.add_terms(whole, mass=more, load=-9.81 * more @ up)
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
