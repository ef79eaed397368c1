r"""Which restitution gives the published resonance when impacts are rigid, and how unique is it.

The paper's figures do not fit one another: its theory's shift from 5.30 to 4.98 Hz, with the ball glued on,
means a mass ratio of 0.133; the shift that it measured, from 5.05 to 4.95 Hz, means 0.041. Both are studied, from
both starts, with Newton's law of impact

    v_after = -e v_before,   impulse = (1 + e) v_before / (1/m + sum_k phi_k^2),

exact between impacts (`EventDriven`), over the paper's range of frequencies on a grid five times finer.
Published: the peak at 4.95 Hz, a damping of 1.4 %, an amplitude five times smaller than without the ball. The paper
does not say from which points it read the peak without the ball. `main` and `on_grids` take the true one, `over_starts`
either: at 5.05 Hz the paper's 21 points cut it to less than a third.

A star stands at values of one start: the motion at that peak is not periodic, and another start has another value.

Two things decide the answer beside the mass ratio: the grid of frequencies (`on_grids`), and where several motions
exist, how a run starts and how long it dwells (`large_motions`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import xarray
from matplotlib import pyplot as plt

import femimpact as fi
from femimpact.app.demo import RESTITUTION, misfit
from femimpact.contact.law import resolve

AMPLITUDE = 0.2037e-3
PUBLISHED = {"peak_frequency": 4.95, "amplitude_ratio": 5.0}
"""Hz, 1."""

START_WORDS = {"base": "on the base", "space": "in space"}

LENGTH_AND_BOX = {"theory": (0.23026615, 0.02290976), "experiment": (0.160525016, 0.081997505)}
"""Beam length (m) and box mass (kg) that have the two frequencies of each study to 8 digits."""


def structure(study: str, restitution: float = 0.7) -> fi.Structure:
    """The beam, box and ball of one of the two studies."""
    length, box = LENGTH_AND_BOX[study]
    return fi.Structure(
        beam=fi.Beam.uniform(length=length, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700),
        masses=[fi.PointMass("box", at="tip", mass=box)],
        impactors=[fi.Impactor("ball", at="tip", mass=3.43e-3, gap=4e-3, contact=fi.Rigid(restitution=restitution))],
        damping=fi.Rayleigh(ratio=0.0029, modes=(1, 2)),
    )


def scan(
    study: str,
    restitutions: tuple[float, ...],
    points: int,
    starts: tuple[str, ...] = ("base", "space"),
    cycles: int = 600,
    modes: int = 4,
) -> xarray.Dataset:
    """Peak frequency (Hz), amplitude ratio and damping by it, over the restitution and the start of one study."""
    system = fi.reduce(fi.assemble(structure(study), elements=40), modes)
    bare, frequencies = fi.without_impactors(system), np.linspace(4.0, 6.0, points)
    fine = np.union1d(frequencies, bare.first_frequency + np.linspace(-0.1, 0.1, 81))
    empty = fi.frequency_sweep(bare, AMPLITUDE, fine, fi.EventDriven(), 1500, ledger=False)
    axes = {RESTITUTION: restitutions, "base.start": starts, "base.frequency": frequencies}
    found = fi.parameter_study(system, axes, ["peak"], excitation=fi.Sine(AMPLITUDE, 5.0), cycles=cycles)
    largest = found.isel({"base.frequency": found["peak"].argmax("base.frequency")}).reset_coords("base.frequency")
    ratio = empty.peak_amplitude / largest["peak"]
    columns = {"peak_frequency": largest["base.frequency"], "amplitude_ratio": ratio}
    columns["misfit"] = misfit(columns["peak_frequency"], ratio)
    columns["is_sample"] = largest["periodic_starts"] == 0
    return xarray.Dataset({**columns, "damping": empty.damping.ratio * ratio}).rename({RESTITUTION: "restitution"})


def main(
    restitutions: tuple[float, ...] = tuple(np.round(np.linspace(0.05, 0.95, 19), 2)),
    points: int = 101,
    cycles: int = 600,
) -> dict[str, xarray.Dataset]:
    """Both studies, over the restitution and from both starts."""
    return {study: scan(study, restitutions, points, cycles=cycles) for study in LENGTH_AND_BOX}


def on_grids(
    study: str,
    restitutions: tuple[float, ...] = (0.25, 0.28, 0.3, 0.32, 0.35, 0.38, 0.41, 0.45, 0.49),
    points: tuple[int, ...] = (21, 101),
) -> dict[int, xarray.Dataset]:
    """One study at rest relative to the base, with the paper's own 21 frequencies and on a finer grid."""
    return {count: scan(study, restitutions, count, ("base",)).sel({"base.start": "base"}) for count in points}


@dataclass(frozen=True, eq=False)
class OverStarts:
    """Peaks with the ball from several places and speeds of the ball, and the two peaks without it."""

    restitution: np.ndarray  # (n,)
    peak_frequency: np.ndarray  # (n, starts) Hz: of the largest peak of each start
    peak: np.ndarray  # (n, starts) m
    true_peak: float  # m: without the ball, at its resonance
    peak_on_points: float  # m: without the ball, on the frequencies with it

    def ratio(self, bare: float) -> np.ndarray:
        """Median, smallest and largest over the starts of the ratio to a peak without the ball (m), (3, n)."""
        return bare / np.quantile(self.peak, (0.5, 1.0, 0.0), axis=1)


