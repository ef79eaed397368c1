"""What the documentation site takes from the code is complete."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest
from builders import TABLES
from public import PATHS

DOCS = Path(__file__).parent.parent / "docs"
SITE = runpy.run_path(str(DOCS / "generated.py"))


def test_every_public_name_has_a_page():
    listed = [name for names in SITE["groups"]().values() for name in names]
    assert sorted(listed) == sorted(PATHS.values())
    page = SITE["api_page"]().splitlines()
    # a function of figures may have the name of one of these
    assert [name for name in listed if f"   {name}" not in page] == []


def test_every_public_name_stands_on_the_page_of_one_subject():
    pages = SITE["subject_pages"]()
    for name in PATHS.values():
        below = [
            page for page, text in pages.items() if "currentmodule:: femimpact\n" in text and f"   {name}\n" in text
        ]
        assert len(below) == 1, name
    # the first page leads to each of them
    assert [page for page in pages if f"<{page.removesuffix('.rst')}>" not in SITE["api_page"]()] == []


def test_pages_with_keywords_have_them_below_their_title():
    for name, words in SITE["KEYWORDS"].items():
        content = [(DOCS / f"{name}.md").read_text(encoding="utf-8")]
        title = content[0].splitlines()[0]
        SITE["site_page"](None, name, content)
        assert content[0].startswith(f"{title}\n\n```{{index}} ! {words[0]}")


def test_every_key_of_a_study_file_is_shown_with_its_unit_and_range():
    text = "\n".join(SITE["key_page"]())
    for name in TABLES:
        assert f"[{name}]" in text
    assert "| `gap` | number or list of number | m | required |" in text
    assert "| `points` | whole number | 1 | required | >= 4, <= 100000 |" in text


def test_every_command_is_shown_with_an_example():
    pages = "\n".join(SITE["command_page"]()).split("## femimpact ")[1:]
    assert len(pages) > 12
    assert [page.split()[0] for page in pages if f"Example: femimpact {page.split()[0]}" not in page] == []


def test_every_quantity_of_a_channel_is_shown_with_its_unit():
    table = list(SITE["channel_page"]())
    assert "\n".join(table) in (DOCS / "reference" / "channels.md").read_text(encoding="utf-8")
    rows = [line.split(" | ") for line in table if line.startswith("| `")]
    units = {row[0].strip("| `"): row[2] for row in rows}
    assert units["velocity"] == "m/s"
    assert units["surface_stress_left"] == "Pa"
    assert units["reaction_moment"] == "N m"
    assert all(units.values())


def test_the_page_on_test_plans_has_every_unit():
    assert "\n".join(SITE["unit_page"]()) in (DOCS / "howto" / "test_plan.md").read_text(encoding="utf-8")


def test_every_example_stands_below_one_heading_of_the_gallery():
    listed = [name for names in SITE["EXAMPLES"].values() for name in names]
    assert sorted(listed) == sorted(path.stem for path in (DOCS.parent / "examples").glob("*.py"))


@pytest.mark.parametrize("page", sorted({*DOCS.glob("*.md"), *DOCS.glob("[dhprt]*/*.md")}), ids=lambda page: page.stem)
def test_every_page_begins_with_one_title(page):
    lines = page.read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("# ")


PAGES = sorted({*DOCS.glob("*.md"), *DOCS.glob("[dhprt]*/*.md")} - {DOCS / "index.md"})
"""All but the first page of the site, in whose place the repository has README."""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_is_plain_markdown_where_the_repository_is_hosted(page):
    text = page.read_text(encoding="utf-8")
    assert re.findall(r"```\{|^:::|\{[\w:]+\}`|MORE_PAGES", text, re.MULTILINE) == []


def test_every_page_has_its_place_in_the_navigation():
    for name in SITE["PARENTS"]:
        text = (DOCS / f"{name}.md").read_text(encoding="utf-8")
        listed = re.findall(r"^(\w+)$", SITE["pages_below"](name, text), re.MULTILINE)
        folder = DOCS / name.partition("/")[0]
        pages = {page.stem for page in folder.glob("*.md")} - {Path(name).name, "changelog"}
        assert sorted(listed) == sorted(pages)


def test_citations_and_names_become_those_of_the_site():
    content = [
        "# A title\n[Hertz (1882)](../references.bib#Hertz1882) and `fi.Spring`, `fi.nothing`, [`fi.Sine`](a.md)"
    ]
    SITE["site_page"](None, "howto/a_page", content)
    expected = "{cite:t}`Hertz1882` and {py:obj}`fi.Spring <femimpact.Spring>`, `fi.nothing`, [`fi.Sine`](a.md)"
    assert content[0].splitlines()[1] == expected
