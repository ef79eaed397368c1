"""A report as one HTML file: nothing in it is fetched from anywhere, and the same content gives the same bytes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from femimpact.app.report.markup import Child, Element, element, markup
from femimpact.files import atomic_write
from femimpact.sweep.curve import ONE_START
from femimpact.units import MINUS, NO_NUMBER, name_words, typeset_number

MOST_ROWS = 200
"""Rows of a table that a report shows."""

MANY = 25
"""Rows beyond which a table has a fixed height and scrolls."""

DIGITS = 5
"""Significant digits of the largest number of a column."""

LEAST_DIGITS, MOST_DIGITS = 4, 7
"""Significant digits of the smallest number of a column at least, and of the largest one at most."""

MOST_CARDS = 6
"""Conclusions that stand side by side; the others are rows of a table."""

LONG = 12
"""Letters of a value from which on it is set smaller."""

SHORT = 22
"""Letters up to which a text is not divided into lines."""


@dataclass(frozen=True)
class Conclusion:
    """A number that a run has found."""

    label: str
    value: str
    unit: str = ""
    scatter: str = ""  # its range over several starts, or its interval, in words
    one_sample: bool = False  # whether another start would have another value
    note: str = ""  # what it is of
    details: tuple[str, ...] = ()  # what else is known of it, a line each


@dataclass(frozen=True, eq=False)
class Table:
    """Rows of cells."""

    title: str
    header: tuple[str, ...]  # names, with their units
    rows: tuple[tuple[Any, ...], ...]  # numbers, texts, or None
    file: str = ""  # the file that holds all rows, or nothing
    total: int | None = None  # how many rows there are, where these are not all
    digits: Mapping[int, int] = field(default_factory=dict)  # significant ones, of columns by their numbers from 0


@dataclass(frozen=True, eq=False)
class Section:
    """A part of a report with a heading."""

    key: str  # letters and hyphens, by which the table of contents leads to it
    heading: str
    content: tuple[Element, ...] = field(default=())


def section_element(section: Section) -> Element:
    """A section with its heading."""
    heading = f"{section.key}-heading"
    return element(
        "section", element("h2", section.heading, id=heading), *section.content, id=section.key, aria_labelledby=heading
    )


def conclusions_element(conclusions: Iterable[Conclusion]) -> Element:
    """The first conclusions side by side, the others as a table, and what the mark of one sample means."""
    listed = list(conclusions)
    cards, others = listed[:MOST_CARDS], listed[MOST_CARDS:]
    marked = any(one.one_sample for one in listed)
    words = element("p.below", "One sample: the motion does not repeat, and another start has another value.")
    rows = tuple(
        (one.label, f"{one.value} {one.unit}".rstrip(), "; ".join(_certainty(one)), "; ".join((one.note, *one.details)))
        for one in others
    )
    table = table_element(Table("Further numbers", ("quantity", "value", "range", "of"), rows)) if rows else None
    return element("div", element("dl.conclusions", *map(_conclusion, cards)), table, words if marked else None)


def _certainty(one: Conclusion) -> Iterator[str]:
    """The range of a conclusion, and whether another start has another value."""
    if one.scatter:
        yield one.scatter
    if one.one_sample:
        yield "one sample"


def conclusion_lines(conclusions: Iterable[Conclusion]) -> Iterator[str]:
    """The same in lines for a terminal."""
    marked = False
    for one in conclusions:
        value = f"{one.value}{'*' if one.one_sample else ''} {one.unit}".rstrip()
        beside = f" ({one.scatter})" if one.scatter else ""
        yield f"{one.label}: {value}{beside}{f'; {one.note}' if one.note else ''}"
        yield from (f"  {text}" for text in one.details)
        marked = marked or one.one_sample
    if marked:
        yield f"* {ONE_START}"


def _conclusion(one: Conclusion) -> Element:
    details: list[Child] = []
    if one.scatter:
        details.append(element("dd.scatter", one.scatter))
    if one.one_sample:
        details.append(element("dd.sample", "one sample"))
    if one.note:
        details.append(element("dd.of", one.note))
    value = element(
        "dd.value" if len(one.value) < LONG else "dd.value.words",
        one.value,
        element("span.unit", f" {one.unit}") if one.unit else None,
    )
    if one.details:
        details.append(element("dd.of", list_element(one.details, "known")))
    # several lines need the width of the page
    return element("div.with-details" if len(one.details) > 1 else "div", element("dt", one.label), value, *details)


def list_element(texts: Sequence[str], kind: str) -> Element:
    """Texts one below the other; `kind` is the class of the list."""
    return element(f"ul.{kind}", *(element("li", text) for text in texts))


# ---- tables ---------------------------------------------------------------------------------------


def table_of(
    title: str, columns: Mapping[str, Any], units: Mapping[str, str], file: str = "", most: int = MOST_ROWS,
    digits: Mapping[str, int] | None = None,
) -> Table:  # fmt: skip
    """The first rows of columns as a table."""
    # a unit is not divided
    known = {name: f" ({unit})".replace(" ", "\u00a0")[1:] for name, unit in units.items() if unit not in ("", "1")}
    header = tuple(f"{name_words(name)} {known.get(name, '')}".rstrip(" ") for name in columns)
    arrays = [np.asarray(values) for values in columns.values()]
    count = min((array.shape[0] for array in arrays), default=0)
    rows = tuple(zip(*(array[:most].tolist() for array in arrays), strict=False))
    more = {number: digits[name] for number, name in enumerate(columns) if digits and name in digits}
    return Table(title, header, rows, file, count if count > most else None, more)


def table_element(table: Table) -> Element:
    """A table that a script sorts and copies."""
    columns = [[row[i] for row in table.rows] for i in range(len(table.header))]
    held = [[value for value in column if value is not None and value != ""] for column in columns]
    numbers = [bool(values) and all(map(_is_number, values)) for values in held]
    head = element(
        "tr",
        *(
            element("th.number" if numeric else "th", name, scope="col")
            for name, numeric in zip(table.header, numbers, strict=True)
        ),
    )
    shown_as = [
        _number_cells(column, table.digits.get(i)) if numeric else _text_cells(column)
        for i, (column, numeric) in enumerate(zip(columns, numbers, strict=True))
    ]
    body = [element("tr", *cells) for cells in zip(*shown_as, strict=True)]
    shown = element("table", element("caption", table.title), element("thead", head), element("tbody", *body))
    return element(
        "div.table",
        element(
            "div.scroll.long" if len(table.rows) > MANY else "div.scroll",
            shown,
            tabindex="0",
            role="region",
            aria_label=table.title,
        ),
        element("p.below", rows) if (rows := _rows_words(table)) else None,
    )


def _texts(values: Sequence[Any], given: int | None = None) -> list[str]:
    """Numbers of a column with as many digits behind the point each, so that they stand below one another."""
    known = [float(value) for value in values if value is not None and value != ""]
    sizes = [abs(value) for value in known if math.isfinite(value) and value]
    if all(isinstance(value, (int, np.integer)) for value in values if value is not None and value != ""):
        return [_sign(str(value)) for value in values]
    largest, smallest = max(sizes, default=1.0), min(sizes, default=1.0)
    wide = largest > 1e4 * smallest
    if wide and largest >= 1e-3:
        # of several units: each number for itself
        each = given or DIGITS
        return [NO_NUMBER if value is None or value == "" else typeset_number(float(value), each) for value in values]
    if wide or largest < 1e-4 or largest >= 1e7:
        return [_plain(value, f"{float(value or 0.0):.{(given or LEAST_DIGITS) - 1}e}") for value in values]
    most, least = math.floor(math.log10(largest)), math.floor(math.log10(smallest))
    digits = min(max(DIGITS - 1 - most, LEAST_DIGITS - 1 - least), MOST_DIGITS - 1 - most)
    digits = max(0, digits if given is None else given - 1 - most)
    # of numbers that need none, none behind the point
    while digits and all(round(size, digits) == round(size, digits - 1) for size in sizes):
        digits -= 1
    return [_plain(value, f"{float(value or 0.0):.{digits}f}") for value in values]


def _plain(value: Any, text: str) -> str:
    if value is None or value == "" or math.isnan(float(value)):
        return NO_NUMBER
    if math.isinf(float(value)):
        return typeset_number(float(value))
    mantissa, _, exponent = text.partition("e")
    return _sign(f"{mantissa}e{int(exponent)}" if exponent else mantissa)


def _sign(text: str) -> str:
    return text.replace("-", MINUS)


def _rows_words(table: Table) -> str:
    if table.total is not None:
        more = f" All are in {table.file}." if table.file else ""
        return f"The first {len(table.rows)} of {table.total} rows.{more}"
    return f"From {table.file}." if table.file else ""


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)


def _number_cells(values: Sequence[Any], digits: int | None) -> list[Element]:
    return [
        element(
            "td.number",
            text,
            data_value="" if text == NO_NUMBER else value if isinstance(value, int) else repr(float(value)),
        )
        for value, text in zip(values, _texts(values, digits), strict=True)
    ]


def _text_cells(values: Sequence[Any]) -> list[Element]:
    texts = [NO_NUMBER if value is None or value == "" else str(value) for value in values]
    texts = [typeset_number(value, 5) if _is_number(value) else text for value, text in zip(values, texts, strict=True)]
    kind = "td.short" if max(map(len, texts), default=0) <= SHORT else "td"
    return [element(kind, text, data_value="" if text == NO_NUMBER else None) for text in texts]


POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
"""Allows a browser the styles and scripts of the page, and no request."""

SCRIPTS = ("tables.js", "player.js")


@dataclass(frozen=True, eq=False)
class Page:
    """Content of a report, from top to bottom."""

    title: str
    by: str = ""  # author and date
    answer: str = ""  # a sentence
    lead: tuple[str, ...] = ()  # what was computed, in sentences
    drawing: Element | None = None  # the structure
    conclusions: tuple[Conclusion, ...] = ()
    missing: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    sections: tuple[Section, ...] = ()
    first: tuple[Section, ...] = ()  # before the drawing
    foot: str = ""  # the last line
    short: bool = False  # on one sheet of paper


def write_page(path: Path, page: Page) -> Path:
    """Write a report."""
    atomic_write(path, page_bytes(page))
    return path


def page_bytes(page: Page) -> bytes:
    """A report as the bytes of its file."""
    structure = [] if page.drawing is None else [Section("structure", "The structure", (page.drawing,))]
    found = _found(page)
    sections = [*([found] if found.content else ()), *page.first, *structure, *page.sections]
    links = [element("li", element("a", section.heading, href=f"#{section.key}")) for section in sections]
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", http_equiv="Content-Security-Policy", content=POLICY),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("meta", name="color-scheme", content="light dark"),
        element("meta", name="generator", content="femimpact"),
        element("title", page.title),
        element("style", _packaged("report.css")),
    )
    body = element(
        "body.sheet" if page.short else "body",
        element("a.skip", "to the conclusions", href="#conclusions") if found.content else None,
        element(
            "header",
            element("p.maker", "femimpact"),
            element("h1", page.title),
            element("p.by", page.by) if page.by else None,
            element("p.answer", page.answer) if page.answer else None,
            *(element("p.lead", text) for text in page.lead),
        ),
        element(
            "main",
            None if page.short else element("nav", element("ul", *links), aria_label="Contents"),
            *(section_element(section) for section in sections),
        ),
        element("footer", element("p", page.foot)) if page.foot else None,
        *(element("script", _packaged(name)) for name in SCRIPTS),
    )
    text = "<!DOCTYPE html>\n" + markup(element("html", head, body, lang="en")) + "\n"
    return text.encode("utf-8")


WARNINGS_PAGE = 'page "Warnings" of the documentation, under "Reference"'
"""The page on what each warning means and what to do, by its title."""


def _found(page: Page) -> Section:
    """Conclusions, and what must be known before they are used."""
    content: list[Element] = []
    if page.conclusions:
        content.append(conclusions_element(page.conclusions))
    for texts, kind, heading in (
        (page.missing, "missing", "What is missing"),
        (page.warnings, "warnings", "Limits" if page.short else "Warnings"),
        (page.notes, "notes", "Notes"),
    ):
        if texts:
            explained = kind == "warnings" and not page.short
            where = element("p", f"What each means and what to do: {WARNINGS_PAGE}") if explained else None
            content.append(element(f"div.said.{kind}", element("h3", heading), list_element(texts, kind), where))
    return Section("conclusions", "What was found", tuple(content))


def _packaged(name: str) -> str:
    return files("femimpact.app.report").joinpath(name).read_text(encoding="utf-8")
