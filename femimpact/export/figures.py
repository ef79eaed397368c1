"""Figures of results, one look for all of femimpact. A figure is a function of a result."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from femimpact.calibration import RestitutionScan
from femimpact.convergence.mesh_and_step import MeshConvergence, StepConvergence
from femimpact.errors import require
from femimpact.export.files import atomic_path
from femimpact.response.response import Response
from femimpact.sweep import FrequencyResponse, on_grid
from femimpact.system.modes import Modes
from femimpact.system.system import System

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "contact_force_figure",
    "mesh_convergence_figure",
    "mode_shape_figure",
    "phase_portrait_figure",
    "response_figure",
    "restitution_figure",
    "save_figure",
    "step_convergence_figure",
]

BLUE, ORANGE, GREEN, PURPLE, SKY, GREY = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#666666"
"""Okabe and Ito's colours, which most colour-blind readers can tell apart."""
COLOURS = (BLUE, ORANGE, GREEN, PURPLE, SKY)
STYLE: Any = {
    "font.size": 11.0,
    "axes.titlesize": 11.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.8,
    "axes.axisbelow": True,
    "lines.linewidth": 1.6,
    "savefig.dpi": 150,
}


def _figure(width: float, height: float, rows: int = 1, columns: int = 1, **options: Any) -> tuple[Figure, Any]:
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        return figure, figure.subplots(rows, columns, squeeze=False, **options)


