"""What the table of impacts adds up to: the contact loss of the ledger, and the momentum of every ball."""

import math
from dataclasses import replace

import numpy as np
import pytest
import random_structures
from builders import REFERENCE, cantilever
from random_structures import random_case
from table_sums import impulses, loss_left, momentum_left

import femimpact as fi
from femimpact.figures.histories import cycle_averaged_force

pytestmark = pytest.mark.impacts

ROUNDING = 1e-9
"""Sums of up to 10^5 impacts, each of some products of 16 digits; what one impact that is missing leaves is 1e-5."""


def run_of(case):
    record = fi.Recorder((case.system.default_place,), impacts=1_000_000)
    return fi.integrate(case.system, case.excitation, fi.EventDriven(), case.duration, record, case.initial)


def check(response, initial):
    assert response.impacts.dropped == 0
    assert loss_left(response) < ROUNDING
    for pair in response.system.balls:
        if not pair.free_stiffness:
            assert momentum_left(response, initial, pair.name) < ROUNDING, pair.name


def pad_and_backstop(rng, places, scale, kinds, most, balls):
    """A soft stop and a hard one a little behind it at one place, or two such pairs; more than modes may touch."""
    stops = []
    for i in range(int(rng.integers(1, 3))):
        place = places[int(rng.integers(len(places)))]
        gap = tuple(random_structures._gaps(rng, scale))
        gap = (gap, (gap[0], math.inf), (math.inf, gap[1]))[int(rng.integers(3))]
        soft = fi.KelvinVoigt(stiffness=10.0 ** rng.uniform(2.0, 6.0), restitution=float(rng.uniform(0.1, 1.0)))
        behind = tuple(side + 10.0 ** rng.uniform(-6.0, -3.0) for side in gap)
        stops += [
            fi.Stop(f"pad{i + 1}", place, gap, soft),
            fi.Stop(
                f"back{i + 1}", place, behind, fi.Rigid(float(rng.uniform(0.0, 0.9)) if rng.random() < 0.5 else 0.0)
            ),
        ]
    return tuple(stops)


def without_rebound(rng, scale, kinds):
    """Six of ten rigid contacts have no rebound."""
    law = LAW(rng, scale, kinds)
    return fi.Rigid(0.0) if isinstance(law, fi.Rigid) and rng.random() < 0.6 else law


LAW = random_structures._law


@pytest.mark.parametrize("places", [("tip", "tip"), ("tip", "mid")])
def test_two_balls_without_rebound_have_all_their_arrivals_in_the_table(places):
    """A ball that arrives while the other sticks was captured without a row, and its loss was missing."""
    system = fi.reduce(cantilever(fi.Rigid(0.0), places=places), modes=8)
    response = fi.integrate(system, fi.Sine(0.2037e-3, 5.2), fi.EventDriven(), 20.0)
    check(response, fi.State())
    assert len(response.impacts) > 100


@pytest.mark.parametrize("seed", [*range(24), 26, 32, 42])
def test_tables_of_random_structures_without_rebound(seed, monkeypatch):
    monkeypatch.setattr(random_structures, "_law", without_rebound)
    case = random_case(seed)
    check(run_of(case), case.initial)


@pytest.mark.parametrize("seed", [2, 3, 8, 9, 16, 41, 82, 107, 131, 140, 141, 143, 146, 147, 149, 339, 557])
def test_pads_with_hard_backstops(seed, monkeypatch):
    """Rigid walls are met exactly and do not pull, soft ones give way, and the ledger closes."""
    monkeypatch.setattr(random_structures, "_law", without_rebound)
    monkeypatch.setattr(random_structures, "_stops", pad_and_backstop)
    case = random_case(seed)
    stops = [pair for pair in case.system.contacts if pair.is_stop and isinstance(pair.law, fi.Rigid)]
    record = fi.Recorder(tuple(f"{pair.name}.gap" for pair in stops), impacts=1_000_000)
    response = fi.integrate(case.system, case.excitation, fi.EventDriven(), case.duration, record, case.initial)
    check(response, case.initial)
    assert response.energy.residual < ROUNDING
    for pair in stops:
        x = response[f"{pair.name}.gap"]
        slack = 1e-12 * np.max(np.abs(x)) + fi.EventDriven().closure
        assert np.max(x) <= pair.gaps[0] + slack
        assert np.min(x) >= -pair.gaps[1] - slack
    # rounding of the largest impulse: a phase may last for no time, or hold a ball that nothing moves
    pushed = response.sticking.impulse
    largest = max(np.max(np.abs(pushed), initial=0.0), np.max(response.impacts.impulse, initial=0.0))
    assert np.min(pushed, initial=0.0) >= -1e-6 * largest


def test_a_mass_between_a_pad_and_its_backstop_has_the_momentum_of_their_impulses():
    """A free mass: m v' = F sin(w t) - pushes, so that the impulses of the stops are all its change of momentum."""
    mass, force, frequency, duration = 0.7, 0.4, 2.0, 10.1
    stops = [
        fi.Stop("pad", "mass", (1e-2, 1e-2), fi.KelvinVoigt(stiffness=3e3, restitution=0.4)),
        fi.Stop("back", "mass", (1.05e-2, 1.05e-2), fi.Rigid(0.0)),
    ]
    system = fi.System.from_matrices([[mass]], [[0.0]], [[0.0]], points={"mass": [1.0]}, stops=stops)
    drive = fi.PointForce("mass", fi.Sine(force, frequency))
    response = fi.integrate(
        system, drive, fi.EventDriven(), duration, fi.Recorder(("mass.velocity",), impacts=100_000),
        fi.State(velocity=[0.3]),
    )  # fmt: skip
    assert {"pad", "back"} <= set(response.impacts.impactor)
    omega, end = 2.0 * math.pi * frequency, response.final_state.time
    given = force * (1.0 - math.cos(omega * end)) / omega
    sums = [impulses(response, name) for name in ("pad", "back")]
    change = mass * (response["mass.velocity"][-1] - 0.3)
    assert response.final_state.continuation.touching == ()
    assert abs(change - given + sum(own for own, _ in sums)) < ROUNDING * sum(size for _, size in sums)
    assert loss_left(response) < ROUNDING


