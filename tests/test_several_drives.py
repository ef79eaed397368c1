"""Several drives at once: closed forms, references with impacts, the work of each, and what is refused."""

from __future__ import annotations

import dataclasses
import math

import mpmath as mp
import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
import xarray
from builders import REFERENCE, history_writer, reduced
from reference_events import Oscillator

import femimpact as fi
from femimpact.excitation.drives import until
from femimpact.excitation.remarks import motion_notes
from femimpact.integrators.channel_rows import drive_of

BASE = fi.Sine(1e-3, 5.0, 0.3)
RECORD = fi.RecordedBase(np.random.default_rng(4).normal(size=150), 0.02)
CHIRP = fi.PointForce("mid", fi.Chirp(3.0, 30.0, 2.0, acceleration=0.05), name="coil")
BLOW = fi.HammerBlow("tip", impulse=0.002, duration=0.003, begin=0.2)
SHOCK = fi.PointForce("tip", fi.Shock("trapezoid", 0.4, 0.05))
SINES = BASE + fi.PointForce("mid", fi.Sine(0.01, 5.0, 0.9)) + fi.PointForce("tip", fi.Sine(0.02, 5.0, -0.9))
MIXED = {
    "sine and chirp": BASE + CHIRP,
    "sine, chirp and blow": BASE + CHIRP + BLOW,
    "sines of one frequency": SINES,
    "sines of two frequencies": BASE + fi.PointForce("mid", fi.Sine(0.01, 7.0)),
    "record and blow": RECORD + BLOW,
    "forces at two places": CHIRP + BLOW + SHOCK,
    "two blows at one place": BLOW + fi.HammerBlow("tip", -0.001, 0.004, 0.25, name="second"),
    "records at two places": RECORD + fi.PointForce("tip", RECORD),
}
CHIRP_60 = fi.Chirp(4.0, 6.0, 60.0, amplitude=2e-4)
TWO_GRIDS = {
    "chirp and sine": CHIRP_60 + fi.PointForce("tip", fi.Sine(1e-3, 4.3)),
    "sum of chirp and sine": CHIRP_60 + fi.Sine(1e-4, 4.3),
    "two chirps": CHIRP_60 + fi.PointForce("tip", fi.Chirp(4.5, 6.5, 60.0, amplitude=1e-3)),
    "stepped sine and sine": fi.SteppedSine([4.0, 5.0, 6.0], 80, amplitude=2e-4)
    + fi.PointForce("tip", fi.Sine(1e-3, 4.3)),
    "record and sine": fi.RecordedBase(np.random.default_rng(0).normal(size=12_000), 0.005)
    + fi.PointForce("tip", fi.Sine(1e-3, 4.3)),
    "two records": fi.RecordedBase(np.random.default_rng(0).normal(size=12_000), 0.005)
    + fi.PointForce("tip", fi.RecordedBase(np.random.default_rng(1).normal(size=8_400), 0.0071)),
}
"""Whose knots, of 60 s, lie next to one another by chance."""
RECORDER = fi.Recorder(("tip", "mid", "mid.acceleration", "shaker_force", "root.bending_moment"), interval=2.5e-3)


def structure(law=None, *, stops=(), **more):
    """The reference beam, with a ball at its tip where there is a law."""
    balls = () if law is None else [fi.Impactor("ball", "tip", 3.43e-3, 1e-3, law)]
    return dataclasses.replace(REFERENCE, impactors=tuple(balls), stops=tuple(stops), **more)


def run(system, drive, duration=1.0, method=None, **more):
    """Event-driven by default."""
    return fi.integrate(system, drive, method or fi.EventDriven(), duration, more.pop("record", RECORDER), **more)


@pytest.mark.parametrize("name", MIXED)
def test_the_linear_motion_is_the_sum_of_the_motions_under_each_drive(name):
    """Of another closed form each: the harmonic, the broken line, the polynomials of each drive alone."""
    system, drive = reduced(structure(), 4), MIXED[name]
    together, alone = run(system, drive), [run(system, each) for each in drive.drives]
    for channel in RECORDER.channels:
        expected = sum(each[channel] for each in alone)
        # polynomials of a sine are within 1e-11 of it; an acceleration of the 4th mode magnifies nothing of that
        atol = 2e-11 * max(np.abs(each[channel]).max() for each in alone)
        np.testing.assert_allclose(together[channel], expected, rtol=0.0, atol=atol, err_msg=channel)


