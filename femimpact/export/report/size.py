"""A report within its bound of bytes: fewer points of lines, fewer players, shorter tables, and the page says so."""

from __future__ import annotations

import copy
import dataclasses
import re
from collections.abc import Iterator

import numpy as np

from femimpact.export.report.page import MOST_BYTES, Page, page_bytes
from femimpact.svg.elements import Element, element, markup
from femimpact.svg.thinning import thinned_line

__all__ = ["bounded_page", "thinned_path"]

POINT = re.compile(r"([ML])(-?\d+) (-?\d+)")
"""A point of a line or of dots, as `svg.chart` writes it."""

FEWER = (600, 200, 60)
"""Points of a line that are tried in turn."""

LAST_ROWS = 10
"""Of a table, where fewer points and players do not do."""


def bounded_page(page: Page, most: int = MOST_BYTES) -> Page:
    """The page if it has at most so many bytes; else one with fewer points of its lines, fewer players, shorter tables.

    Of every stretch of a line its lowest and its highest point stay. Players go from the last to the second, and of
    every table the last rows stay. A page of many hundred results may still be larger.
    """
    if len(page_bytes(page)) <= most:
        return page
    for points in FEWER:
        words = f"{points} points of a line at most, its extremes among them: a report has at most {most / 1e6:g} MB"
        made = dataclasses.replace(_thinned(page, points), notes=(*page.notes, words))
        if len(page_bytes(made)) <= most:
            return made
    over = len(page_bytes(made)) - most
    over -= _leave_out_players(made, over)
    return _with_shorter_tables(made) if over > 0 else made


def _thinned(page: Page, most: int) -> Page:
    sections = copy.deepcopy(page.sections)
    for path in (one for section in sections for part in section.content for one in part.iter("path")):
        path.set("d", thinned_path(path.get("d", ""), most))
    return dataclasses.replace(page, sections=sections)


def thinned_path(path: str, most: int) -> str:
    """The path with at most so many points, but for two of every piece; one that is closed or has other parts stays."""
    found = POINT.findall(path)
    if len(found) <= most or path.endswith("Z") or "V" in path or "H" in path:
        return path
    end = "h0" if "h0" in path else ""
    starts = [i for i, (kind, _, _) in enumerate(found) if kind == "M"]
    # dots are pieces of one point each, and one line of them is thinned
    pieces = [found] if end else [found[a:b] for a, b in zip(starts, [*starts[1:], len(found)], strict=True)]
    parts = list[str]()
    for piece in pieces:
        heights = np.array([float(y) for _, _, y in piece])
        kept = thinned_line(heights, max(most * len(piece) // len(found), 4))
        parts += [f"{piece[i][0]}{piece[i][1]} {piece[i][2]}{end}" for i in kept.tolist()]
    return "".join(parts)


def _leave_out_players(page: Page, over: int) -> int:
    """Take players out of the page until it is smaller by so many bytes, or only one is left; by how many it is."""
    left_out = "This player was left out for the size of the page: a report of this result alone has it."
    saved = 0
    for holder, player in reversed(list(_holders(page))[1:]):
        if saved >= over:
            break
        note = element("p", left_out)
        saved += len(markup(player).encode()) - len(markup(note).encode())
        holder[list(holder).index(player)] = note
    return saved


def _with_shorter_tables(page: Page) -> Page:
    """The page with the last rows alone of every table."""
    for body in (one for section in page.sections for part in section.content for one in part.iter("tbody")):
        for row in list(body)[:-LAST_ROWS]:
            body.remove(row)
    return dataclasses.replace(page, notes=(*page.notes, f"of every table the last {LAST_ROWS} rows at most"))


def _holders(page: Page) -> Iterator[tuple[Element, Element]]:
    """Every player with what holds it."""
    for section in page.sections:
        for part in section.content:
            for holder in part.iter():
                for child in holder:
                    if child.get("class") == "player":
                        yield holder, child
