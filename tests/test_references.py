"""Every work cited by author and year has its entry in docs/references.bib, and every entry is cited."""

from __future__ import annotations

import io
import re
import tokenize
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = sorted([*(ROOT / "femimpact").rglob("*.py"), *(ROOT / "femimpact").rglob("*.hpp")])
WRITTEN = {"_build", "api", "gallery"}
"""Folders of the site that a build writes."""
PAGES = [
    ROOT / "README.md",
    *sorted(path for path in (ROOT / "docs").rglob("*.md") if not WRITTEN & set(path.relative_to(ROOT).parts)),
]

CITED = re.compile(r"(?P<before>[A-Za-z][^;:|]{2,100}?)(?:, |\()(?P<year>(?:18|19|20)\d\d)\b(?![-.,]\d)")
"""A year after a comma or in brackets, and the words before it; a date or a measured number is not a year."""

LINK = re.compile(r"references\.bib#(\w+)")
"""The key that a link of a page cites."""


def _entries() -> dict[str, dict[str, str]]:
    """Fields of every entry, by its key."""
    text = (ROOT / "docs" / "references.bib").read_text(encoding="utf-8")
    found = re.findall(r"^@(\w+)\{(\w+),\n(.*?)^\}", text, re.MULTILINE | re.DOTALL)
    return {
        key: {"kind": kind, **dict(re.findall(r"^  (\w+) = \{(.*)\},$", body, re.MULTILINE))}
        for kind, key, body in found
    }


ENTRIES = _entries()


def _plain(text: str) -> str:
    """Letters without accents and TeX commands, lower case: Poeschel, Pöschel and P{"o}schel are one."""
    text = re.sub("[äöü]", lambda letter: {"ä": "ae", "ö": "oe", "ü": "ue"}[letter[0]], text)
    text = re.sub(r'\{?\\"\{?([aou])\}?\}?', r"\1e", text)
    text = re.sub(r"\{\\oe\}", "oe", text)
    return re.sub(r"\\[A-Za-z'`^\"](?:\{(\w)\})?|[{}]", r"\1", text).lower()


def _families(entry: dict[str, str]) -> list[str]:
    return [author.partition(",")[0] for author in _plain(entry["author"]).split(" and ")]


def _words(path: Path) -> str:
    """What a reader reads: a page, or the strings and comments of a source."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        return text
    if path.suffix == ".hpp":
        return " ".join(re.findall(r"//\s*(.*)$", text, re.MULTILINE))
    kinds = {tokenize.STRING, tokenize.COMMENT, getattr(tokenize, "FSTRING_MIDDLE", None)}
    return ";\n".join(
        token.string for token in tokenize.generate_tokens(io.StringIO(text).readline) if token.type in kinds
    )


def _citations(path: Path) -> list[tuple[str, str]]:
    """Words before each cited year, and the year."""
    text = re.sub(r"\s+", " ", _words(path))
    return [(match["before"], match["year"]) for match in CITED.finditer(text)]


def _works(before: str, year: str) -> set[str]:
    """Entries of that year whose first author stands in the words before it."""
    return {
        key
        for key, entry in ENTRIES.items()
        if entry["year"] == year and re.search(rf"\b{re.escape(_families(entry)[0])}\b", _plain(before))
    }


def _keys(path: Path) -> set[str]:
    """Keys of the entries that a page names."""
    return set(LINK.findall(path.read_text(encoding="utf-8")))


def test_every_citation_has_an_entry():
    missing = [f"{page.relative_to(ROOT)}: {key}" for page in PAGES for key in _keys(page) - set(ENTRIES)]
    missing += [
        f"{path.relative_to(ROOT)}: ...{before[-60:]}, {year}"
        for path in (*SOURCES, *PAGES)
        for before, year in _citations(path)
        if not _works(before, year)
    ]
    assert missing == []


def test_every_entry_is_cited():
    cited = {key for path in (*SOURCES, *PAGES) for citation in _citations(path) for key in _works(*citation)}
    cited |= {key for page in PAGES for key in _keys(page)}
    assert set(ENTRIES) - cited == set()


@pytest.mark.parametrize("key", ENTRIES)
def test_an_entry_names_who_what_where_and_when(key):
    entry = ENTRIES[key]
    # the key is the families of up to three authors, or of the first of more, and the year
    assert key.endswith(entry["year"])
    assert key.lower().startswith(_families(entry)[0])
    assert entry["title"]
    place = {"article": "journal", "book": "publisher", "incollection": "booktitle", "misc": "howpublished"}[
        entry["kind"]
    ]
    assert entry.get(place) or entry.get("doi")


def test_the_paper_cites_all_works_of_its_file_and_has_the_words_that_the_journal_asks_for():
    text = (ROOT / "paper.md").read_text(encoding="utf-8").partition("\n---\n")[2]
    works = re.findall(r"^@\w+\{(\w+),$", (ROOT / "paper.bib").read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(set(re.findall(r"@(\w+)", text))) == sorted(works)
    assert 750 <= len(text.split()) <= 1000
    headings = ["Summary", "Statement of need", "State of the field", "Software design", "Research impact statement"]
    assert re.findall(r"^# (.*)$", text, re.MULTILINE)[:5] == headings