def forms_until(drive, end):
    """Closed forms of several drives, or of a sum, up to a time (s)."""
    drive = until(drive, end)
    return drive.closed_forms if isinstance(drive, fi.excitation.Drives) else (drive.closed_form,)


@pytest.mark.parametrize("name", TWO_GRIDS)
def test_pieces_between_near_knots_change_no_faster_than_those_of_a_drive_alone(name):
    """What a run costs follows the number of pieces and the rate at which they change."""
    drive, system = TWO_GRIDS[name], reduced(structure(), 2)
    forms = forms_until(drive, 60.0)
    shortest = np.diff(forms[0].knots).min()
    assert shortest < 0.05 * np.median(np.diff(forms[0].knots))
    alone = drive.drives if isinstance(drive, fi.excitation.Drives) else drive.parts
    own = [drive_of(system, each) for each in alone]
    # of a sine in pieces, 47 in a cycle; a straight record beside polynomials counts by its slope
    sizes = [load.closed_form.omega if load.is_sine else load.pieces.rate for load in own]
    slopes = [2.0 / load.line.interval for load in own if load.line is not None]
    assert max(form.rate for form in forms) <= 1.1 * max(sizes + slopes)
    counts = [47.0 * 60.0 * each.frequency if load.is_sine else load.pieces.knots.size
              for each, load in zip(alone, own, strict=True)]  # fmt: skip
    assert forms[0].knots.size <= sum(counts) + 4


@pytest.mark.parametrize("name", ["chirp and sine", "two chirps"])
def test_pieces_between_near_knots_lose_no_digits(name):
    system, drive = fi.reduce(fi.assemble(structure(), elements=12), modes=4), TWO_GRIDS[name]
    record = fi.Recorder(("tip", "tip.velocity"), interval=2.5e-3, ledger=False)
    together, *alone = (run(system, each, 5.0, record=record) for each in (drive, *drive.drives))
    for channel in record.channels:
        expected = sum(each[channel] for each in alone)
        # rounding of 2000 readings; a sine within 1e-11, whose integral over a piece is exact to order 12
        atol = 1e-12 * np.abs(expected).max()
        np.testing.assert_allclose(together[channel], expected, rtol=0.0, atol=atol, err_msg=channel)


OMEGA, ZETA, MASS, BALL, GAP, RESTITUTION = 10.0 * math.pi, 0.01, 1.0, 0.1, 1e-3, 0.7


@pytest.mark.impacts
@pytest.mark.parametrize("frequency", [5.0, 8.0])
def test_the_first_twelve_impacts_under_base_and_force_are_those_of_30_digits(frequency):
    """Sines of one frequency stay sines; of two they are polynomials, within 1e-11 of them."""
    ball = fi.Impactor("ball", at="mass", mass=BALL, gap=GAP, contact=fi.Rigid(restitution=RESTITUTION))
    whole = fi.System.from_matrices(
        [[MASS]], [[2.0 * ZETA * OMEGA * MASS]], [[OMEGA**2 * MASS]], points={"mass": [1.0]}, impactors=[ball]
    )
    base, push = fi.Sine(2e-4, 5.0, 0.4), fi.PointForce("mass", fi.Sine(0.3, frequency, 1.1))
    w, f = 2 * mp.pi * 5, 2 * mp.pi * mp.mpf(frequency)
    exact = Oscillator(
        OMEGA, ZETA, MASS, BALL, GAP, RESTITUTION,
        lambda t: -mp.mpf(2e-4) * w**2 * mp.sin(w * t + mp.mpf(0.4)),
        lambda t: mp.mpf(0.3) * mp.sin(f * t + mp.mpf(1.1)),
    ).impacts(np.linspace(0.05, 3.0, 60), 12)  # fmt: skip
    found = run(fi.reduce(whole, modes=1), base + push, 3.0, record=fi.Recorder("mass")).impacts
    time, side, speed = (np.array(column) for column in zip(*exact, strict=True))
    # the twelfth impact comes (8 Hz) by 370 e/omega earlier or later under a force that is larger by a share e: of
    # rounding and of polynomials, 1e-14 in the integrals over their pieces, there is 4e-12 then
    np.testing.assert_array_equal(found.side[:12], side)
    np.testing.assert_allclose(found.time[:12], time, rtol=0.0, atol=1e-11 / OMEGA)
    np.testing.assert_allclose(found.approach_speed[:12], speed, rtol=0.0, atol=1e-11 * speed.max())


