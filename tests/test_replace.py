"""A copy with another field is a sound noun or refused: nothing stays behind that was computed from the old field."""

from __future__ import annotations

import copy
import math
import pickle
from dataclasses import fields, replace

import numpy as np
import pytest
import scipy.sparse as sparse
from nouns import BASE, LAW, NOUNS, STRUCTURE, oscillators, response, small, system

import femimpact as fi
from femimpact.errors import Fault, InputError
from femimpact.system.system import TOGETHER

SYSTEMS = {"physical": system, "reduced": small, "matrices": oscillators}


def doubled(matrix):
    return sparse.csr_array(2.0 * matrix)


CHANGES = {
    "M": lambda s: {"M": doubled(s.M)},
    "K": lambda s: {"K": doubled(s.K)},
    "K and its factor": lambda s: {"K": doubled(s.K), "stiffness_factor": math.sqrt(2.0) * s.stiffness_factor},
    "stiffness_factor": lambda s: {"stiffness_factor": 2.0 * s.stiffness_factor},
    "base_load": lambda s: {"base_load": 2.0 * s.base_load},
    "rigid_translation": lambda s: {"rigid_translation": 2.0 * s.rigid_translation},
    "nodes": lambda s: {"nodes": 2.0 * s.nodes if s.nodes.size else np.array([0.0, 1.0])},
    "expansion": lambda s: {"expansion": 2.0 * s.expansion},
    "points": lambda s: {"points": {**s.points, "other": 0.1}},
    "total_mass": lambda s: {"total_mass": 2.0 * s.total_mass},
    "first_frequency": lambda s: {"first_frequency": 2.0 * s.first_frequency},
    "rayleigh": lambda s: {"rayleigh": (1.0, 1.0)},
    "directions": lambda s: {"directions": {"tip": np.ones(s.dofs)}},
    "constant_resultant": lambda s: {"constant_resultant": s.constant_resultant + 1.0},
    "reactions": lambda s: {"reactions": {"other": system().reactions["root.force"]}},
    "sections": lambda s: {"sections": fi.fem.discretise(STRUCTURE, elements=4).sections},
    "first_left_out": lambda s: {"first_left_out": 1.0},
    "unreduced": lambda s: {"unreduced": fi.assemble(STRUCTURE, elements=2)},
}


@pytest.mark.parametrize("made", SYSTEMS)
@pytest.mark.parametrize("change", CHANGES)
def test_what_others_are_computed_from_is_not_replaced_alone(made, change):
    whole = SYSTEMS[made]()
    with pytest.raises(fi.InputError) as refused:
        replace(whole, **CHANGES[change](whole))
    message = str(refused.value)
    assert message.startswith(tuple(CHANGES[change](whole)))
    # and the line says what does it
    assert "System.from_matrices" in message or "replace both" in message


def test_every_field_of_a_system_is_computed_with_others_or_checked_on_its_own():
    assert {item.name for item in fields(fi.System)} == {
        *TOGETHER, "C", "constant_load", "contacts", "computed_together",
    }  # fmt: skip
    assert {name.split(" ")[0] for name in CHANGES} == set(TOGETHER) - {"C"}


def test_a_spring_at_the_tip_goes_through_the_matrices(reference):
    full = fi.assemble(reference, elements=10)
    row = full.point_row("tip")
    spring = sparse.csr_array(200.0 * np.outer(row, row))
    with pytest.raises(fi.InputError, match="K: cannot be replaced"):
        replace(full, K=full.K + spring)
    points = {"tip": row}
    K = full.K + spring
    C = full.rayleigh[0] * full.M + full.rayleigh[1] * K
    stiffer = fi.System.from_matrices(full.M, C, K, points=points, base_load=full.base_load)
    # one mode of a tip mass: f sqrt(1 + k/k_tip), with the static stiffness of the tip, a few per mille above
    tip = 1.0 / float(row @ np.linalg.solve(full.K.toarray(), row))
    one_mode = 5.30 * math.sqrt(1.0 + 200.0 / tip)
    assert fi.solve_modes(stiffer, 1).natural_frequency[0] == pytest.approx(one_mode, rel=0.01)
    assert fi.reduce(stiffer, 2).first_frequency == stiffer.first_frequency
    assert stiffer.first_frequency == pytest.approx(14.95, abs=0.005)


@pytest.mark.parametrize("made", SYSTEMS)
def test_another_damping_is_taken_where_it_is_one(made):
    whole = SYSTEMS[made]()
    stronger = doubled(whole.M)
    changed = replace(whole, C=stronger, rayleigh=(2.0, 0.0))
    modes, alpha = fi.solve_modes(changed, 1), 2.0
    # alpha/(2 omega), to the rounding of a frequency
    assert modes.damping_ratio[0] == pytest.approx(alpha / (4.0 * math.pi * modes.natural_frequency[0]), rel=1e-9)
    general = fi.solve_modes(replace(whole, C=stronger, rayleigh=None), 1)
    assert general.damping_ratio[0] == pytest.approx(modes.damping_ratio[0], rel=1e-9)
    if whole.rayleigh is not None:
        with pytest.raises(fi.InputError, match=r"rayleigh = .*replace both"):
            replace(whole, C=stronger)
    with pytest.raises(fi.InputError, match="C: must be positive semidefinite"):
        replace(whole, C=-stronger, rayleigh=None)


