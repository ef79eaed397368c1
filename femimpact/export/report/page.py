"""A report as one HTML file: nothing in it is fetched from anywhere, and the same content gives the same bytes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from femimpact.export.files import atomic_write
from femimpact.export.report.blocks import Conclusion, Section, conclusions_element, list_element, section_element
from femimpact.svg.chart import chart_style
from femimpact.svg.elements import Child, Element, element, markup

__all__ = ["MOST_BYTES", "Page", "page_bytes", "write_page"]

MOST_BYTES = 3_000_000
"""Of a report."""

POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
"""What a browser lets the page do: its own styles and scripts, and no request."""

SCRIPTS = ("charts.js", "tables.js", "player.js")


@dataclass(frozen=True, eq=False)
class Page:
    """What a report says, from top to bottom.

    Parameters
    ----------
    title : str
    lead : tuple of str
        What was computed, in sentences.
    drawing : Element or None
        The structure.
    conclusions : tuple of Conclusion
    missing, warnings, notes : tuple of str
    sections : tuple of Section
    """

    title: str
    lead: tuple[str, ...] = ()
    drawing: Element | None = None
    conclusions: tuple[Conclusion, ...] = ()
    missing: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    sections: tuple[Section, ...] = ()


def write_page(path: Path, page: Page) -> Path:
    """Write a report, whole or not at all."""
    atomic_write(path, page_bytes(page))
    return path


def page_bytes(page: Page) -> bytes:
    """A report as the bytes of its file."""
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", http_equiv="Content-Security-Policy", content=POLICY),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("meta", name="color-scheme", content="light dark"),
        element("meta", name="generator", content="femimpact"),
        element("title", page.title),
        element("style", chart_style() + _own("report.css")),
    )
    body = element(
        "body",
        element("a.skip", "to the conclusions", href="#conclusions"),
        element(
            "header",
            element("p.maker", "femimpact"),
            element("h1", page.title),
            *(element("p.lead", text) for text in page.lead),
        ),
        element("main", *_main(page)),
        *(element("script", _own(name)) for name in SCRIPTS),
    )
    text = "<!DOCTYPE html>\n" + markup(element("html", head, body, lang="en")) + "\n"
    return text.encode("utf-8")


def _main(page: Page) -> list[Child]:
    sections = [
        *_found(page),
        *([Section("structure", "The structure", (page.drawing,))] if page.drawing is not None else []),
        *page.sections,
    ]
    return [_contents(sections), *(section_element(section) for section in sections)]


def _found(page: Page) -> list[Section]:
    """Conclusions, and what must be known before they are used."""
    content: list[Element] = []
    if page.conclusions:
        content.append(conclusions_element(page.conclusions))
    for texts, kind, heading in (
        (page.missing, "missing", "What is missing"),
        (page.warnings, "warnings", "Warnings"),
        (page.notes, "notes", "Notes"),
    ):
        if texts:
            content.append(element(f"div.said.{kind}", element("h3", heading), list_element(texts, kind)))
    if not content:
        content.append(element("p", "No numbers were found that could stand here."))
    return [Section("conclusions", "What was found", tuple(content))]


def _contents(sections: Sequence[Section]) -> Element:
    links = [element("li", element("a", section.heading, href=f"#{section.key}")) for section in sections]
    return element("nav", element("ul", *links), aria_label="Contents")


def _own(name: str) -> str:
    return files("femimpact.export.report").joinpath(name).read_text(encoding="utf-8")