@pytest.mark.impacts
@pytest.mark.parametrize("law", [fi.Rigid(0.6), fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)])
@pytest.mark.parametrize("name", MIXED)
def test_the_energy_balance_closes_and_the_work_of_the_drives_is_all_work(name, law):
    stop = fi.Stop("stop", "mid", 4e-4, law, fixed_to="space")
    system = reduced(structure(law, stops=[stop], gravity=-9.81), 5)
    ledger = run(system, MIXED[name], 1.5).energy
    assert ledger.residual < 1e-9
    assert tuple(ledger.work_of) == (*MIXED[name].names, "constant forces")
    np.testing.assert_allclose(
        sum(ledger.work_of.values()), ledger.work, rtol=0.0, atol=1e-12 * np.abs(ledger.work).max()
    )


@pytest.mark.parametrize("name", ["sines of one frequency", "sine and chirp", "two blows at one place"])
def test_the_work_of_each_drive_is_the_integral_of_its_power(name):
    drive, duration = MIXED[name], 0.5
    record = fi.Recorder(("mid.velocity", "tip.velocity"), interval=duration / 2**15)
    response = run(reduced(structure(), 3), drive, duration, record=record)
    for push in drive.forces:
        power = push.force(response.time) * response[f"{push.at}.velocity"]
        work = scipy.integrate.romb(power, dx=response.time[1])
        named = push.name or f"force {drive.forces.index(push) + 1}"
        # chirps and sines are polynomials within 1e-9; a blow has kinks between samples: (h/T)^2 = 3e-5
        share = 1e-4 if isinstance(push, fi.HammerBlow) else 1e-9
        largest = np.abs(response.energy.work_of[named]).max()
        assert response.energy.work_of[named][-1] == pytest.approx(work, rel=0.0, abs=share * largest)


@pytest.mark.impacts
def test_one_of_drives_alone_has_the_bits_of_that_drive():
    system = reduced(structure(fi.Rigid(0.6)), 3)
    for drive in (BASE, CHIRP, BLOW, RECORD):
        force = getattr(drive, "at", None) is not None
        one, other = (
            run(system, drive),
            run(system, fi.excitation.Drives(forces=[drive]) if force else fi.excitation.Drives(drive)),
        )
        np.testing.assert_array_equal(one["tip"], other["tip"])
        np.testing.assert_array_equal(one.energy.work, other.energy.work)
        assert other.energy.work_of == {}


@pytest.mark.parametrize("name", MIXED)
def test_the_stepped_motion_is_the_sum_of_the_stepped_motions_under_each_drive(name):
    for system in (reduced(structure(), 2), fi.assemble(structure(), elements=3)):
        for method in (fi.Newmark(5e-4), fi.HHT(5e-4)):
            record = fi.Recorder(("tip", "shaker_force"))
            together = run(system, MIXED[name], 1.0, method, record=record)
            alone = [run(system, each, 1.0, method, record=record) for each in MIXED[name].drives]
            for channel in record.channels:
                atol = 1e-10 * max(np.abs(each[channel]).max() for each in alone)
                # rounding of some steps of the fastest dofs; a phase that is turned step by step beside one that is not
                expected = sum(each[channel] for each in alone)
                np.testing.assert_allclose(together[channel], expected, rtol=0.0, atol=atol, err_msg=channel)
            ledger, work = together.energy, sum(together.energy.work_of.values())
            np.testing.assert_allclose(work, ledger.work, rtol=0.0, atol=1e-12 * np.abs(ledger.work).max())


