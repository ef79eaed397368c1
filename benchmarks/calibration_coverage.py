"""Do the 90 % intervals of `calibrate` hold the truth? Synthetic tests of the paper's damper, noise 2 %.

    python benchmarks/calibration_coverage.py [TESTS] [SEED]

Restitution 0.4 to 0.8 and gap 2.5 to 5.5 mm off the grid of the calibration, 21 frequencies, each dwell from another
start; all tests share the runs of one grid. It prints how many intervals of each parameter hold the truth (90 % are
54 of 60), their median widths, the errors of the medians, and the same from every third frequency; last, whether
neighbouring frequencies share their errors, which the calibration takes for independent.
"""

from __future__ import annotations

import sys
import tempfile
import time
from typing import Any

import numpy as np

import femimpact as fi

FREQUENCIES = np.round(np.linspace(4.0, 6.0, 21), 3)
GAP, RESTITUTION = "impactor.ball.gap", "impactor.ball.contact.restitution"
BOUNDS = {GAP: (2e-3, 6e-3), RESTITUTION: (0.3, 0.9)}
NOISE, BLOCK = 0.02, 10
"""Relative noise of the peaks, and tests whose dwells have the same starts."""


def reduced_system() -> fi.System:
    """The paper's theory in three modes."""
    beam = fi.Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    ball = fi.Impactor("ball", at="tip", mass=3.43e-3, gap=4e-3, contact=fi.Rigid(0.6))
    box, damping = fi.PointMass("box", at="tip", mass=0.02290976), fi.Rayleigh(ratio=0.0029, modes=(1, 2))
    return fi.reduce(fi.assemble(fi.Structure(beam, [box], [ball], damping), elements=40), modes=3)


def measured_peaks(system: fi.System, drive: fi.Sine, truth: np.ndarray, seed: int) -> np.ndarray:
    """Peaks (tests, frequencies) m with noise, each from one start."""
    peaks = np.empty((len(truth), FREQUENCIES.size))
    for begin in range(0, len(truth), BLOCK):
        some = truth[begin : begin + BLOCK].tolist()
        for number, frequency in enumerate(FREQUENCIES.tolist()):
            cases = [{GAP: gap, RESTITUTION: e, "base.frequency": frequency} for gap, e in some]
            draw = 10_000 * (seed + 1) + FREQUENCIES.size * begin + number
            found = fi.parameter_study(system, cases, ["peak"], excitation=drive, cycles=300, seed=draw)
            peaks[begin : begin + BLOCK, number] = found["peak"]
    return peaks * (1.0 + NOISE * np.random.default_rng(seed).standard_normal(peaks.shape))


def main(tests: int = 60, seed: int = 100) -> list[int]:
    """Numbers of intervals of the gap and of the restitution that hold the truth."""
    system, drive = reduced_system(), fi.Sine(0.2037e-3, 5.0)
    shares = np.random.default_rng(seed + 1).random((tests, 2))
    truth = np.array([2.5e-3, 0.4]) + shares * np.array([3e-3, 0.4])
    peaks = measured_peaks(system, drive, truth, seed)
    with tempfile.TemporaryDirectory() as folder:
        for step in (3, 1):
            found, times = list[Any](), list[float]()
            for one in peaks:
                begin = time.process_time()
                found.append(
                    fi.calibrate(
                        system, FREQUENCIES[::step], one[::step], BOUNDS, excitation=drive,
                        directory=f"{folder}/{step}", progress=lambda _one: None,
                    )
                )  # fmt: skip
                times.append(time.process_time() - begin)
            held = _held(found, truth, f"every {step}. frequency" if step > 1 else "all frequencies")
            print(f"  CPU time of the first {times[0]:.1f} s, of the others {np.median(times[1:]):.2f} s", flush=True)
    _print_neighbours(found)
    return held


def _held(found: list[Any], truth: np.ndarray, words: str) -> list[int]:
    print(words)
    counts = []
    for number, (name, unit, factor) in enumerate(((GAP, "mm", 1e3), (RESTITUTION, "", 1.0))):
        ends = np.array([[one.parameters[number].low, one.parameters[number].high] for one in found])
        errors = np.array([one.parameters[number].median for one in found]) - truth[:, number]
        without = int(np.count_nonzero(np.isnan(ends[:, 0])))
        counts.append(int(np.count_nonzero((ends[:, 0] <= truth[:, number]) & (truth[:, number] <= ends[:, 1]))))
        width, error = np.nanmedian(ends[:, 1] - ends[:, 0]) * factor, np.sqrt(np.mean(errors**2)) * factor
        print(
            f"  {name}: {counts[-1]} of {len(found) - without} intervals hold the truth, {without} at a bound; "
            f"median width {width:.3g} {unit}, rms error {error:.3g} {unit}"
        )
    return counts


def _print_neighbours(found: list[Any]) -> None:
    """Correlation of the misfits at frequencies so many steps apart, each over its expected size."""
    misfit = np.array(
        [np.log(one.peak / one.fitted) / np.log(one.fitted_high / one.fitted_low) for one in found]
    )  # (tests, frequencies)
    for apart in (1, 2, 3):
        shared = (misfit[:, apart:] * misfit[:, :-apart]).mean() / (misfit**2).mean()
        print(f"misfits {apart} frequencies apart are correlated by {shared:.2f}")


if __name__ == "__main__":
    main(*(int(value) for value in sys.argv[1:3]))
