"""The part of a report with branches of periodic orbits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from femimpact.app.report.page import Section, Table, table_element, table_of
from femimpact.arrays import Array
from femimpact.orbits import Branch
from femimpact.orbits.figures import SWEPT, kind_words, parameter_words, prefix_of, stretches
from femimpact.svg import Chart, Line, axis_of, chart_element, element
from femimpact.units import PARAMETER_DIGITS, in_shown_units, parameter_text

COLOURS = {
    "fold": 2, "symmetry-breaking": 3, "period-doubling": 4, "neimark-sacker": 5, "branch-point": 1, "grazing": 6,
    "sticking": 6,
}  # fmt: skip
"""Number of the colour of each kind of bifurcation in a chart, the same whichever kinds are there."""


def branches_section(
    branches: Sequence[Branch],
    origins: Sequence[str],
    cycles: Sequence[int],
    words: Sequence[str],  # sentences above the chart
    bifurcations: tuple[Mapping[str, Any], Mapping[str, str], str] | None,  # columns, units, name of the file
    swept: tuple[Array, Array] | None = None,  # values of the parameter and largest displacements (m)
    file: str = "",  # of the branches
) -> Section:
    """Largest displacements over the parameter, a row for each branch and one for each bifurcation."""
    rows = tuple(
        (
            number, origin, cycle, parameter_text(branch.values.min(), branch.unit),
            parameter_text(branch.values.max(), branch.unit), len(branch), int(np.count_nonzero(branch.is_stable)),
            *branch.end,
        )
        for number, (branch, origin, cycle) in enumerate(zip(branches, origins, cycles, strict=True), 1)
    )  # fmt: skip
    header = ("branch", "followed from", "cycles", "from", "to", "points", "stable points", "first end", "last end")
    tables = [Table("The branches", header, rows, file)]
    if bifurcations is not None and len(bifurcations[0]["branch"]):
        columns, units, name = bifurcations
        shown = in_shown_units(_whole_branches(columns), units)
        digits = {branches[0].parameter: PARAMETER_DIGITS}
        tables.append(table_of("Bifurcations", *shown, name, digits=digits))
    chart = element("div.wide", chart_element(_chart(branches, swept)))
    return Section(
        "orbits", "Periodic orbits", (*(element("p", text) for text in words), chart, *map(table_element, tables))
    )


def _whole_branches(columns: Mapping[str, Any]) -> dict[str, Any]:
    """The columns with numbers of branches as whole numbers, and words for the kinds."""
    kinds = [kind_words(str(kind)) for kind in columns["kind"]]
    return {**columns, "branch": np.asarray(columns["branch"]).astype(int), "kind": kinds}


def _chart(branches: Sequence[Branch], swept: tuple[Array, Array] | None) -> Chart:
    """Stable orbits as lines, unstable ones dashed, bifurcations and runs as dots."""
    first = branches[0]
    x_factor, x_unit = prefix_of([branch.values for branch in branches], first.unit)
    runs = [] if swept is None else [swept[1]]
    y_factor, y_unit = prefix_of([*(branch.peak for branch in branches), *runs], "m")
    lines, named = list[Line](), set[str]()
    for style, x, y in sorted(_lines(branches), key=lambda line: line[0] != "line"):
        # one entry in the legend for all of them
        words = "stable" if style == "line" else "unstable"
        lines.append(Line("" if words in named else words, x_factor * x, y_factor * y, 1, style))
        named.add(words)
    for kind, colour in COLOURS.items():
        points = np.array([
            (branch.values[number], branch.peak[number])
            for branch in branches
            for number, each in zip(branch.bifurcation_points.tolist(), branch.bifurcations, strict=True)
            if each.kind == kind
        ]).reshape(-1, 2)  # fmt: skip
        if len(points):
            lines.append(_dots(kind_words(kind), points[:, 0], points[:, 1], colour, x_factor, y_factor))
    if swept is not None:
        lines.append(_dots(SWEPT, *swept, 0, x_factor, y_factor))
    across = axis_of(parameter_words(first.parameter, x_unit), *(line.x for line in lines), tight=True)
    up = axis_of(f"largest displacement ({y_unit})", *(line.y for line in lines), zero=True)
    return Chart(f"Largest displacement of {first.place}, relative to the base", across, up, tuple(lines))


def _lines(branches: Sequence[Branch]) -> Iterator[tuple[str, Array, Array]]:
    for branch in branches:
        for part, is_stable in stretches(branch):
            yield "line" if is_stable else "dashed", branch.values[part], branch.peak[part]


def _dots(name: str, x: Array, y: Array, colour: int, x_factor: float, y_factor: float) -> Line:
    return Line(name, x_factor * x, y_factor * y, colour, "none", marked=np.ones(np.size(x), dtype=bool))