@pytest.mark.impacts
def test_steps_in_physical_dofs_refined_steps_and_impulses_meet_the_exact_impacts():
    """Up to the third impact, before which nothing has grown."""
    soft = fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
    drive, record = MIXED["sine, chirp and blow"], fi.Recorder("tip")
    for law, methods in (
        (soft, [fi.Newmark(1e-5), fi.HHT(1e-5), fi.Newmark(1e-4, refine=10)]), (fi.Rigid(0.6), [fi.MoreauJean(1e-5)])
    ):  # fmt: skip
        system = reduced(structure(law), 3)
        exact = run(system, drive, 0.5).impacts.time[:3]
        assert exact.size == 3
        for method in methods:
            found = run(system, drive, 0.5, method, record=record)
            # a tenth of the contact time
            np.testing.assert_allclose(found.impacts.time[:3], exact, rtol=0.0, atol=2e-4)
            work = sum(found.energy.work_of.values())
            np.testing.assert_allclose(work, found.energy.work, rtol=0.0, atol=1e-11 * np.abs(found.energy.work).max())
    whole = fi.assemble(structure(soft), elements=4)
    small = fi.reduce(whole, modes=whole.dofs)
    one, two = (run(system, drive, 0.3, fi.Newmark(2e-5), record=record) for system in (whole, small))
    # the same steps in another basis
    np.testing.assert_allclose(one["tip"], two["tip"], rtol=0.0, atol=1e-7 * np.abs(one["tip"]).max())


@pytest.mark.impacts
@pytest.mark.parametrize("method", [fi.EventDriven(), fi.Newmark(1e-4)])
@pytest.mark.parametrize("name", ["sine, chirp and blow", "sines of one frequency"])
def test_two_halves_are_one_run(name, method):
    system, drive = reduced(structure(fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)), 3), MIXED[name]
    record = fi.Recorder("tip", interval=2e-3) if isinstance(method, fi.EventDriven) else fi.Recorder("tip")
    whole, first = (run(system, drive, end, method, record=record) for end in (0.6, 0.3))
    second = run(system, drive, 0.3, method, record=record, initial=first.final_state)
    both = np.concatenate([first["tip"], second["tip"][1:]])
    np.testing.assert_allclose(both, whole["tip"], rtol=0.0, atol=1e-11 * np.abs(both).max())


@pytest.mark.impacts
def test_largest_values_are_those_of_a_fine_reading():
    system, drive = reduced(structure(fi.Rigid(0.6)), 3), MIXED["sine, chirp and blow"]
    coarse = run(system, drive, 0.5)
    fine = run(system, drive, 0.5, record=dataclasses.replace(RECORDER, interval=1e-5))
    for channel in ("tip", "mid", "mid.acceleration", "shaker_force"):
        found, read = coarse.largest(channel), np.abs(fine[channel]).max()
        assert abs(found.value) >= read * (1.0 - 1e-9), channel
        # what lies between readings of 1e-5 s, of the third mode at 340 Hz
        assert abs(found.value) <= read * 1.01, channel


def test_an_own_motion_and_an_own_force_are_drives():
    class Ramp:
        """A base that is moved without a closed form."""

        frequency, phase, amplitude, has_cycle = 5.0, math.nan, 1e-3, False

        def displacement(self, time):
            return 1e-3 * np.asarray(time) ** 3

        def velocity(self, time):
            return 3e-3 * np.asarray(time) ** 2

        def acceleration(self, time):
            return 6e-3 * np.asarray(time)

    class Push(Ramp):
        """A force without one."""

        at, amplitude = "tip", 0.0

        def displacement(self, time):
            return 0.0 * np.asarray(time)

        velocity = acceleration = displacement

        def force(self, time):
            return 0.01 * np.asarray(time)

    system = reduced(structure(), 2)
    both = run(system, fi.excitation.Drives(Ramp(), [Push(), BLOW]), 0.5, fi.Newmark(1e-4), record=fi.Recorder("tip"))
    alone = [run(system, each, 0.5, fi.Newmark(1e-4), record=fi.Recorder("tip")) for each in (Ramp(), Push(), BLOW)]
    np.testing.assert_allclose(both["tip"], sum(each["tip"] for each in alone), rtol=0.0, atol=1e-15)
    assert tuple(both.energy.work_of) == ("base", "force 1", "force 2")
    with pytest.raises(fi.InputError, match="must have a closed_form for EventDriven"):
        run(system, fi.excitation.Drives(Ramp(), [Push()]), 0.5)