def over_starts(
    study: str,
    restitutions: tuple[float, ...],
    frequencies: np.ndarray,  # Hz
    starts: int = 8,
    cycles: int = 600,
    modes: int = 3,
    seed: int = 0,
) -> OverStarts:
    """Peaks with the ball at uniform random places in its box, with speeds within +- that of the base at 5 Hz.

    The beam starts at rest relative to the base. Each start has one place and one speed at all frequencies.
    """
    system = fi.reduce(fi.assemble(structure(study), elements=40), modes)
    share = np.random.default_rng(seed).uniform(-1.0, 1.0, (starts, 2)) * (4e-3, 2.0 * np.pi * 5.0 * AMPLITUDE)
    points = np.round(frequencies, 9).tolist()
    cases = [
        {RESTITUTION: e, "start.ball.position": place, "start.ball.speed": speed,
         "base.frequency": frequency}
        for e in restitutions for place, speed in share.tolist() for frequency in points
    ]  # fmt: skip
    found = fi.parameter_study(system, cases, ["peak"], excitation=fi.Sine(AMPLITUDE, 5.0), cycles=cycles)
    peaks = found["peak"].to_numpy().reshape(len(restitutions), starts, len(points))
    bare = fi.without_impactors(system)
    near = bare.first_frequency + np.linspace(-0.02, 0.02, 21)
    true, cut = (
        fi.frequency_sweep(bare, AMPLITUDE, some, fi.EventDriven(), 1500, ledger=False).peak_amplitude
        for some in (near, points)
    )
    return OverStarts(np.array(restitutions), np.array(points)[peaks.argmax(-1)], peaks.max(-1), true, cut)


LARGE = 5.5e-3
"""Tip amplitude (m) that parts the large motion of the theory's beam from the small one, at 4.88 and 4.92 Hz."""


def large_motions(restitution: float, frequency: float, cycles: int, starts: int = 60, modes: int = 4) -> int:
    """How many starts, of the theory's beam at rest relative to the base, end a dwell in the large motion.

    The starts differ by the phase of the base, in equal steps over a turn; the last third of the dwell decides.
    """
    system = fi.reduce(fi.assemble(structure("theory", restitution), elements=40), modes)
    bases = [fi.Sine(AMPLITUDE, frequency, phase) for phase in 2.0 * np.pi * np.arange(starts) / starts]
    record = fi.Recorder(("tip",), every=64, ledger=False)
    runs = fi.integrate(system, bases, fi.EventDriven(), cycles / frequency, record)
    return sum(bool(run.steady.peak[0] > LARGE) for run in runs)


@dataclass(frozen=True)
class Compared:
    """One sweep with the ball: by which method, its contact time (s, 0 for rigid), and its statistics."""

    method: str
    contact_time: float
    curve: fi.sweep.FrequencyResponse


def compare(
    study: str,
    restitution: float,
    contact_times: tuple[float, ...] = (2e-3, 1e-3, 0.5e-3),
    points: int = 31,
    cycles: int = 600,
    modes: int = 4,
) -> list[Compared]:
    """The same sweep by rigid impacts and by Newmark with ever stiffer Kelvin-Voigt walls.

    The dashpot is made for the mass that acts in a rigid impact, all kept modes together, so that both
    laws have one restitution where the contact is short.
    """
    full = fi.assemble(structure(study, restitution), elements=40)
    rigid = fi.reduce(full, modes)
    row = rigid.contacts[0].direction
    mass = 1.0 / (1.0 / rigid.contacts[0].mass + float(row @ row))
    frequencies = np.linspace(4.8, 5.1, points)
    curve = fi.frequency_sweep(rigid, AMPLITUDE, frequencies, fi.EventDriven(), cycles)
    results = [Compared("event-driven", 0.0, curve)]
    for contact_time in contact_times:
        numbers = resolve(fi.KelvinVoigt(restitution=restitution, contact_time=contact_time), mass)
        law = fi.KelvinVoigt(stiffness=numbers.stiffness, damping=numbers.damping)
        given = structure(study)
        ball = replace(given.impactors[0], contact=law)
        system = fi.reduce(fi.assemble(replace(given, impactors=(ball,)), elements=40), modes)
        method = fi.Newmark(dt=contact_time / 20.0)
        results.append(
            Compared("Newmark", contact_time, fi.frequency_sweep(system, AMPLITUDE, frequencies, method, cycles))
        )
    return results


def _print_rows(header: tuple[str, ...], rows: list[tuple[str, ...]]) -> None:
    for cells in (header, ("---",) * len(header), *rows):
        print("| " + " | ".join(cells) + " |")


def _stars(samples) -> list[str]:
    return ["*" if one else "" for one in samples]


