"""Cost of one Newmark step, as ratios measured side by side in one run.

Eight modes, one ball with its contact law, statistics on. The reference is the plain loop that one
writes with scipy: banded Cholesky of the full mesh, one step after the other, in Python.

    python benchmarks/newmark_step.py
"""

from __future__ import annotations

import argparse
import platform
import time

import numpy as np
import scipy.linalg

import femimpact as fi
from femimpact.app.demo import paper_study
from femimpact.app.study.study import build_systems, method_for
from femimpact.integrators.stepping.arrays import Inputs
from femimpact.integrators.stepping.operators import bands
from femimpact.integrators.stepping.run import prepare, run_block

LIMITS = {(1, False): 60.0, (21, False): 15.0, (1, True): 90.0, (21, True): 22.5}
"""ns per step and case that issue and house ask for; the ledger may add half."""


def kernel(system, method, cases, ledger, steps, repeats):
    """Best CPU time of some runs, ns per step and case."""
    bases = [fi.Sine(0.2037e-3, f) for f in np.linspace(4.0, 6.0, cases)] if cases > 1 else [fi.Sine(0.2037e-3, 5.0)]
    best = np.inf
    for _ in range(repeats):
        block = prepare(
            system, Inputs(bases, [steps] * cases, [0] * cases), method,
            observed=system.point_row("tip"), ledger=ledger,
        )  # fmt: skip
        start = time.process_time()
        run_block(block)
        best = min(best, time.process_time() - start)
    return 1e9 * best / steps / cases


def scipy_loop(system, method, base, steps):
    """The same problem by a plain banded Newmark loop, ns per step; also its tip at the end."""
    dt, pair = method.dt, system.contacts[0]
    factor = scipy.linalg.cholesky_banded(bands(system.M + 0.5 * dt * system.C + 0.25 * dt * dt * system.K), lower=True)
    C, K, b, law = system.C, system.K, pair.direction, pair.parameters
    h = scipy.linalg.cho_solve_banded((factor, True), b)
    mobility = 1.0 / pair.mass + b @ h
    u, v, a = (np.zeros(system.dofs) for _ in range(3))
    y = y_rate = y_acceleration = 0.0
    start = time.process_time()
    for n in range(1, steps + 1):
        acting = float(base.acceleration(n * dt))
        u_predicted = u + dt * v + 0.25 * dt * dt * a
        v_predicted = v + 0.5 * dt * a
        rhs = -system.base_load * acting - C @ v_predicted - K @ u_predicted
        a = scipy.linalg.cho_solve_banded((factor, True), rhs)
        u, v = u_predicted + 0.25 * dt * dt * a, v_predicted + 0.5 * dt * a
        y = y + dt * y_rate + 0.25 * dt * dt * (y_acceleration - acting)
        y_rate = y_rate + 0.5 * dt * (y_acceleration - acting)
        y_acceleration = -acting
        x, rate = y - b @ u, y_rate - b @ v
        side = 1.0 if x > pair.gaps[0] else -1.0 if x < -pair.gaps[1] else 0.0
        if side:
            depth = side * x - pair.gaps[0 if side > 0 else 1]
            yielding = 1.0 + mobility * (0.25 * dt * dt * law.stiffness + 0.5 * dt * law.damping)
            force = side * max(0.0, law.stiffness * depth + law.damping * side * rate) / yielding
            a = a + h * force
            u, v = u + 0.25 * dt * dt * h * force, v + 0.5 * dt * h * force
            y, y_rate = y - 0.25 * dt * dt * force / pair.mass, y_rate - 0.5 * dt * force / pair.mass
            y_acceleration -= force / pair.mass
    return 1e9 * (time.process_time() - start) / steps, float(b @ u)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--steps", type=int, default=200_000)
    options = parser.parse_args()
    study = paper_study()
    full, small = build_systems(study)
    method = method_for(study, small)
    base = fi.Sine(0.2037e-3, 5.0)

    # the same motion first: 0.5 s with the first impact near its end, before chaos
    steps = 5_000
    reference, tip = scipy_loop(full, method, base, steps)
    check = fi.integrate(full, base, method, steps * method.dt, fi.Recorder(channels=("tip",), every=steps))
    difference = abs(check["tip"][-1] - tip) / 1e-3
    versions = f"Python {platform.python_version()}, numpy {np.__version__}"
    print(f"{platform.machine()}, {versions}; CPU time, best of {options.repeats}")
    print(f"scipy banded loop, N = 40: {reference:.0f} ns per step;", end=" ")
    print(f"its tip after {steps} steps differs by {difference:.1e} mm\n")
    print("space     cases   ledger   ns per step and case   of the limit   faster than the scipy loop")
    for cases in (1, 21, 64):
        for ledger in (False, True):
            cost = kernel(small, method, cases, ledger, options.steps, options.repeats)
            limit = LIMITS.get((cases, ledger))
            share = f"{cost / limit:12.2f}" if limit else " " * 12
            ratio = f"{reference / cost:16.0f} times"
            print(f"8 modes   {cases:5d}   {'on' if ledger else 'off':6}   {cost:20.1f}   {share}   {ratio}")
    for cases in (1, 21):
        cost = kernel(full, method, cases, False, options.steps // 50, options.repeats)
        ratio = f"{reference / cost:16.0f} times"
        print(f"80 dofs   {cases:5d}   off      {cost:20.1f}   {' ' * 12}   {ratio}")


if __name__ == "__main__":
    main()