def test_sines_at_one_place_have_the_phase_of_their_sum():
    """The phases of impacts and of once-per-cycle readings are those under the one force that they are together."""
    sizes, phases = (0.02, 0.013), (0.4, 2.1)
    several = fi.excitation.Drives(
        forces=[fi.PointForce("tip", fi.Sine(size, 5.0, phase)) for size, phase in zip(sizes, phases, strict=True)]
    )
    phasor = sum(size * np.exp(1j * phase) for size, phase in zip(sizes, phases, strict=True))
    one = fi.PointForce("tip", fi.Sine(abs(phasor), 5.0, float(np.angle(phasor))))
    assert several.phase == pytest.approx(float(np.angle(phasor)), rel=1e-12)
    # a base has the phase, where there is one
    assert (BASE + several).phase == BASE.phase
    # forces elsewhere have no part in it
    elsewhere = fi.excitation.Drives(forces=[*several.forces, fi.PointForce("mid", fi.Sine(0.01, 5.0, -1.0))])
    assert elsewhere.phase == pytest.approx(several.phase, rel=1e-12)
    system = reduced(structure(fi.Rigid(0.6)), 2)
    runs = [run(system, drive, 1.0, record=fi.Recorder(("tip",))) for drive in (several, one)]
    assert len(runs[0].impacts) > 3
    for name in ("time", "phase"):
        first, second = (getattr(each.impacts, name)[:4] for each in runs)
        np.testing.assert_allclose(first, second, rtol=1e-9)


NAMED = fi.HammerBlow("tip", 0.1, 1e-3, name="hammer")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: NAMED + NAMED, r"forces.name = 'hammer'.*must differ"),
        (lambda: BLOW + dataclasses.replace(NAMED, name="force 1"), r"forces.name = 'force 1'"),
        (lambda: BASE + dataclasses.replace(NAMED, name="base"), r"forces.name = 'base'"),
        (lambda: dataclasses.replace(NAMED, name="force 2") + BLOW, r"forces without one have.*\"force 2\""),
        (lambda: BASE + dataclasses.replace(NAMED, name="constant forces"), r"forces.name = 'constant forces'"),
        (lambda: dataclasses.replace(NAMED, name="a/b"), r"name = 'a/b'.*or a slash"),
        (lambda: fi.excitation.Drives(BASE + NAMED, [BLOW]), r"base = 'Drives'.*adds to several drives"),
        (lambda: fi.excitation.Drives(BASE, [BASE + NAMED]), r"forces = 'Drives'"),
        (lambda: fi.excitation.Sum((BASE + NAMED, fi.Sine(1e-4, 6.0))), r"parts = 'Drives'.*adds to several drives"),
        (lambda: fi.PointForce("tip", BASE + NAMED), r"history = 'Drives'.*must be a Sine"),
        (lambda: fi.excitation.Sum(BASE), r"parts.*a list or a tuple of motions of the base"),
        (lambda: dataclasses.replace(NAMED, name="a.b"), r"name = 'a.b'.*without a dot"),
        (lambda: fi.PointForce("tip", BASE, name=""), r"name"),
        (lambda: fi.PointForce("tip", BASE, name=3), r"name"),
        (fi.excitation.Drives, r"forces.*must be one or more"),
        (lambda: fi.excitation.Drives(NAMED), r"base = .*is one of forces"),
        (lambda: fi.excitation.Drives(BASE, [BASE]), r"forces = .*is the base"),
        (lambda: fi.excitation.Drives(BASE, [3.0]), r"forces"),
        (lambda: fi.excitation.Drives(3.0), r"base"),
        (lambda: fi.excitation.Drives(BASE, NAMED),
            r"forces.*a list or a tuple of PointForce, HammerBlow and other forces"),
    ],
)  # fmt: skip
def test_what_drives_cannot_be_is_refused_in_one_line(make, words):
    with pytest.raises(fi.InputError, match=words) as refusal:
        make()
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("force", [fi.HammerBlow("tip", 2e-3, 3e-3, 0.5), fi.PointForce("mid", fi.Sine(0.01, 3.1))])
def test_a_base_of_two_sines_goes_on_to_the_end_beside_a_force_that_ends_later(force):
    # the pieces of the base end shortly after the run, those of the force much later, or of another length
    base, system = fi.Sine(2e-4, 5.0) + fi.Sine(1e-4, 7.1), reduced(structure(), 3)
    both, alone, forced = (run(system, drive, 0.4) for drive in (base + force, base, force))
    expected = alone["tip"] + forced["tip"]
    # of polynomials, within 1e-11 of a sine
    np.testing.assert_allclose(both["tip"], expected, rtol=0.0, atol=2e-11 * np.abs(expected).max())
    assert both.base.closed_forms[0].knots[-1] >= 0.4