def _print_over_starts() -> None:
    scan, points, fine = np.linspace(0.05, 0.95, 19), np.linspace(4.0, 6.0, 21), np.linspace(4.0, 6.0, 101)
    plan = (
        ("experiment", points, [*scan, 0.38, 0.39, 0.41, 0.42]),
        ("experiment", fine, [0.28, 0.29, 0.3, 0.31, 0.32]),
        ("theory", points, [*scan, 0.72, 0.73, 0.74, 0.76, 0.77]),
        ("theory", fine, [0.73, 0.74, 0.75, 0.76, 0.77]),
    )
    for study, frequencies, restitutions in plan:
        found = over_starts(study, tuple(sorted(np.round(restitutions, 2).tolist())), frequencies)
        print(f"\n{study}, {frequencies.size} frequencies, 8 places and speeds of the ball: median (range)")
        print(f"peak without ball {1e3 * found.true_peak:.1f} mm, on these points {1e3 * found.peak_on_points:.1f} mm")
        peaks = np.quantile(found.peak_frequency, (0.5, 0.0, 1.0), axis=1)
        columns = (peaks, found.ratio(found.true_peak), found.ratio(found.peak_on_points))
        rows = [
            (f"{e:.2f}", *("{:.2f} ({:.2f} to {:.2f})".format(*column[:, i]) for column in columns))
            for i, e in enumerate(found.restitution)
        ]
        _print_rows(("restitution", "peak (Hz)", "ratio to the true peak", "ratio to the peak on these points"), rows)


if __name__ == "__main__":
    studies = main()
    figure, panels = plt.subplots(2, sharex=True, figsize=(8.0, 7.4), layout="constrained")
    for study, found in studies.items():
        for start in found["base.start"].values:
            one = found.sel({"base.start": start})
            print(f"\n{study}, at rest in the frame of the {start}")
            columns = (one["peak_frequency"], one["amplitude_ratio"], 100 * one["damping"], one["misfit"])
            _print_rows(
                ("restitution", "peak (Hz)", "amplitude ratio", "damping by ratio (%)", "misfit"),
                [
                    (f"{e:.4g}", *(f"{value:.4g}{star}" for value in row))
                    for e, *row, star in zip(
                        one["restitution"].values, *(column.values for column in columns), _stars(one["is_sample"]),
                        strict=True,
                    )
                ],
            )  # fmt: skip
            print(f"closest: {float(one['misfit'].idxmin()):.2f}")
            for panel, (name, published) in zip(panels, PUBLISHED.items(), strict=True):
                panel.plot(one["restitution"], one[name], "o-", label=f"{study}, rest {START_WORDS[start]}")
                panel.axhline(published, color="grey", linestyle="--")
    panels[0].set_ylabel("frequency of the largest peak (Hz)")
    panels[1].set(xlabel="restitution of the contact", ylabel="amplitude ratio without / with ball", ylim=(0.0, None))
    panels[0].legend()
    print("wrote", fi.figures.save_figure(panels, "rigid_reference_studies.png"))
    for count, found in on_grids("experiment").items():
        print(f"\nexperiment, from rest relative to the base, {count} frequencies")
        rows = [
            (f"{e:.2f}", f"{peak:.2f}{star}", f"{ratio:.2f}{star}")
            for e, peak, ratio, star in zip(
                found["restitution"].values, found["peak_frequency"].values, found["amplitude_ratio"].values,
                _stars(found["is_sample"]), strict=True,
            )
        ]  # fmt: skip
        _print_rows(("restitution", "peak (Hz)", "amplitude ratio"), rows)
        print(f"closest: {float(found['misfit'].idxmin()):.2f}")
    _print_over_starts()
    print("\ntheory, from rest relative to the base: of 60 starts, those that end a dwell in the large motion")
    dwells = (300, 600, 1200)
    rows = [
        (f"{e:g}", f"{f:g}", *(str(large_motions(e, f, cycles)) for cycles in dwells))
        for e in (0.7, 0.725, 0.75, 0.775, 0.8)
        for f in ((4.86, 4.88, 4.92) if e == 0.725 else (4.88, 4.92))
    ]
    _print_rows(("restitution", "base (Hz)", *(f"{cycles} cycles" for cycles in dwells)), rows)
    for study, restitution in (("experiment", 0.3), ("theory", 0.78)):
        print(
            f"\n{study}, restitution {restitution}, 4.8 to 5.1 Hz from rest relative to the base: means over the sweep"
        )
        rows = [
            (
                row.method, f"{1e3 * row.contact_time:g}",
                f"{1e3 * row.curve.peak_amplitude:.3f}{_stars([row.curve.peak_is_sample])[0]}",
                f"{row.curve.peak_frequency:.3f}", f"{1e3 * row.curve.rms.mean():.3f}",
                f"{row.curve.impacts_per_cycle.mean():.3f}", f"{row.curve.mean_approach_speed.mean():.4f}",
            )
            for row in compare(study, restitution)
        ]  # fmt: skip
        header = (
            "method", "contact time (ms)", "peak (mm)", "at (Hz)", "mean rms (mm)", "impacts per cycle",
            "approach (m/s)",
        )  # fmt: skip
        _print_rows(header, rows)
    print("\n* one start's value: the motion is not periodic")
