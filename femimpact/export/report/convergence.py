"""The part of a report on convergence: relative errors over mesh, step and modes, and what an accuracy takes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.export.report.blocks import Section, Table, table_element
from femimpact.svg.axis import axis_of
from femimpact.svg.chart import Chart, Line, chart_element
from femimpact.svg.elements import element

__all__ = ["axis_section", "steps_section", "summary_table"]

COUNTED = {"mesh": "elements", "step": "steps in the first natural period", "modes": "modes kept"}
HEADINGS = {
    "mesh": "Convergence over the mesh",
    "step": "Convergence over the step",
    "modes": "Convergence over the modes",
}

FAMILIES = 6
"""Lines of one chart."""


def axis_section(
    axis: str, columns: Mapping[str, Any], units: Mapping[str, str], file: str = "", statistics: bool = False
) -> Section | None:
    """Relative errors over one axis, and the values behind them; None of a table without errors.

    Parameters
    ----------
    axis : {"mesh", "step", "modes"}
    columns : mapping of str to ndarray (cases,)
        As of `ConvergenceTable.columns`.
    units : mapping of str to str
    file : str
    statistics : bool
        Whether the values are means over starts, which scatter.
    """
    names = [name.removesuffix("_error") for name in columns if name.endswith("_error")]
    if not names or "number" not in columns:
        return None
    number = np.asarray(columns["number"], dtype=float)
    charts = []
    for k in range(0, len(names), FAMILIES):
        charts.append(
            _chart(axis, number, {n: np.asarray(columns[f"{n}_error"], dtype=float) for n in names[k : k + FAMILIES]})
        )
    shown = {"case": columns["case"]} if "case" in columns else {"number": number}
    rows_of = {**shown, **{name: columns[name] for name in names if name in columns}}
    header = tuple(
        f"{_words(name)} ({units[name]})" if units.get(name) not in (None, "", "1") else _words(name)
        for name in rows_of
    )
    rows = tuple(zip(*(np.asarray(values).tolist() for values in rows_of.values()), strict=True))
    heading = "Runs with contacts, over the mesh" if statistics else HEADINGS[axis]
    words = (
        "Means over several starts: a difference below three standard errors means nothing." if statistics
        else "Relative errors. A straight line falls with a power of the size, its order."
    )  # fmt: skip
    return Section(
        f"statistics-{axis}" if statistics else f"convergence-{axis}", heading,
        (
            element("p", words), element("div.charts", *(chart_element(one) for one in charts if one.lines)),
            table_element(Table("Values of the cases", header, rows, file)),
        ),
    )  # fmt: skip


def _words(name: str) -> str:
    return name.replace("_", " ")


def _chart(axis: str, number: NDArray[np.float64], errors: Mapping[str, NDArray[np.float64]]) -> Chart:
    lines = []
    for i, (name, error) in enumerate(errors.items()):
        known = np.isfinite(error) & (error > 0.0)
        if known.any():
            lines.append(
                Line(_words(name), number[known], error[known], 1 + i, marked=np.ones(int(known.sum()), dtype=bool))
            )
    across = axis_of(COUNTED[axis], number, logarithmic=True)
    up = axis_of("relative error", *(line.y for line in lines), logarithmic=True)
    return Chart("", across, up, tuple(lines))


def steps_section(columns: Mapping[str, Any], file: str = "") -> Section | None:
    """Errors of runs in steps over the step; None of a table without them."""
    labels = {
        "linear_error": "without ball",
        "first_impact_error": "to the first impact",
        "energy_residual": "energy residual",
    }
    known = {name: words for name, words in labels.items() if name in columns}
    if "dt" not in columns or not known:
        return None
    step = 1e3 * np.asarray(columns["dt"], dtype=float)
    lines = []
    for i, (name, words) in enumerate(known.items()):
        values = np.asarray(columns[name], dtype=float)
        fits = np.isfinite(values) & (values > 0.0)
        if fits.any():
            lines.append(Line(words, step[fits], values[fits], 1 + i, marked=np.ones(int(fits.sum()), dtype=bool)))
    up = axis_of("relative error", *(line.y for line in lines), logarithmic=True)
    chart = Chart("", axis_of("time step (ms)", step, logarithmic=True), up, tuple(lines))
    rows = tuple(zip(*(np.asarray(columns[name]).tolist() for name in ("dt", *known)), strict=True))
    table = Table("Errors of runs in steps", ("step (s)", *known.values()), rows, file)
    return Section("steps", "Runs in steps", (element("div.charts", chart_element(chart)), table_element(table)))


def summary_table(columns: Mapping[str, Any], file: str = "") -> Table:
    """Reference, orders and recommended number of every quantity."""
    names = [
        name
        for name in (
            "axis",
            "quantity",
            "unit",
            "reference",
            "fitted_order",
            "expected_order",
            "recommended",
            "recommended_is_bound",
        )
        if name in columns
    ]
    heads = {"recommended_is_bound": "fewer may do"}
    values = {name: np.asarray(columns[name]).tolist() for name in names}
    if "recommended_is_bound" in values:
        values["recommended_is_bound"] = ["yes" if str(one) == "True" else "" for one in values["recommended_is_bound"]]
    rows = tuple(zip(*values.values(), strict=True))
    return Table("What an accuracy takes", tuple(heads.get(name, _words(name)) for name in names), rows, file)
