"""The part of a report on modes: their shapes, and the table of their frequencies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from femimpact.export.report.blocks import Section, Table, table_element
from femimpact.svg.axis import axis_of, number_text
from femimpact.svg.chart import Chart, Line, chart_element
from femimpact.svg.elements import Element, element

__all__ = ["modes_section"]

STATIONS = 201

MOST = 4


def modes_section(system: Any, modes: Any, table: Table | None = None) -> Section:
    """Shapes of the lowest modes, each with its largest deflection 1, and a table.

    Parameters
    ----------
    system : System
        Or what a picture knows of one: `nodes` and `deflection_rows`.
    modes : Modes
    table : Table, optional
    """
    content: list[Element] = []
    nodes = np.asarray(system.nodes, dtype=float)
    if nodes.size >= 2:
        content.append(element("div.wide.low", chart_element(_shapes(system, modes, nodes))))
    if table is None:
        table = _table(modes)
    return Section("modes", "Modes", (*content, table_element(table)))


def _shapes(system: Any, modes: Any, nodes: Any) -> Chart:
    x = np.linspace(nodes[0], nodes[-1], STATIONS)
    shapes = np.asarray(system.deflection_rows(x) @ modes.vectors, dtype=float)
    lines = []
    for i in range(min(shapes.shape[1], MOST)):
        shape = shapes[:, i]
        # the sign of a mode is free: that of the tip, or of its largest deflection
        largest = shape[np.argmax(np.abs(shape))]
        sign = shape[-1] if abs(shape[-1]) > 1e-6 * abs(largest) else largest
        scaled = shape / (abs(largest) or 1.0) * (1.0 if sign >= 0.0 else -1.0)
        name = f"mode {i + 1}, {number_text(float(modes.natural_frequency[i]))} Hz"
        lines.append(Line(name, 1e3 * x, scaled, 1 + i))
    places = axis_of("distance from the root (mm)", 1e3 * x, tight=True)
    return Chart(
        "Mode shapes, without balls", places, axis_of("deflection over its largest", [-1.0, 1.0]), tuple(lines)
    )


def _table(modes: Any) -> Table:
    columns: Sequence[tuple[str, Any]] = (
        ("natural frequency (Hz)", modes.natural_frequency), ("damping ratio", modes.damping_ratio),
        ("participation factor (kg^0.5)", modes.participation_factor),
    )  # fmt: skip
    rows = tuple((i + 1, *(float(values[i]) for _, values in columns)) for i in range(len(modes.natural_frequency)))
    return Table("Modes", ("mode", *(name for name, _ in columns)), rows)
