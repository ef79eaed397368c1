"""A run in parts is the whole, wherever it is cut, under every drive that begins late or ends early."""

import itertools
import math

import numpy as np
import pytest
from test_piecewise_polynomial import Own, in_a_box

import femimpact as fi

pytestmark = pytest.mark.impacts

INTERVAL, DT, END = 2e-3, 1e-4, 0.25
LATE = Own(fi.excitation.PiecewisePolynomial([0.05, 0.06, 0.08], [[0.0, 2e3, 0.0], [20.0, -1e3, 0.0]]))
"""From 0.05 to 0.08 s, with a jump at its end."""
RECORD = fi.RecordedBase([5.0, 8.0, -3.0, 12.0, -9.0], 0.02)
SHORT = {
    "chirp": fi.Chirp(20.0, 40.0, 0.08, acceleration=10.0),
    "stepped": fi.SteppedSine((20.0, 50.0), 1, acceleration=60.0),
    "random": fi.RandomBase([(10.0, 2.0), (60.0, 2.0)], 0.08, seed=3),
    "random amplitudes": fi.RandomBase([(10.0, 2.0), (60.0, 2.0)], 0.08, seed=3, amplitudes="random"),
    "half-sine": fi.Shock("half-sine", acceleration=20.0, duration=0.08),
    "sawtooth": fi.Shock("terminal-sawtooth", acceleration=20.0, duration=0.08),
    "compensated": fi.Shock("trapezoid", acceleration=40.0, duration=0.004, compensated=True),
    "record": RECORD,
    "late": LATE,
    "late and early": fi.excitation.Sum((LATE, fi.Shock("half-sine", acceleration=5.0, duration=0.03))),
    "late and sines": fi.excitation.Sum((LATE, fi.Sine(1e-3, 5.0), fi.Sine(2e-3, 7.0, 0.3))),
    "sum of a sum": fi.excitation.Sum((fi.excitation.Sum((fi.Sine(3e-3, 7.0), RECORD)), LATE)),
}  # fmt: skip
DRIVES = {
    **SHORT,
    **{f"force: {name}": fi.PointForce("mass", history) for name, history in SHORT.items()},
    "blow": fi.HammerBlow("mass", 0.2, 0.03, begin=0.05),
    "blow at once": fi.HammerBlow("mass", -0.2, 0.03),
    "blow within a reading": fi.HammerBlow("mass", 0.2, 5e-4, begin=0.0513),
}  # fmt: skip
CUTS = {
    "before": (0.02,), "at the begin": (0.05,), "inside": (0.062,), "at the end": (0.08,), "after": (0.15,),
    "many": (0.02, 0.04, 0.052, 0.08, 0.1),
}  # fmt: skip
LAWS = {"rigid": fi.Rigid(restitution=0.7), "compliant": fi.KelvinVoigt(restitution=0.7, contact_time=4e-3)}
METHODS = {
    "event-driven": (fi.EventDriven(), fi.Recorder(interval=INTERVAL)),
    "Newmark": (fi.Newmark(DT), fi.Recorder(every=round(INTERVAL / DT))),
}


@pytest.mark.parametrize("name", DRIVES)
@pytest.mark.parametrize(
    ("law", "method"), [("rigid", "event-driven"), ("compliant", "event-driven"), ("compliant", "Newmark")]
)
def test_parts_are_the_whole_wherever_they_are_cut(name, law, method):
    (by, record), drive, box = METHODS[method], DRIVES[name], in_a_box(contact=LAWS[law])
    whole = fi.integrate(box, drive, by, END, record)
    assert len(whole.impacts) > 0
    for cuts in CUTS.values():
        state, parts = None, []
        for first, last in zip((0.0, *cuts), (*cuts, END), strict=True):
            parts.append(fi.integrate(box, drive, by, last - first, record, state))
            state = parts[-1].final_state
        for channel in ("mass", "ball"):
            joined = np.concatenate([parts[0][channel], *(part[channel][1:] for part in parts[1:])])
            # each impact multiplies rounding by some ten
            assert np.abs(joined - whole[channel]).max() < 1e-9 * np.abs(whole[channel]).max()
        assert sum(len(part.impacts) for part in parts) == len(whole.impacts)
        assert not any("begins anew" in note for part in parts for note in part.notes)


