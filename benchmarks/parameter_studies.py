"""CPU time and memory of parameter studies, and the share beside the compiled call: `parameter_studies.py RUNS ...`.

The runs are rigid ones on 4 modes, 300 cycles each, with gaps of 2 to 6 mm, restitutions of 0.4 to 0.9, 4 to 6 Hz, a
base of 0.2 mm and the energy balance: a Sobol sample of as many cases, one start each, with blocks on disk.
"""

from __future__ import annotations

import resource
import sys
import tempfile
import threading
import time
from dataclasses import replace

import femimpact as fi
from femimpact import core
from femimpact.app.demo import paper_study

AXES = {
    "impactor.ball.gap": {"from": 2e-3, "to": 6e-3},
    "impactor.ball.contact.restitution": {"from": 0.4, "to": 0.9},
    "base.frequency": {"from": 4.0, "to": 6.0},
}


def rigid_study() -> fi.app.Study:
    """The paper's case with rigid impacts on 4 modes, event-driven, on a base of 0.2 mm."""
    paper = paper_study()
    ball = replace(paper.structure.impactors[0], contact=fi.Rigid(0.6))
    return replace(
        paper,
        structure=replace(paper.structure, impactors=(ball,)),
        method={"name": "event-driven"},
        reduction=replace(paper.reduction, modes=4),
        base=replace(paper.base, amplitude=0.2e-3),
    )


def measured(runs: int, measures: tuple[str, ...] = ("peak", "impacts_per_cycle", "cycle_mean_force")) -> str:
    """CPU seconds of a study, those in the compiled call, and the largest memory of the process."""
    inside, lock, compiled = [0.0], threading.Lock(), core.run_cases

    def timed(*given: object) -> object:
        begun = time.thread_time()
        try:
            return compiled(*given)
        finally:
            with lock:
                inside[0] += time.thread_time() - begun

    sample = {"points": runs, "method": "sobol" if not runs & (runs - 1) else "halton"}
    core.run_cases = timed
    try:
        with tempfile.TemporaryDirectory() as directory:
            begun, wall = time.process_time(), time.monotonic()
            fi.parameter_study(
                rigid_study(), AXES, [*measures, "energy_residual"], sample=sample, cycles=300, directory=directory
            )
            cpu, wall = time.process_time() - begun, time.monotonic() - wall
    finally:
        core.run_cases = compiled
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return (
        f"{runs} runs: {cpu:.1f} s of CPU ({1e3 * cpu / runs:.3f} ms a run, {1e6 * cpu / runs / 60:.1f} min for 10^6), "
        f"{100 * (1 - inside[0] / cpu):.1f} % beside the compiled call; {wall:.1f} s; {memory:.0f} MB"
    )


if __name__ == "__main__":
    for count in sys.argv[1:] or ("1000", "10000"):
        print(measured(int(count)), flush=True)
