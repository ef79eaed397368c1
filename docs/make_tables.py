"""Write the tables of pages from the files that the code made: `python docs/make_tables.py`.

A page holds a table between `<!-- table NAME -->` and `<!-- end of table -->`. Its rows are those of `tables/NAME.csv`;
the keys of study files (`keys`) and the help of commands (`commands`) are those of `generated.py`.
`--check` writes nothing, and ends with status 1 where a page has other rows, or other words of a command.

| file | made by |
| --- | --- |
| `validation.csv` | `femimpact validate -o docs/tables/validation.csv --force` |
| `other_programs.csv` | `femimpact validate --other-programs -o docs/tables/other_programs.csv --force` |
| `comparison.csv` | `femimpact demo`, in its directory |
| `work_precision.csv` | `python benchmarks/work_precision.py --table docs/tables/work_precision.csv` |
| `beside_c.csv`, `beside_programs.csv`, `time_for_error.csv` | `python benchmarks/compare.py`, in its directory |
| `step.csv` | by hand, from the table of the fixed step in `compare.md` of that directory |
| `parts.csv` | `python benchmarks/step_parts.py --table docs/tables/parts.csv` |
"""

from __future__ import annotations

import csv
import re
import runpy
import sys
from pathlib import Path

from femimpact.validation.case import Case, markdown_table, table_row

HERE = Path(__file__).parent
BLOCK = re.compile(r"(<!-- table (\w+) -->\n).*?(<!-- end of table -->)", flags=re.DOTALL)
OF_PROGRAMS = ["case", "theirs", "ours", "difference", "bound", "what explains the difference"]
"""Headings of the table of other programs, whose sources are in another table of their page."""


def table(name: str, folder: Path = HERE / "tables") -> str:
    """The Markdown of a table, from its file."""
    if name in ("keys", "commands"):
        lines = runpy.run_path(str(HERE / "generated.py"))[f"{name.removesuffix('s')}_page"]()
        return "\n".join(lines).lstrip("\n") + "\n\n"
    with (folder / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    if name == "validation":
        return markdown_table([_case(dict(zip(header, row, strict=True))) for row in rows])
    if name == "other_programs":
        cases = [_case(dict(zip(header, row, strict=True))) for row in rows]
        header, rows = OF_PROGRAMS, [[_with_unit(case), *table_row(case)[3:7], case.reason] for case in cases]
    lines = [header, ["---"] * len(header), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _with_unit(case: Case) -> str:
    return case.name if case.unit == "1" else f"{case.name} ({case.unit})"


def _case(row: dict[str, str]) -> Case:
    numbers = {name: float(row[name]) for name in ("reference", "computed", "bound")}
    return Case(**{name: row[name] for name in ("name", "source", "quantity", "unit", "reason")}, **numbers)


def written(text: str) -> str:
    """The text of a page with the tables that its files have."""
    return BLOCK.sub(lambda found: f"{found[1]}{table(found[2])}{found[3]}", text)


def main(check: bool = False) -> list[Path]:
    """Write all pages, or only find those whose tables differ from their files."""
    stale = []
    for page in sorted(HERE.rglob("*.md")):
        text = page.read_text(encoding="utf-8")
        new = written(text)
        # how a help is set differs from one version of the library to the next
        words = [re.findall(r"\w+", one) for one in (new, text)] if "<!-- table commands -->" in text else [new, text]
        if words[0] != words[1] or (new != text and not check):
            stale.append(page)
            if not check:
                page.write_text(new, encoding="utf-8")
    return stale


if __name__ == "__main__":
    CHECK = "--check" in sys.argv
    STALE = main(CHECK)
    print(*(f"{page.name}: {'differs from its file' if CHECK else 'written'}" for page in STALE), sep="\n")
    sys.exit(bool(STALE) and CHECK)