KINDS = {
    "sine": fi.Sine(0.4e-3, 4.0, 0.5), "slow sine": fi.Sine(0.08, 0.3),
    **{name: SHORT[name] for name in ("chirp", "stepped", "half-sine", "record", "late")},
    "last": Own(fi.excitation.PiecewisePolynomial([0.14, 0.144, 0.148], [[0.0, 0.0, 3e6], [48.0, -12e3, 0.0]])),
}  # fmt: skip
WAYS = {
    "base": lambda a, b: fi.excitation.Sum((a, b)),
    "force": lambda a, b: fi.PointForce("mass", fi.excitation.Sum((a, b))),
    "base and force": lambda a, b: a + fi.PointForce("mass", b),
    "base and blow": lambda a, b: fi.excitation.Sum((a, b)) + fi.HammerBlow("mass", 0.2, 0.01, begin=0.13),
}  # fmt: skip


def several_motions(contact=None):
    """Motions slower and faster than any drive, one of them critically damped, and a ball where it has a contact."""
    rates = np.geomspace(1.5, 400.0, 10)
    balls = [fi.Impactor("ball", at="mass", mass=0.1, gap=2e-3, contact=contact)] if contact else []
    whole = fi.System.from_matrices(
        np.eye(10), np.diag(np.where(rates == rates[5], 2.0, 0.04) * rates), np.diag(rates**2),
        points={"mass": 1.0 / np.arange(1, 11)}, impactors=balls,
    )  # fmt: skip
    return fi.reduce(whole, modes=10)


def difference_of_parts(system, drive, rng, record):
    """Largest difference of a run cut at three readings from the whole, over the largest reading, and the cuts."""
    whole, state, parts = fi.integrate(system, drive, fi.EventDriven(), END, record), None, []
    readings = round(END / INTERVAL)
    cuts = np.sort(rng.choice(np.arange(1, readings), 3, replace=False))
    for count in np.diff([0, *cuts, readings]):
        parts.append(fi.integrate(system, drive, fi.EventDriven(), INTERVAL * count, record, state))
        state = parts[-1].final_state
    joined = np.concatenate([parts[0]["mass"], *(part["mass"][1:] for part in parts[1:])])
    return np.abs(joined - whole["mass"]).max() / np.abs(whole["mass"]).max(), cuts


@pytest.mark.parametrize("way", WAYS)
def test_sums_of_any_two_kinds_are_cut_at_any_time(way):
    rng, system = np.random.default_rng(len(way)), several_motions()
    for number, (a, b) in enumerate(itertools.combinations_with_replacement(KINDS, 2)):
        record = fi.Recorder(interval=INTERVAL, ledger=number % 2 == 0)
        difference, cuts = difference_of_parts(system, WAYS[way](KINDS[a], KINDS[b]), rng, record)
        assert difference < 1e-12, (a, b, cuts)


@pytest.mark.parametrize("law", LAWS)
def test_sums_are_cut_between_and_within_impacts(law):
    rng, record = np.random.default_rng(1), fi.Recorder(interval=INTERVAL, ledger=True)
    system = several_motions(LAWS[law])
    for other in KINDS:
        drive = WAYS["base and blow"](KINDS["sine"], KINDS[other])
        difference, cuts = difference_of_parts(system, drive, rng, record)
        # each impact multiplies rounding by some ten
        assert difference < 1e-9, (other, cuts)


def test_a_force_does_not_move_the_base_in_words():
    record = fi.PointForce("mass", fi.RecordedBase(np.where(np.arange(100) < 5, 1.0, 0.0), 1e-3))
    run = fi.integrate(in_a_box(), record, fi.EventDriven(), 0.2, fi.Recorder(interval=INTERVAL))
    assert not any("base" in text for text in (*run.notes, *run.warnings))
    assert math.isfinite(run["mass"][-1])
