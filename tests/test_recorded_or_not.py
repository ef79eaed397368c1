"""What is recorded changes no bit of the motion: every kind of excitation, law and method, by short runs."""

from dataclasses import fields

import numpy as np
import pytest
from builders import REFERENCE, SHORT_EXCITATIONS, reduced, with_ball

import femimpact as fi

pytestmark = pytest.mark.impacts

SOFT = fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
WAYS = {
    "event-driven kelvin-voigt": (fi.EventDriven(), SOFT),
    "event-driven rigid": (fi.EventDriven(), fi.Rigid(0.6)),
    "newmark kelvin-voigt": (fi.Newmark(1e-4), SOFT),
    "newmark hertz": (fi.Newmark(2e-5), fi.Hertz(1e6)),
    "newmark energy-consistent": (fi.Newmark(1e-4, contact="energy-consistent"), SOFT),
    "newmark refined": (fi.Newmark(2e-4, refine=4), SOFT),
    "hht hunt-crossley": (fi.HHT(2e-5), fi.HuntCrossley(1e6, 0.7)),
    "wbz flores": (fi.WBZ(2e-5), fi.contact.Flores(1e6, 0.7)),
    "generalised alpha custom": (fi.GeneralizedAlpha(1e-4), fi.CustomLaw(lambda depth, rate, speed: 2e3 * depth)),
    "newmark switching spring": (fi.Newmark(1e-4), fi.contact.SwitchingSpring(1.0, 2e3)),
    "moreau-jean rigid": (fi.MoreauJean(1e-4), fi.Rigid(0.6)),
}
"""Methods, each with laws that it takes."""

CHANNELS = (
    "tip", "mid", "tip.velocity", "tip.acceleration", "tip.absolute_acceleration", "ball", "ball.velocity", "gap",
    "contact_force", "root.surface_stress", "root.reaction_force", "shaker_force",
)  # fmt: skip
RECORDERS = {
    "nothing": fi.Recorder((), ledger=False),
    "all channels": fi.Recorder(CHANNELS),
    "few samples": fi.Recorder(("ball",), every=7, start=0.1),
    "snapshots": fi.Recorder(("mid", "tip"), snapshots=11, ledger=False),
    "few impacts": fi.Recorder(("tip.acceleration",), impacts=1),
}
SUMS_OF_THE_LEDGER = ("energy_loss", "energy_to_modes")
"""Of an impact: parts between readings where energies are read, and the contact as a whole where they are not."""


def rows(table):
    """Columns of a table of impacts or sticking phases."""
    return {
        item.name: getattr(table, item.name)
        for item in fields(table)
        if isinstance(getattr(table, item.name), np.ndarray) and item.name not in SUMS_OF_THE_LEDGER
    }


@pytest.mark.parametrize("excitation", SHORT_EXCITATIONS.values(), ids=SHORT_EXCITATIONS.keys())
@pytest.mark.parametrize(("method", "law"), WAYS.values(), ids=WAYS.keys())
def test_a_motion_has_the_same_bits_whatever_is_recorded(method, law, excitation):
    system = reduced(with_ball(REFERENCE, contact=law, gap=0.5e-3), 8, 10)
    runs = [fi.integrate(system, excitation, method, 0.2, record) for record in RECORDERS.values()]
    # read once more with the largest values found before
    found = [run.largest_of(("tip", "contact_force")) for run in (runs[0], runs[1])]
    assert found[0] == found[1]
    runs.append(fi.integrate(system, excitation, method, 0.2, RECORDERS["nothing"]))
    first = runs[0]
    assert len(first.impacts) >= 1
    for run, what in zip(runs, (*RECORDERS, "after largest"), strict=True):
        for name in ("displacement", "velocity", "ball_displacement", "ball_velocity"):
            own, same = (getattr(each.final_state, name) for each in (run, first))
            np.testing.assert_array_equal(own, same, err_msg=f"{what}: {name}")
        assert len(run.impacts) + run.impacts.dropped == len(first.impacts), what
        # phases that last stand behind those that the table holds
        for table in ("impacts",) if run.impacts.dropped else ("impacts", "sticking"):
            for name, own in rows(getattr(run, table)).items():
                same = rows(getattr(first, table))[name]
                np.testing.assert_array_equal(own, same[: own.shape[0]], err_msg=f"{what}: {name}")
        for item in fields(run.statistics):
            np.testing.assert_array_equal(
                getattr(run.statistics, item.name), getattr(first.statistics, item.name), err_msg=what
            )
    # what two of them have both read, of which the rows are products of matrices of another shape
    for name, other in (("tip", runs[3]), ("tip.acceleration", runs[4])):
        size = np.abs(other[name]).max()
        np.testing.assert_allclose(runs[1][name], other[name], rtol=0, atol=1e-13 * size, err_msg=name)
