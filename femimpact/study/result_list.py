"""The end of a report: versions and seeds of the results, and the files beside it with what each is for."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from femimpact.export.report.blocks import Section
from femimpact.study.result_files import FILES, NAMES, OTHER_FILES, SUMMARY, result_files
from femimpact.study.study import Study
from femimpact.svg.elements import element

__all__ = ["about_section", "files_section"]

PURPOSES = {
    "summary": "the numbers of this page, machine-readable",
    "study": "the study that was run; femimpact run computes it again",
    "modes": "frequencies, damping and effective masses of the modes",
    "mode_shapes": "mode shapes with labels (netCDF, xarray)",
    "sweep": "response curves, a row for each frequency",
    "sweep_data": "response curves with labels (netCDF, xarray)",
    "history": "every channel over time (netCDF, xarray)",
    "impacts": "every impact, a row each",
    "impact_data": "impacts with the energy to each mode (netCDF, xarray)",
    "snapshots": "whole deflections, from which player and movie are drawn",
    "last_cycles": "channels of the last cycles at every step",
    "modes_scene": "mode shapes for ParaView",
    "modes_script": "opens modes.pvd in ParaView",
    "deflection_scene": "the moving beam for ParaView, also at every impact",
    "deflection_script": "opens deflection.pvd in ParaView",
    "deflection_hdf": "the moving beam for ParaView in one file",
    "movie": "the moving beam in slow motion",
    "movie_without_encoder": "the moving beam in slow motion",
    "mode_figure": "mode shapes",
    "response_figure": "response curves",
    "force_figure": "contact force over the last cycles",
    "portrait_figure": "phase portraits",
    "impact_histograms": "how often which impact speed and impulse came",
    "impulse_phase": "impulse over the phase of the base",
    "sticking": "times in which a ball and its wall moved together",
    "old_sticking": "times in which a ball and its wall moved together",
    "base_record": "the record that moved the base",
    "contact_table": "one collision of every contact over its speed",
    "comparison": "the paper beside ours",
    "restitution": "scan of the restitution",
    "restitution_figure": "scan of the restitution",
    "response_of_starts": "response curves of both starts",
    "mesh_convergence": "natural frequencies over the mesh",
    "mesh_convergence_figure": "natural frequencies over the mesh",
    "step_convergence": "errors of runs in steps",
    "step_convergence_figure": "errors of runs in steps",
    "quantities_over_mesh": "values and errors over the mesh",
    "quantities_over_step": "values and errors over the step",
    "quantities_over_modes": "values and errors over the modes",
    "statistics_over_mesh": "means of runs with contacts over the mesh",
    "convergence_summary": "orders and recommended numbers",
    "convergence_notes": "what was studied, with versions and notes",
    "report": "this page",
}
"""What each file is for, by its key."""

UNSIZED = frozenset({SUMMARY, OTHER_FILES["report"]})
"""Files whose size the report itself changes."""


def about_section(summary: Mapping[str, Any], study: Study | None) -> Section:
    """Versions, the compiled core, and where chance comes in."""
    rows: list[tuple[str, str]] = []
    versions, core = summary.get("versions"), summary.get("core")
    if isinstance(versions, Mapping):
        rows += [(str(name), str(version)) for name, version in versions.items()]
    if isinstance(core, Mapping):
        rows.append(
            (
                "compiled core",
                ", ".join(f"{name} {core[name]}" for name in ("target", "compiler", "kind") if name in core),
            )
        )
        if "sources" in core:
            rows.append(("its sources (SHA-256)", str(core["sources"])))
    seeds = summary.get("seeds")
    rows.append(("seeds", str(seeds) if seeds else "none: no random numbers were used"))
    if study is not None:
        rows.append(
            (
                "start",
                {"base": "at rest relative to the base", "space": "at rest in the inertial frame"}.get(
                    study.base.start, study.base.start
                ),
            )
        )
    if not isinstance(versions, Mapping):
        rows.insert(0, ("versions", "not known: the results do not say"))
    pairs = [part for name, value in rows for part in (element("dt", name), element("dd", value))]
    return Section("versions", "Versions and seeds", (element("dl.about", *pairs),))


def files_section(folder: Path, summary: Mapping[str, Any]) -> tuple[Section, tuple[str, ...]]:
    """The files of results with what each is for, and lines for those that are lost."""
    present = set(result_files(folder)) | {
        OTHER_FILES["report"],
        SUMMARY if (folder / SUMMARY).exists() else OTHER_FILES["report"],
    }
    keys = {name: key for key, name in {**OTHER_FILES, **FILES}.items()}
    rows = []
    for name in sorted(set(NAMES) & present):
        size = "" if name in UNSIZED else _size((folder / name).stat().st_size)
        rows.append((name, size, _purpose(name, keys[name])))
    for scene in sorted({name.partition("/")[0] for name in present if "/" in name}):
        frames = [name for name in present if name.startswith(f"{scene}/")]
        total = sum((folder / name).stat().st_size for name in frames)
        rows.append((f"{scene}/", _size(total), f"{len(frames)} frames of {scene}.pvd"))
    body = [
        element(
            "tr", element("td", element("a", name, href=name)), element("td.number", size), element("td", words),
        )
        for name, size, words in sorted(rows)
    ]  # fmt: skip
    head = element(
        "tr",
        element("th", "file", scope="col"),
        element("th.number", "size", scope="col"),
        element("th", "what it is for", scope="col"),
    )
    shown = element(
        "table", element("caption", "Files beside this page"), element("thead", head), element("tbody", *body)
    )
    holder = element(
        "div.table", element("div.scroll", shown, tabindex="0", role="region", aria_label="Files beside this page")
    )
    return Section("files", "Files", (holder,)), _lost(summary, present)


def _lost(summary: Mapping[str, Any], present: set[str]) -> tuple[str, ...]:
    known = summary.get("checksums")
    lost = sorted(set(map(str, known)) - present) if isinstance(known, Mapping) else []
    if not lost:
        return ()
    more = f" and {len(lost) - 5} more" if len(lost) > 5 else ""
    return (f"files that {SUMMARY} names and that are gone: {', '.join(lost[:5])}{more}",)


def _purpose(name: str, key: str) -> str:
    if key in PURPOSES:
        return PURPOSES[key]
    if name.startswith("mode_"):
        return f"mode {name.split('_')[1].partition('.')[0]} over its period, for ParaView"
    return f"the same as a figure: {name.removesuffix('.png')}.csv" if name.endswith(".png") else ""


def _size(count: int) -> str:
    for unit, factor in (("MB", 1e6), ("kB", 1e3)):
        if count >= factor:
            return f"{count / factor:.3g} {unit}"
    return f"{count} B"