def _plain_log_ticks(axis: Any) -> None:
    """Label a logarithmic axis 1, 2, 5, 10, ... instead of by powers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def save_figure(figure: Figure, path: str | Path) -> Path:
    """Write a figure, whole or not at all; the suffix chooses the format."""
    import matplotlib

    path = Path(path)
    with matplotlib.rc_context(STYLE), atomic_path(path) as temporary:
        figure.savefig(temporary, format=path.suffix.lstrip("."))
    return path


def mode_shape_figure(system: System, modes: Modes, points: int = 200) -> Figure:
    """Mode shapes along the beam, each scaled to 1, with frequency, damping and share of the moving mass."""
    count = min(modes.natural_frequency.size, 4)
    figure, axes = _figure(8.0, 1.55 * count + 0.6, count, 1, sharex=True)
    x = np.linspace(0.0, float(system.nodes[-1]), points)
    shapes = system.deflection_rows(x) @ modes.vectors[:, :count]
    for i, axis in enumerate(axes[:, 0]):
        shape = shapes[:, i] / np.abs(shapes[:, i]).max()
        axis.axhline(0.0, color=GREY, linewidth=0.8)
        axis.plot(1e3 * x, shape, color=COLOURS[i % len(COLOURS)], linewidth=2.2)
        axis.set_ylim(-1.25, 1.25)
        axis.set_ylabel("w / max |w|")
        mass = 100.0 * modes.effective_mass[i] / system.total_mass
        axis.set_title(
            f"mode {i + 1}: {modes.natural_frequency[i]:.5g} Hz, damping ratio "
            f"{100 * modes.damping_ratio[i]:.3g} %, {mass:.1f} % of the moving mass",
            loc="left",
        )
    axes[-1, 0].set_xlabel("distance from the root (mm)")
    return figure


def response_figure(
    empty: FrequencyResponse, balls: Sequence[tuple[str, FrequencyResponse]], title: str = "", coarse: Any = None
) -> Figure:
    """Response curves without and with the ball (the paper's Fig. 6 and 7), both on one logarithmic axis.

    Parameters
    ----------
    empty : FrequencyResponse
    balls : sequence of (label, FrequencyResponse)
    title : str
    coarse : array_like of Hz, optional
        Frequencies marked on the curves, to show what a coarse grid sees.

    Returns
    -------
    Figure
    """
    figure, axes = _figure(8.0, 5.0)
    axis = axes[0, 0]
    curves = [("without ball", empty), *balls]
    for colour, (label, curve) in zip(COLOURS, curves, strict=False):
        axis.semilogy(curve.frequency, 1e3 * curve.peak, color=colour, label=f"{label}: peak")
        if len(curves) <= 3 and label != "without ball":
            axis.semilogy(curve.frequency, 1e3 * curve.rms, color=colour, linestyle=":", label=f"{label}: rms")
        if coarse is not None:
            seen = on_grid(curve.frequency, coarse)
            axis.semilogy(curve.frequency[seen], 1e3 * curve.peak[seen], "o", color=colour, markersize=4.5)
    axis.annotate(
        f"{1e3 * empty.peak_amplitude:.3g} mm at {empty.peak_frequency:.4g} Hz",
        (empty.peak_frequency, 1e3 * empty.peak_amplitude),
        xytext=(8, -2),
        textcoords="offset points",
        color=BLUE,
    )
    note = "" if coarse is None else f"\ndots: the {len(np.asarray(coarse))} points of the coarse grid"
    axis.set_title((title or f"base amplitude {1e3 * empty.amplitude:.4g} mm") + note, loc="left")
    axis.set_xlabel("base frequency (Hz)")
    axis.set_ylabel("tip displacement relative to the base (mm)")
    _plain_log_ticks(axis.yaxis)
    axis.legend(loc="upper left", frameon=False)
    return figure


def _require_history(response: Response) -> None:
    allowed = "must hold a history; that of a run with Recorder.sink is in the pieces"
    require(response.time.size > 0, "response.time", "no samples", "", allowed)


def contact_force_figure(response: Response, cycles: int = 8) -> Figure:
    """Contact force over time (the paper's Fig. 8): the last cycles, and the peak of every impact of the run."""
    _require_history(response)
    figure, axes = _figure(8.0, 5.6, 2, 1)
    period = 1.0 / response.base.frequency
    cycles = min(cycles, max(round((response.time[-1] - response.time[0]) / period), 1))
    last = response.time >= response.time[-1] - cycles * period
    names = [name for name, unit in response.units.items() if unit == "N"]
    for colour, name in zip(COLOURS, names, strict=False):
        axes[0, 0].plot(response.time[last], response[name][last], color=colour, label=name.replace("_", " "))
    axes[0, 0].set_ylabel("force on the beam (N)")
    axes[0, 0].set_xlabel("time (s)")
    law = response.statistics.law
    axes[0, 0].set_title(f"last {cycles} cycles at {response.base.frequency:.4g} Hz, law: {law}", loc="left")
    if len(names) > 1:
        axes[0, 0].legend(loc="upper right", frameon=False)
    impacts, statistics = response.impacts, response.statistics
    for side, colour, label in ((1, BLUE, "+ wall"), (-1, ORANGE, "- wall")):
        chosen = impacts.side == side
        axes[1, 0].plot(
            impacts.time[chosen], impacts.peak_force[chosen], "o", markersize=3.0, color=colour, label=label
        )
    axes[1, 0].axhline(statistics.cycle_mean_force, color=GREY, linestyle="--", linewidth=1.2)
    axes[1, 0].set_title(
        f"peak of each impact; dashed: cycle-averaged force {1e3 * statistics.cycle_mean_force:.3g} mN;\n"
        f"mean impulse {1e3 * statistics.mean_impulse:.3g} mN s",
        loc="left",
    )
    axes[1, 0].set_ylim(0.0, 1.25 * (impacts.peak_force.max(initial=0.0) or 1.0))
    axes[1, 0].set_ylabel("peak force (N)")
    axes[1, 0].set_xlabel("time (s)")
    axes[1, 0].legend(loc="upper left", ncols=2, frameon=False)
    return figure


def phase_portrait_figure(response: Response, ball: str | None = None, cycles: int = 40) -> Figure:
    """Phase portrait of a ball in its box, relative to the box, with the walls drawn.

    Needs the channels of the ball, its velocity, and the tip with its velocity where the ball is.
    """
    _require_history(response)
    pair = next(p for p in response.system.balls if ball in (None, p.name))
    place = next(name for name, x in response.system.points.items() if x == pair.position)
    last = response.time >= response.time[-1] - cycles / response.base.frequency
    x = 1e3 * (response[pair.name] - response[place])[last]
    rate = 1e3 * (response[f"{pair.name}.velocity"] - response[f"{place}.velocity"])[last]
    figure, axes = _figure(6.4, 5.6)
    axis = axes[0, 0]
    axis.plot(x, rate, color=BLUE, linewidth=0.7)
    reach = 1.12 * max(np.abs(x).max(), 1e3 * max(pair.gaps))
    for wall, outer in ((1e3 * pair.gaps[0], reach), (-1e3 * pair.gaps[1], -reach)):
        axis.axvspan(min(wall, outer), max(wall, outer), color="#dddddd", zorder=0)
        axis.axvline(wall, color="black", linewidth=1.4)
    axis.set_xlim(-reach, reach)
    axis.set_title(
        f"{pair.name} in its box, last {cycles} cycles at {response.base.frequency:.4g} Hz; grey: inside the walls",
        loc="left",
    )
    axis.set_xlabel("ball relative to the box (mm)")
    axis.set_ylabel("velocity relative to the box (mm/s)")
    return figure


def restitution_figure(
    scans: Sequence[tuple[str, RestitutionScan]], peak_frequency: float, amplitude_ratio: float
) -> Figure:
    """What the restitution does to the resonance, for one or more starts, beside the published values."""
    figure, axes = _figure(8.0, 6.4, 2, 1, sharex=True)
    for colour, marker, (label, scan) in zip(COLOURS, "os^D", scans, strict=False):
        # hollow, so that curves that coincide are both seen
        style = {"color": colour, "marker": marker, "label": label, "markersize": 6.0, "markerfacecolor": "none"}
        axes[0, 0].plot(scan.restitution, scan.peak_frequency, **style)
        axes[1, 0].plot(scan.restitution, scan.amplitude_ratio, **style)
    for axis, published in ((axes[0, 0], peak_frequency), (axes[1, 0], amplitude_ratio)):
        axis.axhline(published, color=GREY, linestyle="--", linewidth=1.2)
        axis.annotate(f"published {published:g}", (0.01, published), xycoords=("axes fraction", "data"),
                      xytext=(0, -14), textcoords="offset points", color=GREY)  # fmt: skip
    axes[0, 0].set_ylabel("frequency of the largest peak (Hz)")
    axes[1, 0].set_ylabel("amplitude ratio without / with ball")
    axes[1, 0].set_xlabel("restitution of the contact")
    axes[1, 0].set_ylim(bottom=0.0)
    # above the axes: no corner is free for every scan
    axes[0, 0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False)
    return figure


def mesh_convergence_figure(result: MeshConvergence) -> Figure:
    """Relative error of the natural frequencies over the number of elements."""
    figure, axes = _figure(7.0, 5.0)
    axis = axes[0, 0]
    for i in range(result.reference.size):
        label = f"mode {i + 1}, {result.reference[i]:.5g} Hz: order {result.order[i]:.2f}"
        axis.loglog(result.elements, np.maximum(result.error[:, i], 1e-16), "o-", color=COLOURS[i % 5], label=label)
    axis.axhspan(1e-16, 1e-12, color="#eeeeee", zorder=0)
    axis.annotate("round-off floor", (0.02, 1.5e-13), xycoords=("axes fraction", "data"), color=GREY)
    axis.set_ylim(bottom=1e-16)
    axis.set_xlabel("elements")
    axis.set_ylabel("relative error of the natural frequency")
    axis.legend(loc="upper right", frameon=False)
    return figure


def step_convergence_figure(result: StepConvergence) -> Figure:
    """Error of the response and of the energy over the step."""
    figure, axes = _figure(7.0, 5.0)
    axis = axes[0, 0]
    rows = (
        (result.linear_error, f"without ball, 3 cycles: order {result.linear_order:.2f}", "o-"),
        (result.first_impact_error, f"after the first impact: order {result.first_impact_order:.2f}", "s-"),
        (result.energy_residual, "energy residual of these runs", "^--"),
    )
    for colour, (values, label, style) in zip(COLOURS, rows, strict=False):
        if np.any(np.isfinite(values)):
            axis.loglog(1e6 * result.dt, values, style, color=colour, label=label)
    axis.set_xlabel("step dt (microseconds)")
    axis.set_ylabel("relative error")
    axis.legend(loc="lower right", frameon=False)
    return figure
