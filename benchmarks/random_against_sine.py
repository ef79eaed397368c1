"""CPU time of a minute of random motion beside a sine with as many impacts: `random_against_sine.py [PAIRS]`.

The paper's beam on 8 modes with a rigid ball, the energy balance on, 60,001 readings. The density is flat from 5 to
100 Hz at 0.001 g^2/Hz. The amplitude of the sine (5 Hz) is the first of a scan whose impacts are within 10 % of the
random run's. Both runs take turns, each on an excitation of its own, which has no closed form before; what is printed are
medians.
"""

from __future__ import annotations

import statistics
import sys
from dataclasses import replace

import numpy as np
from timing import timed

import femimpact as fi
from femimpact.study.demo import paper_study

GRAVITY, DURATION, SHARE = 9.80665, 60.0, 0.10
RECORD = fi.Recorder(channels=("tip",), interval=1e-3)


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
        found = len(fi.integrate(system, base, fi.EventDriven(), DURATION, RECORD).impacts)
        if abs(found / impacts - 1.0) <= SHARE:
            return base
    raise RuntimeError(f"no sine of the scan has {impacts} impacts within {100 * SHARE:g} %")


def main(pairs: int = 9) -> str:
    """The medians of some pairs of runs in words."""
    system = paper_system()

    def run(base: fi.Excitation) -> fi.Response:
        return fi.integrate(system, base, fi.EventDriven(), DURATION, RECORD)

    random = run(random_base())
    base = sine_with(len(random.impacts), system)
    rows = []
    for _ in range(pairs):
        # what a history keeps of itself is made again
        drive = random_base()
        making, _, form = timed(lambda drive=drive: drive.closed_form)
        shaken, _, one = timed(lambda drive=drive: run(drive))
        swinging, _, other = timed(lambda: run(replace(base)))
        rows.append((making, shaken, swinging, (making + shaken) / swinging))
    making, shaken, swinging, ratio = (statistics.median(column) for column in zip(*rows, strict=True))
    pieces = form.knots.size - 1
    return (
        f"random: {making:.3f} s to make {pieces:,} polynomials, {shaken:.3f} s to run, {len(one.impacts)} impacts, "
        f"residual {one.energy.residual:.1e}\n"
        f"sine of {1e3 * base.amplitude:.3g} mm: {swinging:.3f} s, {len(other.impacts)} impacts, "
        f"residual {other.energy.residual:.1e}\n"
        f"median ratio of {pairs} pairs: {ratio:.2f}; {(pieces + one.time.size) / other.time.size:.2f} times as many "
        "intervals, as a run stops at readings and at knots"
    )


if __name__ == "__main__":
    print(main(*map(int, sys.argv[1:2])))
