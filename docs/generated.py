"""Pages of the site that are written from the code: names, keys of the study file, commands, channels, versions."""

from __future__ import annotations

import builtins
import io
import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import femimpact as fi
from femimpact.lazy import modules_of

HERE = Path(__file__).parent

SUBJECTS = {
    "structure": "Structures: beams, bodies, balls, stops, supports, damping",
    "contact": "Contact laws and single collisions",
    "excitation": "Excitations",
    "fem": "Meshes and assembly",
    "system": "Systems, modes, reduction, states",
    "integrators": "Methods and runs",
    "sweep": "Sweeps",
    "design": "Design of dampers",
    "response": "Recorders, responses, impacts, energies",
    "signals": "Signals: damping from curves and decays, spectra, transfer functions, shock response spectra, laser",
    "parametric": "Parameter studies",
    "convergence": "Convergence studies",
    "orbits": "Periodic orbits and their branches",
    "study": "Study files and their results",
    "figures": "Pictures and files",
    "errors": "Errors and warnings",
    "versions": "Versions",
}
"""Headings of the groups of public names, by the folder of `femimpact` or of its `app` that holds them."""

WITH = {
    "results": "study",
    "tasks": "study",
    "report": "study",
    "planned_test": "parametric",
    "vtk": "figures",
    "refinement": "parametric",
}
"""Folders whose names stand in the group of another."""

SUBMODULES = {
    "femimpact.figures": ("femimpact.figures", "Figures of results"),
    "femimpact.vtk": ("femimpact.vtk", "Files for ParaView"),
    "femimpact.response.history_file": ("femimpact.response.history_file", "Histories written while a run goes on"),
    "femimpact.files": ("femimpact.files", "Tables as files"),
}
"""Modules of public functions: how a script calls them, where they are, and their headings."""


def write(folder: Path) -> None:
    """Write every generated part into a folder; what has not changed keeps its time."""
    folder.mkdir(exist_ok=True)
    pages = {
        "index.rst": api_page(),
        **subject_pages(),
    }
    for name, text in pages.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


# ---- public names ---------------------------------------------------------------------------------


def public_modules() -> dict[str, str]:
    """Module of each public name of `femimpact` and of its folders, by the path of the name below `femimpact`."""
    top = modules_of(fi.__file__)
    folders = [name for name, module in top.items() if module == "." and f"femimpact.{name}" not in SUBMODULES]
    inner = {f"{folder}.{name}": module for folder in folders for name, module in _stub_of(folder).items()}
    return {name: module for name, module in top.items() if module != "."} | inner


def _stub_of(folder: str) -> dict[str, str]:
    return modules_of(getattr(fi, folder).__file__)


def groups() -> dict[str, list[str]]:
    """Public names by the folder that holds them, each by its path below `femimpact`."""
    found: dict[str, list[str]] = {}
    for name, module in sorted(public_modules().items()):
        folder = module.removeprefix("femimpact.").removeprefix("app.").partition(".")[0]
        found.setdefault(WITH.get(folder, folder), []).append(name)
    return {**{key: found.pop(key) for key in SUBJECTS if key in found}, **found}


API_HEAD = """Python names
============

Everything in the first parts of this page is called as ``import femimpact as fi``, then ``fi.NAME``, where a name may
have its folder before it (``fi.contact.Flores``); the last parts are
modules. Values are in SI units, and ``frequency`` is in Hz. Each name has a page with its arguments, shapes, units and
errors, and with the examples that use it.

.. toctree::
   :hidden:

"""


def subjects() -> dict[str, tuple[str, str, str, list[str]]]:
    """Names by the page of their subject: what the page is called, its heading, its module, and the names."""
    found = {}
    for key, names in groups().items():
        heading = SUBJECTS.get(key, key.capitalize())
        found[key] = (heading.partition(":")[0], heading, "femimpact", names)
    for module, (place, heading) in SUBMODULES.items():
        found[module] = (heading, f"{heading}: ``{module}``", place, _functions(place))
    return found


def api_page() -> str:
    """Tables of all public names with the first sentence of each, below the heading of their subject."""
    pages = subjects()
    lines = [API_HEAD + "\n".join(f"   {short} <of_{page}>" for page, (short, *_) in pages.items())]
    for _, heading, module, names in pages.values():
        lines += autosummary(heading, module, names)
    return "\n".join(lines)


def subject_pages() -> dict[str, str]:
    """A page for each subject, below which every name has its own: so the sidebar shows names by subject."""
    pages = subjects().items()
    made = {f"of_{page}.rst": autosummary(heading, module, names, "=") for page, (_, heading, module, names) in pages}
    return {name: "\n".join(lines).lstrip("\n") for name, lines in made.items()}


