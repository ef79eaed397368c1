"""The drive of a run in a report, and the spectra by which a run under it is read."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from femimpact.app.report.charts import MOST_LINES, largest_of
from femimpact.app.report.page import Section
from femimpact.errors import InputError
from femimpact.excitation import Chirp, Drives, HammerBlow, PiecewisePolynomial, RandomBase, Shock, SteppedSine
from femimpact.excitation.drives import drive_words
from femimpact.excitation.excitation import has_cycle, is_force
from femimpact.response.response import Response
from femimpact.signals.densities import drive_history, remarks, spectrum
from femimpact.signals.estimates import measured_transfer
from femimpact.signals.shock_response import shock_response_spectrum
from femimpact.svg import Band, Chart, Line, axis_of, chart_element, element
from femimpact.units import GRAVITY, prefixed, unit_text

SHOWN_CYCLES, READINGS, MOST_READINGS = 10, 64, 200_000
"""Cycles of a steady sine that are drawn; readings of a drive in a cycle, and at most in all."""


def drive_section(excitation: Any, end: float, key: str = "drive", heading: str = "The drive") -> Section:
    """A line for each drive up to the end of a run (s), and its force, or its acceleration or density, as a chart."""
    drives = getattr(excitation, "drives", (excitation,))
    names = getattr(excitation, "names", ("",))
    lines, charts = [], []
    for name, drive, words in zip(names, drives, drive_words(excitation), strict=True):
        unit, what = ("N", "force") if is_force(drive) else ("m/s^2", "acceleration of the base")
        title = f"{name}: {what}" if name not in ("", "base") else what.capitalize()
        chart = _chart_over_time(drive, end, title, unit)
        history = getattr(drive, "history", drive)
        if isinstance(history, RandomBase):
            chart = _density_chart(history, title, unit)
        lines.append(f"{words}; {chart.note}")
        charts.append(dataclasses.replace(chart, note=""))
    content = [*(element("p", text) for text in lines), element("div.charts", *map(chart_element, charts))]
    return Section(key, heading, tuple(content))


def _chart_over_time(drive: Any, end: float, title: str, unit: str) -> Chart:
    """The force (N) or acceleration (m/s^2) while the drive acts; of a steady sine ten cycles."""
    form, begin = getattr(drive, "closed_form", None), 0.0
    last = SHOWN_CYCLES / drive.frequency if has_cycle(drive) else end
    if isinstance(form, PiecewisePolynomial):
        begin, last = float(form.knots[0]), float(form.knots[-1])
    margin = 0.05 * (last - begin)
    begin, last = max(begin - margin, 0.0), min(last + margin, end)
    begin = min(begin, last)
    cycles = drive.frequency * (last - begin)
    time = np.linspace(begin, last, min(max(READINGS * math.ceil(cycles), 2000), MOST_READINGS))
    values = (drive.force if unit == "N" else drive.acceleration)(time)
    factor, shown = prefixed(largest_of(values), unit) if unit == "N" else (1.0, unit)
    line = Line("", time, factor * values, style="thin" if cycles > 60.0 else "line")
    heights = axis_of(f"{'force' if unit == 'N' else 'acceleration'} ({shown})", line.y)
    note = f"largest {unit_text(largest_of(values), unit)}"
    return Chart(title, axis_of("time (s)", time, tight=True), heights, (line,), note=note)


def _density_chart(motion: RandomBase, title: str, unit: str) -> Chart:
    """The density that a random motion, or force, is made of."""
    f, density = np.array(motion.psd).T
    factor, shown = (1.0, "N²/Hz") if unit == "N" else (GRAVITY**-2, "g²/Hz")
    chart = _over_frequency(f"{title}: spectral density", f"density ({shown})", Line("", f, factor * density))
    return dataclasses.replace(chart, note=f"root mean square {unit_text(motion.rms, unit)}")


SHOCK_RATIO = 0.05
"""Damping ratio of the shock response spectrum in a report."""


def spectra_section(
    response: Response,
    key: str = "spectra",
    heading: str = "Spectra",
    told: Callable[[str], str] = str,  # a fault in the words of who gave the run
) -> Section | None:
    """What a run is read by where its drive has it, with the reason where a channel cannot be; None of other drives.

    Densities of a random drive, transfer functions of a chirp, a stepped sine or a blow, and the response spectrum of a
    shock.
    """
    charts, refused = [], []
    if isinstance(response.base, Drives):
        words = "No transfer function: several drives act at once, and a run under each of them alone has its own."
        return Section(key, heading, (element("p", words),))
    if isinstance(response.base, Shock):
        charts.append(_shock_chart(response.base))
    for name in [name for name, unit in response.units.items() if unit != "N"][:MOST_LINES]:
        try:
            charts += _spectrum_charts(response, name)
        except InputError as error:
            refused.append(element("p", f"No spectrum of {name}: {told(str(error))}."))
    drawn = [chart_element(one) for one in charts]
    return Section(key, heading, (element("div.charts", *drawn), *refused)) if drawn or refused else None


def _spectrum_charts(response: Response, name: str) -> list[Chart]:
    history = drive_history(response)
    if isinstance(history, RandomBase):
        found = spectrum(response, name).in_gravity()
        shown = (found.frequency > 0.0) & (found.frequency <= 1.5 * history.frequency)
        f, values, low, high = (one[shown] for one in (found.frequency, found.values, found.low, found.high))
        band = Band(f"{100 * found.confidence:g} % interval", f, low, high)
        label = f"density ({found.unit.replace('^2', '²')})"
        return [_over_frequency(f"Spectral density of {name}", label, Line(name, f, values), of=found, bands=(band,))]
    if isinstance(history, Chirp | SteppedSine | HammerBlow):
        transfer = measured_transfer(response, name)
        # the dwells of a sweep up and down stand in their order in time
        order = np.argsort(transfer.frequency, kind="stable")
        line = Line(name, transfer.frequency[order], np.abs(transfer[name])[order])
        over = transfer.of.replace("base.acceleration", "acceleration of the base")
        return [_over_frequency(f"{name} over the {over}", f"magnitude ({transfer.units[name]})", line, of=transfer)]
    return []


def _shock_chart(shock: Shock) -> Chart:
    f = np.geomspace(0.05 / shock.duration, 50.0 / shock.duration, 60)
    found = shock_response_spectrum(shock, f, SHOCK_RATIO)
    sides = {"positive": found.positive_acceleration, "negative": found.negative_acceleration}
    lines = [Line(side, f, np.where(y > 0.0, y, np.nan) / GRAVITY, 1 + i) for i, (side, y) in enumerate(sides.items())]
    title = f"Shock response spectrum of the base, damping ratio {SHOCK_RATIO:g}"
    return _over_frequency(title, "absolute acceleration (g)", *lines, of=found, across="natural frequency (Hz)")


def _over_frequency(
    title: str,
    label: str,
    *lines: Line,
    of: Any = None,  # with notes and warnings, which stand below
    bands: tuple[Band, ...] = (),
    across: str = "frequency (Hz)",
) -> Chart:
    x = axis_of(across, *(line.x for line in lines), logarithmic=True, tight=True)
    y = axis_of(label, *(line.y for line in lines), logarithmic=True)
    said = () if of is None else remarks(of).values()
    return Chart(title, x, y, lines, bands, note="; ".join(text for text in said if text))