def squeezed(law):
    """One mode between a stop on the base and one in space, which the base moves on against the first."""
    stops = [
        fi.Stop("low", "mass", (1e-3, math.inf), fi.Rigid(0.0)),
        fi.Stop("high", "mass", (math.inf, 1e-3), law, fixed_to="space"),
    ]
    return fi.System.from_matrices([[1.0]], [[0.1]], [[100.0]], points={"mass": [1.0]}, base_load=[1.0], stops=stops)


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_rigid_stops_that_no_mode_can_meet_are_refused_with_that_reason(restitution):
    with pytest.raises(fi.InputError, match="all rigid stops in touch can be met") as refusal:
        fi.integrate(squeezed(fi.Rigid(restitution)), fi.Sine(4e-3, 0.3), fi.EventDriven(), 10.0)
    assert "\n" not in str(refusal.value)


def test_a_soft_stop_gives_way_to_a_rigid_one():
    system = squeezed(fi.KelvinVoigt(stiffness=1e4, restitution=0.5))
    record = fi.Recorder(("low.gap", "high.gap"))
    response = fi.integrate(system, fi.Sine(4e-3, 0.3), fi.EventDriven(), 10.0, record)
    assert response.energy.residual < ROUNDING
    assert np.max(response["low.gap"]) <= 1e-3 + 2.0 * fi.EventDriven().closure
    # x = w + ub: the rigid one holds w at 1 mm where ub is -4 mm
    assert np.min(response["high.gap"]) == pytest.approx(-3e-3, rel=1e-6)


METHODS = {
    "Newmark": (fi.Newmark(1e-4), fi.KelvinVoigt(stiffness=4e3, damping=2.0)),
    "Moreau-Jean": (fi.MoreauJean(1e-4), fi.Rigid(0.6)),
}


@pytest.mark.parametrize("name", METHODS)
def test_tables_of_methods_with_steps(name):
    """A ball in a box on two modes: losses of the ledger, and Newmark's trapezoidal sums are its own momentum."""
    method, law = METHODS[name]
    omega = 2.0 * math.pi * np.array([5.0, 31.0])
    ball = fi.Impactor("ball", "tip", 0.1, 2e-3, law, acceleration=-0.5)
    system = fi.System.from_matrices(
        np.eye(2), np.diag(0.02 * omega), np.diag(omega**2), points={"tip": [1.0, -0.8]}, base_load=[1.0, 0.3],
        impactors=[ball],
    )  # fmt: skip
    base = fi.Sine(1e-3, 5.0)
    response = fi.integrate(system, base, method, 4.0, fi.Recorder(("ball.velocity",)))
    assert len(response.impacts) > 20
    assert response.final_state.continuation.touching == ()
    pair, end = system.contacts[0], response.final_state.time
    moved = float(base.velocity(end)) - float(base.velocity(0.0))
    own, size = impulses(response, "ball")
    left = pair.mass * (response["ball.velocity"][-1] + moved) - pair.mass * pair.acceleration * end + own
    table_loss, ledger_loss = float(response.impacts.energy_loss.sum()), float(response.energy.contact_loss[-1])
    assert table_loss == pytest.approx(ledger_loss, rel=ROUNDING)
    if name == "Moreau-Jean":
        # the impulses of a sticking phase are in both tables
        sticking = response.sticking
        assert len(sticking) > 0
        left -= float((sticking.side * sticking.impulse).sum())
        _, force = cycle_averaged_force(response)
        assert force.sum() / base.frequency == pytest.approx(response.impacts.impulse.sum(), rel=ROUNDING)
    assert abs(left) < ROUNDING * size


def test_a_stop_with_its_gap_on_the_wrong_side_has_a_note_that_it_is_not_met():
    """Under gravity to the - side the beam leaves a wall that was given on the + side."""
    notes = {}
    for side, gap in (("+", (1e-3, math.inf)), ("-", (math.inf, 1e-3))):
        stop = fi.Stop("stop", "tip", gap, fi.KelvinVoigt(restitution=0.6, contact_time=2e-3))
        bare = replace(REFERENCE, impactors=(), stops=(stop,), gravity=-9.81)
        system = fi.reduce(fi.assemble(bare, elements=8), modes=2)
        for method in (fi.EventDriven(), fi.Newmark(1e-4)):
            response = fi.integrate(system, fi.Sine(1e-5, 5.0), method, 1.0)
            notes[side, type(method).__name__] = [note for note in response.notes if "is not met" in note]
    assert notes["-", "EventDriven"] == notes["-", "Newmark"] == []
    for method in ("EventDriven", "Newmark"):
        (note,) = notes["+", method]
        assert "stop is not met: its gap is 0.001 m to the + side" in note
        assert "(to the + side, to the - side)" in note