def _functions(place: str) -> list[str]:
    """Functions and classes that a module offers."""
    import importlib

    module = importlib.import_module(place)
    return [name for name in module.__all__ if callable(getattr(module, name))]


def autosummary(heading: str, module: str, names: Iterable[str], underline: str = "-") -> list[str]:
    """A heading and the table of the names below it; below that of a page (=) each name has a page of its own."""
    rows = [f"   {name}" for name in names]
    head = [heading, underline * len(heading), "", f".. currentmodule:: {module}", "", ".. autosummary::"]
    pages = ["   :toctree: ."] if underline == "=" else []
    return ["", *head, *pages, "   :nosignatures:", "", *rows, ""]


def plain_docstring(_app: Any, _what: str, _name: str, _object: Any, _options: Any, lines: list[str]) -> None:
    """Docstrings are plain text: |w| is a size there, u* and q_ are names, and equations stand in the text."""
    for number, line in enumerate(lines):
        words = re.sub(r"(?<!\\)\|", r"\\|", line)
        words = re.sub(r"(?<=\w)\*\*(?=[\w(-])", r"\\*\\*", words)
        words = re.sub(r"\*(?=args|given|\()", r"\\*", words)
        lines[number] = re.sub(r"(?<=[A-Za-z0-9])_(?=[\s,.;:)]|$)", r"\\_", words)


# ---- the study file -------------------------------------------------------------------------------


def key_page() -> Iterator[str]:
    """A table of keys for every table of the study file, from the JSON schema."""
    from femimpact.app.study.study_file import study_schema

    schema = study_schema()
    required = set(schema["required"])
    for name, table in schema["properties"].items():
        many = table.get("type") == "array"
        inner = table["items"] if many else table
        yield from ["", f"## `{'[[' if many else '['}{name}{']]' if many else ']'}`", ""]
        yield ("Required. " if name in required else "") + inner.get("description", "") + "\n"
        for heading, part in _alternatives(inner):
            if heading:
                yield f"\n**{heading}**\n"
            yield from _key_table(part)
        for key, about in inner.get("properties", {}).items():
            if "$ref" in about:
                yield from _axis_table(name, key, schema["$defs"][key])
            elif "properties" in about:
                yield from ["", f"### `[{name}.{key}]`", "", about.get("description", ""), ""]
                yield from _key_table(about)
            if "oneOf" in about and key == "contact":
                for heading, part in _alternatives(about):
                    yield f"\n**`contact`: {heading}**\n"
                    yield from _key_table(part)


def _axis_table(name: str, key: str, about: dict[str, Any]) -> Iterator[str]:
    """A table of the forms that the values of an axis have."""
    yield from ["", f"### `[{name}.{key}]`", "", about["description"] + " At least one.", ""]
    yield "| an axis is | keys | type |"
    yield "| --- | --- | --- |"
    for form in about["additionalProperties"]["anyOf"]:
        if "$ref" in form:
            continue
        keys = ", ".join(f"`{inner}`" for inner in form.get("properties", {}))
        types = dict.fromkeys(_type(inner) for inner in form.get("properties", {"": form}).values())
        yield f"| {form['title']} | {keys} | {', '.join(types)} |"


