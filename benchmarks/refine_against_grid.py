"""Does `refine` find what a grid study of 10^4 runs finds? Winners of both, run again from the same 12 fresh starts.

    python benchmarks/refine_against_grid.py [SEEDS]

A beam with a box and a rigid ball of 5 g, base 0.2 mm, worst of 9 frequencies; on one axis (gap) and on two (gap and
restitution). A line for each seed: CPU time of `refine`, worst peak of both winners, and their ratio; then the median.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np

import femimpact as fi

FREQUENCIES = list(np.linspace(4.7, 5.6, 9))
GAP, RESTITUTION = "impactor.ball.gap", "impactor.ball.contact.restitution"
BOUNDS = {GAP: (0.5e-3, 8e-3), RESTITUTION: (0.3, 0.8)}
POINTS = {1: (222,), 2: (15, 15)}
"""Of the grid along each axis: 222 x 9 frequencies x 5 starts are 10^4 runs."""

BASE: dict[str, Any] = {"excitation": fi.Sine(0.2e-3, 5.0)}


def reduced_system() -> fi.System:
    """The beam in three modes."""
    beam = fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    ball = fi.Impactor("ball", at="tip", mass=5e-3, gap=3e-3, contact=fi.Rigid(0.5))
    box, damping = fi.PointMass("box", at="tip", mass=0.023), fi.Rayleigh(ratio=0.0029, modes=(1, 2))
    return fi.reduce(fi.assemble(fi.Structure(beam, [box], [ball], damping), elements=20), modes=3)


def worst_again(system: fi.System, values: dict[str, float]) -> float:
    """Worst peak (m) of a design from 12 other starts."""
    cases = [{**values, "base.frequency": f} for f in FREQUENCIES]
    return float(fi.parameter_study(system, cases, ["peak"], starts=12, seed=1_000_000, **BASE)["peak"].max())


def main(seeds: int = 5) -> dict[int, list[float]]:
    """Ratios of the worst peaks, refine over grid, by the number of axes."""
    system, ratios = reduced_system(), dict[int, list[float]]()
    for axes, points in POINTS.items():
        names = list(BOUNDS)[:axes]
        searched = {name: BOUNDS[name] for name in names} | {"base.frequency": FREQUENCIES}
        grid = {n: list(np.linspace(*BOUNDS[n], count)) for n, count in zip(names, points, strict=True)}
        grid["base.frequency"] = FREQUENCIES
        ratios[axes] = []
        for seed in range(seeds):
            begin = time.process_time()
            found = fi.refine(system, "peak", searched, seed=seed, **BASE).best.designs[0]
            taken = time.process_time() - begin
            study = fi.parameter_study(system, grid, ["peak"], starts=5, seed=seed, **BASE)
            other = fi.best_case(study, "peak").designs[0]
            peaks = [worst_again(system, dict(one.values)) for one in (found, other)]
            ratios[axes].append(peaks[0] / peaks[1])
            words = f"{1e3 * peaks[0]:.3f} and {1e3 * peaks[1]:.3f} mm, ratio {ratios[axes][-1]:.3f}"
            print(f"{axes} axes, seed {seed}: refine in {taken:.1f} CPU s; {words}", flush=True)
        print(f"{axes} axes: median ratio {np.median(ratios[axes]):.3f}", flush=True)
    return ratios


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 5)