@pytest.mark.parametrize(("start", "interval"), [(0.0, 1e-3), (3.0, 1e-3), (0.0, 0.7), (14.0, 1e-2)])
@pytest.mark.parametrize("drive", [BLOW, fi.Shock("half-sine", 10.0, 0.01), BLOW + BLOW, fi.Chirp(3.0, 8.0, 2.0, 1e-3)])
def test_damping_takes_all_work_of_a_drive_that_has_ended(drive, start, interval):
    omega, ratio = 2.0 * math.pi * 5.0, 0.04
    system = fi.System.from_matrices([[1.0]], [[2.0 * ratio * omega]], [[omega**2]], points={"tip": [1.0]})
    response = run(system, drive, 15.0, record=fi.Recorder(("tip",), interval=interval, start=start))
    ledger = response.energy
    # the energy falls by e^(-2 ratio omega 13 s) = e^-32 after the end
    assert ledger.structure_loss[-1] == pytest.approx(ledger.work[-1], rel=1e-12)
    assert not [text for text in response.warnings if "energy" in text]
    # losses do not fall
    assert np.all(np.diff(ledger.structure_loss) >= 0.0)


@pytest.mark.parametrize("method", [fi.EventDriven(), fi.Newmark(1e-4)])
def test_the_work_of_each_drive_is_in_datasets_pieces_and_what_a_sink_leaves(method, tmp_path):
    system, drive = reduced(structure(gravity=-9.81), 2), MIXED["sine, chirp and blow"]
    ledger = run(system, drive, 1.0, method, record=fi.Recorder("tip")).energy
    names = (*drive.names, "constant forces")
    whole = run(system, drive, 1.0, method, record=fi.Recorder("tip")).to_xarray()
    for name in names:
        np.testing.assert_array_equal(whole[f"energy_work_of_{name}"], ledger.work_of[name])
        assert whole[f"energy_work_of_{name}"].attrs["units"] == "J"
    with history_writer(tmp_path / "history.nc") as sink:
        record = fi.Recorder("tip", sink=sink, piece_samples=256)
        left = run(system, drive, 1.0, method, record=record).energy
    written = xarray.load_dataset(tmp_path / "history.nc", engine="h5netcdf")
    for name in names:
        # a run in pieces sums in another order
        atol = 1e-13 * np.abs(ledger.work).max()
        np.testing.assert_allclose(written[f"energy_work_of_{name}"], ledger.work_of[name], rtol=0.0, atol=atol)
        rows = np.isin(written["time"], left.time)
        np.testing.assert_array_equal(left.work_of[name], written[f"energy_work_of_{name}"][rows])
        assert f"work_of_{name}" in left.to_pandas()
    one = run(system, BASE, 1.0, method, record=fi.Recorder("tip", sink=lambda piece: None)).energy
    assert one.work_of == {}


def test_a_drive_that_begins_after_the_end_of_a_run_has_a_note_by_its_name():
    system, late = reduced(structure(), 2), dataclasses.replace(NAMED, begin=5.0)
    notes = run(system, BASE + late, 1.0).notes
    assert 'the run ends at 1 s, before "hammer" begins at 5 s: it does not act' in notes
    assert not any("nothing drives it" in note for note in notes)
    assert any("nothing drives it" in note for note in run(system, late, 1.0).notes)


@pytest.mark.parametrize(
    ("drive", "which"),
    [
        (CHIRP, "the force"),
        (BASE + CHIRP, '"coil"'),
        (fi.Chirp(3.0, 30.0, 2.0, acceleration=0.05) + BASE, "part 1"),
        (fi.PointForce("tip", fi.RecordedBase(RECORD.samples[:101], 0.02)), "the force"),
    ],
)
def test_a_force_or_a_part_that_ends_before_the_run_has_a_note_and_a_pulse_has_none(drive, which):
    assert f"the run ends at 3 s, {which} at 2 s: from there on it does not act" in motion_notes(drive, 0.2, 3.0)
    for end in (1.0, 2.0):
        assert not any("does not act" in note for note in motion_notes(drive, 0.2, end))
    assert not any("does not act" in note for note in motion_notes(BASE + BLOW + SHOCK, 0.2, 3.0))