def _alternatives(part: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """The forms of a table, each with its heading."""
    if "oneOf" not in part:
        return [("", part)]
    return [(one.get("title", ""), one) for one in part["oneOf"]]


def _key_table(part: dict[str, Any]) -> Iterator[str]:
    needed = set(part.get("required", ()))
    yield "| key | type | unit | default | range | meaning |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for key, about in part["properties"].items():
        default = "required" if key in needed else _shown(about.get("default"))
        cells = (f"`{key}`", _type(about), about.get("x-unit", ""), default, _bounds(about.get("x-range", "")))
        yield f"| {' | '.join(cells)} | {about.get('description', '')} |"


def _bounds(words: str) -> str:
    """A range without the words that stand in the columns of type and unit."""
    if words in ("a text", "texts") or words.startswith(("'", "True or False")):
        return ""
    if not words.startswith(("a finite", "a whole")):
        return words
    return ", ".join(re.findall(r"[<>]=? -?\d[\d.e+-]*", words))


def _shown(value: Any) -> str:
    return "" if value is None else f"`{str(value).lower() if isinstance(value, bool) else value}`"


def _type(about: dict[str, Any]) -> str:
    words = {"number": "number", "integer": "whole number", "string": "text", "boolean": "true or false"}
    if "const" in about:
        return f'`"{about["const"]}"`'
    if "enum" in about:
        return " or ".join(f"`{json.dumps(name)}`" for name in about["enum"])
    if "anyOf" in about or "oneOf" in about:
        # every number may be a text with a unit: the page says so once
        parts = [part for part in about.get("anyOf", about.get("oneOf")) if "pattern" not in part]
        return " or ".join(dict.fromkeys(_type(part) for part in parts))
    if "prefixItems" in about:
        return "list of two numbers"
    if about.get("type") == "array" and about.get("maxItems") == 2 and "anyOf" not in about["items"]:
        return "pair of numbers"
    if about.get("type") == "array":
        return f"list of {_type(about['items'])}" if "items" in about else "list"
    return words.get(about.get("type", ""), "table")


# ---- commands, channels ---------------------------------------------------------------------------


def command_page() -> Iterator[str]:
    """What every command prints as its help."""
    from rich.console import Console

    from femimpact.cli import app

    for name in app:
        if name.startswith("-"):
            continue
        text = io.StringIO()
        app.help_print([name], console=Console(width=100, file=text, color_system=None))
        yield from ["", f"## femimpact {name}", "", "```text", text.getvalue().strip("\n"), "```"]


def unit_page() -> Iterator[str]:
    """The units that a text of a study file may have, by the unit of the key."""
    from femimpact.units import UNITS

    yield "| of a key in | units, and others of the same dimension |"
    yield "| --- | --- |"
    for unit, fitting in UNITS.items():
        yield f"| {unit} | {', '.join(fitting)} |"


def channel_page() -> Iterator[str]:
    """Every quantity that may stand behind the dot of a channel's name, with its unit."""
    from femimpact.response.channels import QUANTITIES

    yield "| behind the dot | of | unit | example |"
    yield "| --- | --- | --- | --- |"
    for name, entry in QUANTITIES.items():
        if not entry.of:
            continue
        of = entry.of[0]
        place = {"place": "tip", "ball": "ball", "stop": "stop"}[of]
        if name.startswith("reaction"):
            place = "root"
        yield f"| `{name}` | {', '.join(f'a {kind}' for kind in entry.of)} | {entry.unit} | `{place}.{name}` |"
    yield "| `shaker_force`, without a place | the base | N | `shaker_force` |"


KEYWORDS = {
    "howto/mode_shapes_in_paraview": ("mode shapes paraview", "vtk", "animation of a mode"),
    "reference/words": (
        "units", "SI units", "transmissibility", "logarithmic decrement", "laser vibrometer", "how sure", "uncertainty",
        "confidence interval",
    ),
    "howto/parameter_studies": (
        "optimal gap", "choose a gap", "first gap", "optimum", "tolerance of the gap", "sensitivity",
    ),
    "theory/identification": ("logarithmic decrement", "damping from a measurement", "quality factor"),
    "howto/restitution_values": ("coefficient of restitution", "contact duration", "drop test"),
    "howto/installation": ("windows", "macos", "pip error", "no-build-isolation"),
    "howto/before_the_test": ("sweep too fast", "sweep rate", "swept sine", "test plan", "shaker limits"),
    "howto/measured_base": ("accelerometer", "shaker record", "sine sweep"),
    "howto/test_plan": (
        "sine sweep", "swept sine", "dwell", "bump test", "random vibration test", "test plan", "crossover", "notching",
        "g^2/Hz", "shock test", "half-sine", "units in study files",
    ),
    "howto/spectra": (
        "PSD", "FRF", "SRS", "frequency response function", "spectral density", "coherence", "transmissibility",
    ),
    "howto/calibration": ("parameter estimation", "model updating", "inverse problem", "posterior", "fit a gap"),
    "howto/root_stress": ("fatigue", "strain gauge", "rainflow"),
}  # fmt: skip
"""What a reader may search for, by the page that answers it: the search finds it though the page has other words."""


ON_SITE = {
    "reference/bibliography": "{bibliography}\n:all:",
    "reference/index": "{toctree}\n:hidden:\n\nPython names <../api/index>",
    "development/contributing": (
        "{include} ../../CONTRIBUTING.md\n:start-after: '# Working on femimpact'\n:relative-docs: docs"
    ),
}
"""What the site has at the end of a page; where the repository is hosted the page is plain Markdown without it."""

PARENTS = ("howto/index", "theory/index", "reference/index", "paper/index", "development/contributing")
"""Pages below which the site has the others of their folder, in the order of their links."""


def site_page(_app: Any, name: str, content: list[str]) -> None:
    """Turn a page, which is plain Markdown, into that of the site: citations, links to names, the order of pages.

    The gallery stands by subject, and a page of `KEYWORDS` has them in the index of the search.
    """
    text = content[0]
    if name == "gallery/index":
        text = gallery_with_headings(text)
    text = re.sub(r"\[[^]]*\]\([./]*references\.bib#(\w+)\)", r"{cite:t}`\1`", text)
    for public in set(re.findall(r"(?<!\[)`fi\.([\w.]+)`", text)) & set(public_modules()):
        text = text.replace(f"`fi.{public}`", f"{{py:obj}}`fi.{public} <femimpact.{public}>`")
    if name in PARENTS:
        text += pages_below(name, text)
    if name in ON_SITE:
        text += f"\n```{ON_SITE[name]}\n```\n"
    if words := KEYWORDS.get(name):
        title, rest = text.split("\n", 1)
        text = f"{title}\n\n```{{index}} {', '.join(f'! {word}' for word in words)}\n```\n{rest}"
    content[0] = text


def pages_below(name: str, text: str) -> str:
    """Hidden tables of contents: the pages that each part of a page is the first to link, then those that none does."""
    folder = name.partition("/")[0]
    rest = sorted(page.stem for page in (HERE / folder).glob("*.md") if f"{folder}/{page.stem}" != name)
    if folder == "development":
        rest.remove("changelog")  # the first page has it
    tables = []
    for part in [*text.split("\n## "), "More\n" + "".join(f"]({page}.md)" for page in rest)]:
        linked = [page for page in dict.fromkeys(re.findall(r"\]\((\w+)\.md[)#]", part)) if page in rest]
        rest = [page for page in rest if page not in linked]
        if linked:
            caption = "" if part.startswith("# ") else f":caption: {part.splitlines()[0]}\n"
            tables.append(f"\n```{{toctree}}\n:hidden:\n{caption}\n" + "\n".join(linked) + "\n```\n")
    return "".join(tables)


# ---- the gallery ----------------------------------------------------------------------------------


def script_path(_gallery: Any, script: str) -> None:
    """Give the next example its `__file__`, which the gallery leaves out: some have a file beside them."""
    vars(builtins)["__file__"] = str(HERE.parent / "examples" / Path(script).name)


EXAMPLES = {
    "Ball dampers": (
        "damped_resonance", "best_ball_mass", "design_map", "clearance_restitution_map", "gap_and_tolerance",
        "two_balls", "absorber_or_ball", "two_starts",
    ),
    "Energy and stress": ("energy_ledger", "root_stress"),
    "Contact laws": (
        "calibrate_restitution", "restitution_of_laws", "two_laws", "own_contact_law", "switching_spring",
    ),
    "Kinds of motion": ("sticking_ball", "bifurcation", "up_and_down_sweep", "preloaded_stop"),
    "Motions of a shaker": (
        "base_from_csv", "chirps_at_walls", "half_sine_shock", "random_vibration", "base_and_hammer",
        "transmissibility",
    ),
    "Beams and modes": ("tapered_blade", "spring_between_places"),
    "Measured curves": ("damping_from_a_curve", "ring_down", "restitution_of_a_test", "laser_at_midspan"),
    "Accuracy": ("mesh_convergence", "step_size"),
}  # fmt: skip
"""Headings of the gallery, and the examples below each in their order."""


PANELS = {"best_ball_mass": 1, "preloaded_stop": 1}
"""Which panel of an example's picture its thumbnail shows, where that is not the first."""

MOVIE = "damped_resonance"
"""The example whose thumbnail moves."""

THUMBNAIL = (400, 280)
"""Size of a thumbnail in pixels."""


def scrape(block: Any, block_vars: Any, gallery_conf: Any) -> str:
    """Keep the pictures of an example, and one panel of the first without words, for its thumbnail."""
    from matplotlib import pyplot
    from sphinx_gallery.scrapers import matplotlib_scraper

    figures = [pyplot.figure(number) for number in pyplot.get_fignums()]
    listed = matplotlib_scraper(block, block_vars, gallery_conf)
    if figures:
        name = Path(block_vars["src_file"]).stem
        _draw_large(figures[0], PANELS.get(name, 0), HERE / "gallery" / "images" / f"large_{name}.png")
    return str(listed)


def _draw_large(figure: Any, number: int, path: Path) -> None:
    from matplotlib.legend import Legend

    shown = figure.axes[number]
    figure.set_layout_engine("none")
    for axes in figure.axes:
        if axes is not shown:
            axes.remove()
    for words in (*shown.texts, *figure.texts, *figure.findobj(Legend)):
        words.remove()
    shown.set(xlabel="", ylabel="", position=(0.02, 0.03, 0.96, 0.94))
    for place in ("left", "center", "right"):
        shown.set_title("", loc=place)
    shown.tick_params(which="both", length=0, labelleft=False, labelbottom=False)
    for line in shown.lines:
        line.set(linewidth=2.5 * line.get_linewidth(), markersize=1.5 * line.get_markersize())
    figure.set_size_inches(THUMBNAIL[0] / 100, THUMBNAIL[1] / 100)
    figure.savefig(path, dpi=100)


def draw_thumbnails(app: Any) -> None:
    """Put the pictures of `scrape` and the movie in the place of the thumbnails, which show whole figures in small."""
    images = HERE / "gallery" / "images"
    for path in images.glob("large_*.png"):
        path.replace(images / "thumb" / f"sphx_glr_{path.stem.removeprefix('large_')}_thumb.png")
    moving = images / "thumb" / f"sphx_glr_{MOVIE}_thumb.png"
    if app.config.sphinx_gallery_conf["plot_gallery"] and moving.exists():
        frames = list(_frames())
        frames[0].save(moving, save_all=True, append_images=frames[1:], duration=40, loop=0)


def _frames() -> Iterator[Any]:
    """Beam, box and ball over three cycles of the base, every frame a picture."""
    import numpy as np
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    from femimpact.app.demo import paper_study

    structure = paper_study().structure
    length, gap = structure.beam.length, 4e-3
    places = np.linspace(0.0, length, 13)[1:]
    names = tuple(f"{place:.6g}" for place in places[:-1])
    record = fi.Recorder(channels=(*names, "tip", "ball"))
    system = fi.reduce(fi.assemble(structure, elements=24), modes=4)
    run = fi.integrate(system, fi.Sine(0.2e-3, 5.2), fi.EventDriven(samples_per_cycle=20), 15.0, record)
    high = 1e3 * gap + 1.0
    largest = 1e3 * np.abs(run["tip"][-60:]).max() + high + 0.5
    for i in range(run.time.size - 60, run.time.size):
        figure = Figure(figsize=(THUMBNAIL[0] / 100, THUMBNAIL[1] / 100), dpi=100)
        canvas = FigureCanvasAgg(figure)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(-0.06, 1.2), ylim=(-largest, largest))
        axes.axis("off")
        tip = 1e3 * run["tip"][i]
        axes.plot([0.0, *places / length], [0.0, *(1e3 * run[name][i] for name in (*names, "tip"))], "0.3", linewidth=5)
        axes.plot([0.0, 0.0], [-0.4 * largest, 0.4 * largest], "0.1", linewidth=8)
        axes.fill(
            [1.0, 1.1, 1.1, 1.0], [tip - high, tip - high, tip + high, tip + high], fill=False, ec="C0", linewidth=4
        )
        axes.plot(1.05, 1e3 * run["ball"][i], "o", color="C1", markersize=24)
        canvas.draw()
        yield Image.fromarray(np.asarray(canvas.buffer_rgba())[:, :, :3].copy()).quantize(64)