def test_contacts_are_replaced_at_their_places_only():
    whole = system()
    ball, wall = whole.contacts
    assert replace(whole, contacts=()).contacts == ()
    heavier = replace(ball, mass=2.0 * ball.mass, gaps=(1.0, 2.0), law=fi.Rigid(0.5), name="other")
    assert replace(whole, contacts=[heavier, wall]).contacts == (heavier, wall)
    for stale in (
        replace(ball, direction=2.0 * ball.direction),
        replace(ball, position=0.1),
        replace(ball, first_mode=1.0),
        replace(ball, flexibility=1.0),
        replace(ball, mass=math.inf),
        small().contacts[0],
    ):
        with pytest.raises(fi.InputError, match=r"contacts\.ball: must be at a place that the system has a contact at"):
            replace(whole, contacts=(stale,))
    with pytest.raises(fi.InputError, match="distinct names"):
        replace(whole, contacts=(ball, ball))
    with pytest.raises(fi.InputError, match="balls first"):
        replace(whole, contacts=(wall, ball))


def test_the_numbers_of_a_contact_follow_its_law_and_mass():
    pair = system().contacts[0]
    first = fi.solve_modes(fi.without_impactors(system()), 1).vectors[:, 0]
    for changed in (replace(pair, mass=0.01), replace(pair, law=fi.KelvinVoigt(stiffness=1e4, damping=1.0))):
        mass = 1.0 / (1.0 / changed.mass + float(changed.direction @ first) ** 2)
        # the first mode is good to 1e-9
        assert changed.effective_mass == pytest.approx(mass, rel=1e-8)
        alone = fi.collide(changed.law, changed.effective_mass, 0.2)
        assert changed.parameters.contact_time == pytest.approx(alone.contact_time, rel=1e-12)


def test_a_replaced_contact_runs_as_an_assembled_one():
    law = fi.KelvinVoigt(stiffness=1e4, restitution=0.5)
    ball = replace(STRUCTURE.impactors[0], mass=6e-3, contact=law)
    assembled = fi.reduce(fi.assemble(replace(STRUCTURE, impactors=[ball], stops=()), elements=4), 2)
    bare = fi.reduce(fi.assemble(replace(STRUCTURE, stops=()), elements=4), 2)
    replaced = replace(bare, contacts=[replace(bare.contacts[0], mass=6e-3, law=law)])
    one, other = (fi.integrate(s, BASE, fi.Newmark(1e-4), 0.5)["tip"] for s in (assembled, replaced))
    np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("name", NOUNS)
def test_a_copy_of_a_noun_is_one(name):
    noun = NOUNS[name]()
    again = replace(noun)
    for item in fields(noun):
        kept, copied = getattr(noun, item.name), getattr(again, item.name)
        assert copied is kept or np.array_equal(copied, kept, equal_nan=False) or item.name == "computed_together"


# how many dofs there are, a state does not know
RECORDS = [name for name in NOUNS if name != "State" and any("axes" in item.metadata for item in fields(NOUNS[name]()))]


@pytest.mark.parametrize("name", RECORDS)
def test_columns_of_a_record_stay_equally_long(name):
    noun = NOUNS[name]()
    columns = [item for item in fields(noun) if item.metadata.get("axes") and getattr(noun, item.name) is not None]
    shared = [
        item for item in columns if sum(item.metadata["axes"][0] in other.metadata["axes"] for other in columns) > 1
    ]
    for item in shared:
        longer = np.concatenate([getattr(noun, item.name)] * 2 + [np.ones_like(getattr(noun, item.name))[:1]])
        with pytest.raises(fi.InputError):
            replace(noun, **{item.name: longer})


@pytest.mark.parametrize("made", SYSTEMS)
def test_a_copied_or_pickled_system_still_knows_what_goes_together(made):
    whole = SYSTEMS[made]()
    for other in (copy.copy(whole), copy.deepcopy(whole), pickle.loads(pickle.dumps(whole))):
        assert replace(other, contacts=()).dofs == whole.dofs
        with pytest.raises(fi.InputError, match="K: cannot be replaced"):
            replace(other, K=doubled(other.K))


def test_a_system_is_not_made_by_hand():
    whole = system()
    parts = {item.name: getattr(whole, item.name) for item in fields(whole) if item.name != "computed_together"}
    for more in ({}, {"computed_together": None}):
        with pytest.raises(fi.InputError, match=r"computed_together = .*System\.from_matrices"):
            fi.System(**parts, **more)


def test_a_response_names_only_what_its_system_has():
    whole = response()
    for changes in (
        {"system": fi.without_impactors(small())},
        {"units": {}},
        {"channels": {}},
        {"energy": None},
        {"time": whole.time + 1.0},
        {"statistics_of": {}},
    ):
        if changes in ({"energy": None}, {"channels": {}}):
            # a run without ledger, and one whose history went to a sink, are such
            assert replace(whole, **changes).impacts is whole.impacts
            continue
        with pytest.raises(fi.InputError):
            replace(whole, **changes)


UNUSUAL = [None, 1.0, "word", (1, 2), 1j, np.float32(0.5), np.arange(3), lambda: None, LAW, 10**400]


@pytest.mark.parametrize("value", UNUSUAL, ids=[type(value).__name__ for value in UNUSUAL])
def test_errors_survive_pickling_and_copying(value):
    error = InputError(
        [Fault("key", value, "m", "must be a finite number > 0 m"), Fault("other", None, "", "is missing")]
    )
    for again in (pickle.loads(pickle.dumps(error)), copy.copy(error), copy.deepcopy(error)):
        assert type(again) is InputError
        assert str(again) == str(error)
        assert len(str(again).splitlines()) == 2
        assert [fault.key for fault in again.faults] == ["key", "other"]
    for kind in (fi.FemimpactError, fi.DivergenceError):
        again = pickle.loads(pickle.dumps(kind("grew past every bound")))
        assert (type(again), str(again)) == (kind, "grew past every bound")
