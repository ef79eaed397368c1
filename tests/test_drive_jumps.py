"""Methods that take steps keep their order 2 where the drive jumps, between two steps or at one."""

from __future__ import annotations

import numpy as np
import pytest
from builders import REFERENCE, oscillator

import femimpact as fi
from femimpact.integrators.channel_rows import drive_of

SMALL = fi.reduce(fi.without_impactors(fi.assemble(REFERENCE, elements=20)), 2)
END, KEPT = 0.4, 8e-4
SAWTOOTH = fi.Shock("terminal-sawtooth", 50.0, 0.0110003)
JUMPS = {
    "between steps": SAWTOOTH,
    "at a step": fi.Shock("terminal-sawtooth", 50.0, 0.0112),
    "compensated": fi.Shock("terminal-sawtooth", 50.0, 0.0110003, compensated=True),
    "end of a record": fi.RecordedBase(5 * np.cos(2 * np.pi * 3 * np.arange(0, 0.2, 0.00137)), 0.00137),
    "end of a chirp": fi.Chirp(3.0, 9.0, 0.3007, acceleration=3.0),
    "changes of frequency": fi.SteppedSine([5.0, 7.0, 6.0], 1, amplitude=0.003),
    "end of the last cycle": fi.SteppedSine([5.0, 7.0], 1, acceleration=3.0),
    "sum": SAWTOOTH + fi.Sine(0.001, 5.0),
    "force": fi.PointForce("tip", fi.Shock("terminal-sawtooth", 5.0, 0.0110003)),
}
SMOOTH = {
    "half-sine": fi.Shock("half-sine", 50.0, 0.0110003),
    "trapezoid": fi.Shock("trapezoid", 50.0, 0.0110003),
    "record": fi.RecordedBase(np.sin(np.pi * np.arange(101) / 50), 0.003),
    "random": fi.RandomBase([(2.0, 0.05), (20.0, 0.05)], 1.0, seed=3),
    "sine": fi.Sine(0.01, 5.0),
}


def tip(drive, method, every=1):
    record = fi.Recorder(channels=("tip",), every=every)
    return fi.integrate(SMALL, drive, method, END, record)


def exact(drive):
    run = fi.integrate(SMALL, drive, fi.EventDriven(), END, fi.Recorder(channels=("tip",), interval=KEPT / 8))
    return run["tip"][::8]


@pytest.mark.parametrize("name", JUMPS)
@pytest.mark.parametrize("method", [fi.Newmark, fi.HHT, fi.MoreauJean])
def test_the_order_is_two_at_a_jump(name, method):
    try:
        true = exact(JUMPS[name])
    except fi.InputError:
        # a record is read at its own instants
        run = fi.integrate(SMALL, JUMPS[name], fi.Newmark(KEPT / 64), END, fi.Recorder(channels=("tip",), every=64))
        true = run["tip"]
    errors = []
    for every in (2, 8):
        run = tip(JUMPS[name], method(KEPT / every), every)
        errors.append(np.abs(run["tip"] - true).max() / np.abs(true).max())
        # HHT has losses of its own
        assert method is fi.HHT or run.energy.residual < 1e-12
    # a step of a quarter: 16 times less, and 4 times less at order 1
    assert errors[0] / errors[1] > 8.0
    # (omega dt)^2/12 per radian of the second mode, at 33 Hz over a tenth of a second
    assert errors[1] < 1e-3


@pytest.mark.parametrize("name", SMOOTH)
def test_a_drive_without_jumps_is_read_as_it_is(name):
    drive, time = drive_of(SMALL, SMOOTH[name]), 1e-3 * np.arange(400)
    assert np.array_equal(drive.value_at_steps(time), drive.value(time))


@pytest.mark.parametrize("refine", [1, 4])
@pytest.mark.parametrize("name", ["between steps", "end of a record", "changes of frequency"])
def test_the_impulse_is_that_of_the_drive_wherever_the_jump_lies(name, refine):
    free, drive = oscillator(0.0), JUMPS[name]
    for dt in np.linspace(0.0003, 0.0011, 9):
        run = fi.integrate(free, drive, fi.Newmark(dt, refine=refine), END, fi.Recorder(channels=("mass.velocity",)))
        size = np.abs(drive.velocity(run.time)).max()
        # behind the last jump; of smooth parts the trapezoids miss some dt^2, of a jump read as it is 2 % here
        assert abs(run["mass.velocity"][-1] + drive.velocity(run.time[-1])) < 1e-3 * size


def test_a_run_cut_beside_a_jump_goes_on_with_the_bits_of_the_whole():
    dt = 4e-4
    whole = fi.integrate(SMALL, SAWTOOTH, fi.Newmark(dt), 100 * dt)
    jump = round(SAWTOOTH.duration / dt)
    for cut in range(jump - 2, jump + 3):
        first = fi.integrate(SMALL, SAWTOOTH, fi.Newmark(dt), cut * dt)
        rest = fi.integrate(SMALL, SAWTOOTH, fi.Newmark(dt), (100 - cut) * dt, initial=first.final_state)
        joined = np.concatenate([first["tip"], rest["tip"][1:]])
        assert np.array_equal(joined, whole["tip"])


def test_a_sum_of_sines_has_no_jump_at_the_end_of_a_run():
    both = fi.Sine(0.001, 5.0) + fi.Sine(0.0005, 7.0, 1.0)
    # rounded to whole steps, the run ends up to half a step after what is asked for
    for duration in np.linspace(0.1, 0.11, 40):
        run = fi.integrate(SMALL, both, fi.Newmark(1.3e-3), duration, fi.Recorder(channels=("tip",)))
        longer = fi.integrate(SMALL, both, fi.Newmark(1.3e-3), 0.2, fi.Recorder(channels=("tip",)))
        assert np.allclose(run["tip"], longer["tip"][: run.time.size], rtol=0.0, atol=1e-9)