class BySubject:
    """Order of the examples: that of `EXAMPLES`."""

    def __init__(self, _folder: str) -> None:
        self._order = [name for names in EXAMPLES.values() for name in names]

    def __call__(self, file: str) -> int:
        """What examples are sorted by."""
        return self._order.index(Path(file).stem)


def gallery_with_headings(page: str) -> str:
    """The gallery's page, whose examples stand in one list, with a list below each heading of `EXAMPLES`."""
    begin, end = '<div class="sphx-glr-thumbnails">', ".. thumbnail-parent-div-close"
    opening = f".. raw:: html\n\n    {begin}\n\n"
    closing = ".. raw:: html\n\n    </div>\n\n"
    head, rest = page.split(opening)
    listed, tail = rest.split(end)
    one = r"\.\. raw:: html\n\n +<div class=\"sphx-glr-thumbcontainer\".*?:doc:`/gallery/(\w+)`.*?</div>\n +</div>\n"
    thumbnails = {found[1]: found[0] for found in re.finditer(one, listed, flags=re.DOTALL)}
    for heading, names in EXAMPLES.items():
        below = "\n".join(thumbnails[name] for name in names)
        head += f"{heading}\n{'-' * len(heading)}\n\n{opening}{below}\n{closing}\n"
    return head + tail.split(closing.rstrip("\n"), 1)[1]
