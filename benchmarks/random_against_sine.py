"""CPU time of a minute of random motion beside a sine with as many impacts: `random_against_sine.py [PAIRS]`.

The paper's beam on 8 modes with a rigid ball, the energy balance on, both runs read as often as a random run is where
nothing else is asked for, then every millisecond. The density is flat from 5 to 100 Hz at 0.001 g^2/Hz. The amplitude
of the sine (5 Hz) is the first of a scan whose impacts are within 10 % of the random run's. Both runs take turns, each
on a new excitation, which has no closed form before. Printed are medians.
"""

from __future__ import annotations

import statistics
import sys
from dataclasses import replace

import numpy as np
from timing import timed

import femimpact as fi
from femimpact.app.demo import paper_study
from femimpact.excitation.excitation import Excitation

GRAVITY, DURATION, SHARE = 9.80665, 60.0, 0.10
COARSE = fi.Recorder(channels=("tip",), interval=1e-3)


def paper_system(modes: int = 8) -> fi.System:
    """The paper's beam with a rigid ball."""
    structure = paper_study().structure
    ball = replace(structure.impactors[0], contact=fi.Rigid(restitution=0.6))
    return fi.reduce(fi.assemble(replace(structure, impactors=(ball,)), elements=20), modes=modes)


def random_base(seed: int = 1) -> fi.RandomBase:
    """Flat random motion of the base."""
    density = 1e-3 * GRAVITY**2
    return fi.RandomBase([(5.0, density), (100.0, density)], DURATION, seed=seed)


def sine_with(impacts: int, system: fi.System) -> fi.Sine:
    """The sine of 5 Hz whose impacts are within 10 % of a number.

    Raises
    ------
    RuntimeError
        If no amplitude of the scan has as many.
    """
    for amplitude in np.geomspace(1e-4, 1e-3, 60):
        base = fi.Sine(float(amplitude), 5.0)
        found = len(fi.integrate(system, base, fi.EventDriven(), DURATION, COARSE).impacts)
        if abs(found / impacts - 1.0) <= SHARE:
            return base
    raise RuntimeError(f"no sine of the scan has {impacts} impacts within {100 * SHARE:g} %")


def default_record(system: fi.System) -> fi.Recorder:
    """A recorder that reads as often as a random run is read where nothing else is asked for."""
    run = fi.integrate(system, random_base(), fi.EventDriven(), 0.1, fi.Recorder(channels=("tip",)))
    # of a minute the ledger alone takes more than the limit
    return replace(COARSE, interval=float(run.time[1] - run.time[0]), memory_limit=4e9)


def compared(system: fi.System, record: fi.Recorder, sine: fi.Sine, pairs: int) -> str:
    """The medians of some pairs of runs in words."""

    def run(base: Excitation) -> fi.response.Response:
        return fi.integrate(system, base, fi.EventDriven(), DURATION, record)

    rows = []
    for _ in range(pairs):
        # what a history keeps of itself is made again
        drive = random_base()
        making, _, form = timed(lambda drive=drive: drive.closed_form)
        shaken, _, one = timed(lambda drive=drive: run(drive))
        swinging, _, other = timed(lambda: run(replace(sine)))
        rows.append((making, shaken, swinging, (making + shaken) / swinging))
    making, shaken, swinging, ratio = (statistics.median(column) for column in zip(*rows, strict=True))
    pieces = form.knots.size - 1
    return (
        f"{one.time.size:,} and {other.time.size:,} readings\n"
        f"random: {making:.3f} s to make {pieces:,} polynomials, {shaken:.3f} s to run, {len(one.impacts)} impacts, "
        f"residual {one.energy.residual:.1e}\n"
        f"sine of {1e3 * sine.amplitude:.3g} mm: {swinging:.3f} s, {len(other.impacts)} impacts, "
        f"residual {other.energy.residual:.1e}\n"
        f"median ratio of {pairs} pairs: {ratio:.2f}; {(pieces + one.time.size) / other.time.size:.2f} times as many "
        "intervals, as a run stops at readings and at knots\n"
    )


def main(pairs: int = 9) -> None:
    """Print both comparisons."""
    system = paper_system()
    sine = sine_with(len(fi.integrate(system, random_base(), fi.EventDriven(), DURATION, COARSE).impacts), system)
    for record in (default_record(system), COARSE):
        print(compared(system, record, sine, pairs))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]))
