"""The list of pictures: what is drawn of which record, under which title, with which words. Page and folder are it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from femimpact import figures
from femimpact.app.parametric.measured_peaks import Calibration
from femimpact.app.report.markup import Element, element, picture_element
from femimpact.app.report.page import Section
from femimpact.app.results.branch_file import FollowedBranches
from femimpact.app.results.picture_data import RANGES, Run, StartRanges, StructureModes, SweptCurves
from femimpact.app.results.result_directory import FIGURES, FILES, new_file
from femimpact.app.study.findings import START_WORDS
from femimpact.contact.laws import Rigid
from femimpact.convergence.table import ConvergenceTable
from femimpact.errors import InputError, warnings_left_to_caller
from femimpact.excitation.chirp import Chirp
from femimpact.excitation.drives import Drives, HammerBlow, Rest
from femimpact.excitation.harmonic import SteppedSine
from femimpact.excitation.random_base import RandomBase
from femimpact.excitation.records import RecordedBase
from femimpact.excitation.shock import Shock
from femimpact.figures.drawing import figure_of, panels
from femimpact.figures.histories import MOST_LINES, drawn_channels, one_channel
from femimpact.figures.studies import mark_best
from femimpact.figures.study_labels import BestMarks, axis_words, measure_names
from femimpact.orbits.branch import Branch
from femimpact.orbits.orbit import PeriodicOrbit
from femimpact.response.response import Response
from femimpact.signals.decay import DecayEstimate, identify_decay
from femimpact.signals.densities import Spectrum, drive_history, remarks, spectrum
from femimpact.signals.estimates import measured_transfer
from femimpact.signals.shock_response import FOLLOWED, ShockResponseSpectrum, shock_response_spectrum
from femimpact.signals.transfer import TransferFunction
from femimpact.units import counted

if TYPE_CHECKING:
    import xarray

OFF_SCREEN = figures.OffScreen()

SHOCK_RATIO = 0.05
"""Damping ratio of the shock response spectrum of a drive."""


# ---- records ---------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Measure:
    """A measure of a parameter study over its axes, or a variable of any dataset."""

    dataset: xarray.Dataset
    name: str
    stem: str  # of its file
    marks: BestMarks | None = None  # of the worst case over what is chosen

    @property
    def title(self) -> str:
        """The measure in words."""
        if self.name not in self.dataset or "long_name" not in self.dataset[self.name].attrs:
            return self.name.replace("_", " ")
        return axis_words(self.dataset, self.name)


def measures_of(dataset: xarray.Dataset) -> list[Measure]:
    """Every measure of a dataset that has two values or more to draw."""
    # the name of a channel may hold what no file name should
    stems = {
        name: "study_" + "".join(letter if letter.isalnum() or letter in "_-" else "_" for letter in name)
        for name in measure_names(dataset)
    }
    return [Measure(dataset, name, stem) for name, stem in stems.items() if dataset[name].ndim]


def spectra_of(
    run: Response, told: Callable[[str], str] = str
) -> tuple[list[DecayEstimate | Spectrum | TransferFunction | ShockResponseSpectrum], list[str]]:
    """What a run is read by where its drive has it, and a line for each channel that cannot be.

    The damping of a free decay, densities of a random drive, transfer functions of a chirp, a stepped sine or a blow,
    the response spectrum of a shock; `told` puts a fault into the words of who gave the run.
    """
    if isinstance(run.base, Drives):
        words = "No transfer function: several drives act at once, and a run under each of them alone has its own."
        return [], [words]
    if isinstance(run.base, Shock):
        f = np.geomspace(0.05 / run.base.duration, 50.0 / run.base.duration, 60)
        return [shock_response_spectrum(run.base, f, SHOCK_RATIO)], []
    if isinstance(run.base, RecordedBase):
        # from a period of the whole record to where straight lines between its samples are still the motion
        if run.base.samples.size * FOLLOWED <= 1.0:
            return [], [f"No response spectrum: the record has only {run.base.samples.size} samples."]
        f = np.geomspace(1.0 / (run.base.samples.size * run.base.interval), FOLLOWED / run.base.interval, 60)
        return [shock_response_spectrum(run.base, f, SHOCK_RATIO)], []
    history, refused = drive_history(run), list[str]()
    found = list[DecayEstimate | Spectrum | TransferFunction | ShockResponseSpectrum]()
    for name in [name for name, unit in run.units.items() if unit != "N"][:MOST_LINES]:
        try:
            if isinstance(history, RandomBase):
                found.append(spectrum(run, name))
            elif isinstance(history, Chirp | SteppedSine | HammerBlow):
                found.append(measured_transfer(run, name))
            elif isinstance(history, Rest) and not found:
                with warnings_left_to_caller():
                    found.append(identify_decay(run.time, run[name]))
        except InputError as error:
            what = "damping" if isinstance(history, Rest) else "spectrum"
            refused.append(f"No {what} of {name}: {told(str(error))}.")
    return found, refused


# ---- the list --------------------------------------------------------------------------------------


SECTIONS = {
    "best": "The best case", "response": "Response over frequency", "comparison": "Beside the paper",
    "orbits": "Periodic orbits", "player": "The motion", "drive": "The drive", "motion": "Histories",
    "spectra": "Spectra", "impacts": "Impacts", "box": "Does the ball fit", "energy": "Energy", "modes": "Modes",
    "recommended": "Recommended numbers", "convergence": "Convergence", "decay": "Decay",
    "study": "The measures over the axes", "cases": "Cases",
}  # fmt: skip
"""Parts of a page, in their order, and their headings."""

MOST_PICTURES = 36
"""Pictures of one part of a page."""


@dataclass(frozen=True)
class View:
    """A picture of records of one kind; fields of a record stand as {0.field} in texts."""

    section: str  # key in `SECTIONS` of the part of a page in which it stands
    kind: type  # of the records
    key: str  # stem of the file, of `FIGURES` but for measures, and beginning of identifiers on a page
    figure: Callable[[Any], Any]  # axes of a figure that no window shows, of a record
    when: Callable[[Any], bool] = lambda _: True  # whether a record has data for it
    words: Callable[[Any], str] = lambda _: ""
    file: str = ""  # key in `FILES` of the numbers that it is drawn from
    title: str = ""  # where it is not that of `FIGURES`


def _has_impacts(run: Run) -> bool:
    return len(run.whole.impacts) > 0


def _remarks(found: Any) -> str:
    return "; ".join(text for text in remarks(found).values() if text)


def _of_measure(one: Measure) -> Any:
    axes = figures.study(one.dataset, one.name, figure=OFF_SCREEN)
    return axes if one.marks is None else mark_best(axes, one.dataset, one.name, one.marks)


def _of_ranges(ranges: StartRanges) -> Any:
    """A row for each measure, and a column for each frame."""
    _, *measures = RANGES[ranges.key]
    size = (5.5 * len(ranges.frames), 4.2 * len(measures), len(measures), len(ranges.frames))
    axes = panels(OFF_SCREEN, *size, sharex=True, sharey="row")
    for row, measure in zip(axes, measures, strict=True):
        for axis, (start, data) in zip(row, ranges.frames.items(), strict=True):
            figures.study(data, measure, title=START_WORDS[start], ax=axis)
    return axes


VIEWS = (
    View(
        "comparison", StartRanges, "{0.key}", _of_ranges, when=lambda ranges: len(ranges.frames) > 1, file="{0.key}",
    ),
    View(
        "response", SweptCurves, "response", file="sweep",
        figure=lambda swept: figures.response_curve(
            swept.curves, coarse=swept.coarse, bands=swept.bands, ax=OFF_SCREEN
        ),
    ),
    View(
        "response", SweptCurves, "response_columns", file="sweep",
        figure=lambda swept: figures.response_columns(swept.curves, OFF_SCREEN),
    ),
    View(
        "orbits", FollowedBranches, "branches", file="branch_table",
        figure=lambda followed: figures.branch(
            followed.branches, OFF_SCREEN, title=f"{counted(followed.modes, 'mode')} kept", swept=followed.swept
        ),
    ),
    View("orbits", Branch, "branch", lambda one: figures.branch(one, OFF_SCREEN), title="Largest displacement"),
    View("orbits", PeriodicOrbit, "orbit", lambda one: figures.orbit(one, figure=OFF_SCREEN), title="One period"),
    View(
        "drive", Run, "drive", lambda run: figures.drive(run.whole.base, float(run.whole.time[-1]), OFF_SCREEN),
        when=lambda run: not isinstance(run.whole.base, Rest),
    ),
    View(
        "motion", Run, "history", lambda run: figures.channels(run.whole, run.end, OFF_SCREEN),
        when=lambda run: bool(drawn_channels(run.whole)), file="history",
    ),
    View(
        "spectra", Spectrum, "spectrum", title="Spectral density of {0.channel}", words=_remarks, file="history",
        figure=lambda found: figures.spectrum(found, highest=None, ax=OFF_SCREEN),
    ),
    View(
        "spectra", TransferFunction, "spectrum", title="Transfer function over {0.of}", words=_remarks, file="history",
        figure=lambda found: figures.transfer_function(found, figure=OFF_SCREEN),
    ),
    View(
        "spectra", ShockResponseSpectrum, "spectrum", title="Shock response spectrum of the base", words=_remarks,
        figure=lambda found: figures.shock_response_spectrum(found, ax=OFF_SCREEN),
    ),
    View(
        "impacts", Run, "impact_histograms", lambda run: figures.impact_histograms(run.whole, OFF_SCREEN),
        when=_has_impacts, file="impacts",
    ),
    View(
        "impacts", Run, "impulse_phase", lambda run: figures.impulse_phase(run.whole, OFF_SCREEN),
        when=_has_impacts, file="impacts",
    ),
    View(
        "impacts", Run, "contact_force", file="history",
        figure=lambda run: figures.contact_force(run.end, averaged=False, figure=OFF_SCREEN),
        # a rigid impact has an impulse and no force to draw
        when=lambda run: run.end is not None and bool(set(run.end.impacts.law.values()) - {Rigid.name}),
    ),
    View(
        "motion", Run, "phase_portrait", file="history",
        figure=lambda run: figures.phase_portrait(run.end, phase=None, ax=OFF_SCREEN),
        when=lambda run: run.end is not None and bool(run.end.system.contacts),
    ),
    View(
        "energy", Run, "energy", lambda run: figures.energies(run.whole, OFF_SCREEN),
        when=lambda run: run.whole.energy is not None, file="history",
    ),
    View(
        "modes", StructureModes, "modes", file="mode_shapes",
        figure=lambda found: figures.mode_shapes(
            found.system, found.modes, structure=found.structure, figure=OFF_SCREEN
        ),
        when=lambda found: np.size(found.system.nodes) > 1,
    ),
    View(
        "convergence", ConvergenceTable, "{0.kind}_over_{0.axis}", file="{0.kind}_over_{0.axis}",
        figure=lambda table: figures.convergence_panels(table, OFF_SCREEN),
    ),
    View(
        "best", Measure, "study_best", _of_measure, when=lambda one: one.marks is not None, file="parameter_table",
        title="{0.title}",
    ),
    View(
        "study", Measure, "{0.stem}", _of_measure, when=lambda one: one.marks is None, file="parameter_table",
        title="{0.title}",
    ),
    View(
        "study", Calibration, "calibration", lambda one: figures.calibration(one, figure=OFF_SCREEN),
        title="Posterior of the parameters, and the peaks at its medians",
    ),
    View(
        "decay", DecayEstimate, "decay", lambda estimate: figures.decay(estimate, OFF_SCREEN),
        when=lambda estimate: len(estimate) > 0, title="Damping ratio over the amplitude",
    ),
)  # fmt: skip
"""Every picture, in the order in which it stands on a page and is drawn into a folder."""


@dataclass(frozen=True, eq=False)
class Picture:
    """A view of a record."""

    view: View
    record: Any
    number: int  # of its view, from 1

    @property
    def stem(self) -> str:
        """Stem of the files of its view."""
        return self.view.key.format(self.record)

    @property
    def name(self) -> str:
        """Stem of its file."""
        return self.stem if self.number == 1 else f"{self.stem}_{self.number}"

    @property
    def title(self) -> str:
        """What it shows, in words."""
        return (self.view.title or FIGURES[self.stem]).format(self.record)

    def axes(self) -> Any:
        """Axes of its figure, which no window shows."""
        return self.view.figure(self.record)

    def element(self, axes: Any, prefix: str = "", folder: bool = True) -> Element:
        """Its figure on a page, with the file that it is drawn from where that is beside the page."""
        view = self.view
        file = f"Drawn from {FILES[view.file.format(self.record)].name}." if folder and view.file else ""
        return picture_element(axes, f"{prefix}{self.name}", self.title, (view.words(self.record), file))


def pictures_of(records: Iterable[Any]) -> list[Picture]:
    """The pictures that records have data for, in the order of the list."""
    found, count = list[Picture](), Counter[str]()
    kept = list(records)
    for view in VIEWS:
        for record in kept:
            if isinstance(record, view.kind) and view.when(record):
                key = view.key.format(record)
                count[key] += 1
                found.append(Picture(view, record, count[key]))
    return found


NOT_DRAWN: Mapping[str, Element] = {}


def sections_of(
    records: Iterable[Any],
    beside: Mapping[str, Sequence[Element]],  # words and tables by the key of their section
    prefix: str = "",  # of identifiers
    miss: Callable[[str], object] | None = None,  # told of what cannot be drawn of the files beside the page
    drawn: Mapping[str, Element] = NOT_DRAWN,  # pictures that `save_pictures` has drawn
) -> list[Section]:
    """Parts of a page with the pictures of records, words above them and tables below."""
    pictures: dict[str, list[Picture]] = {}
    for one in pictures_of(records):
        pictures.setdefault(one.view.section, []).append(one)
    found = list[Section]()
    for key, heading in SECTIONS.items():
        mine, others = pictures.get(key, []), list(beside.get(key, ()))
        elements = [drawn.get(one.name) or _element_of(one, prefix, miss) for one in mine[:MOST_PICTURES]]
        if len(mine) > MOST_PICTURES:
            left = f"{len(mine) - MOST_PICTURES} further pictures are left out: the file of the study has all values."
            elements.append(element("p.below", left))
        words = [one for one in others if one.tag == "p"]
        rest = [one for one in others if one.tag != "p"]
        if mine or others:
            held = [element("div", *some) for some in (elements, rest) if some]
            found.append(Section(f"{prefix}{key}", heading, (*words, *held)))
    return found


def _element_of(one: Picture, prefix: str, miss: Callable[[str], object] | None) -> Element:
    """A picture, or why there is none."""
    try:
        return one.element(one.axes(), prefix, miss is not None)
    # what a library for pictures raises is without limit, and the rest of the page does not depend on it
    except Exception as error:
        if miss is not None and not isinstance(error, InputError):
            miss(f"{one.name}: {reason_of(error)}")
        return element("p", f"{one.title}: not drawn, for {reason_of(error)}")


def one_panel(run: Run) -> Mapping[str, Element]:
    """The first displacement over the whole run, as the only picture of a history; {} without one."""
    # the tip is the first that a run keeps; of a structure without one its first place
    place = next((name for name, unit in run.whole.units.items() if unit == "m"), "")
    if place not in run.whole.channels:
        return NOT_DRAWN
    axes = one_channel(run.whole, place, OFF_SCREEN)
    return {"history": picture_element(axes, "history", f"Displacement of {place} over time")}


def save_pictures(records: Iterable[Any], folder: Path) -> tuple[dict[str, Element], list[str]]:
    """Draw records into a folder, as PNG: the same on its page, by their names, and why others were not drawn."""
    elements, failures = dict[str, Element](), list[str]()
    for one in pictures_of(records):
        path = new_file(folder, f"figures/{one.name}.png")
        try:
            axes = one.axes()
            elements[one.name] = one.element(axes)
            # drawn once more, it would be placed anew
            figure_of(axes).set_layout_engine("none")
            figures.save_figure(axes, path)
        except Exception as error:
            failures.append(f"{path.name}: {reason_of(error)}")
    return elements, failures


def reason_of(error: Exception) -> str:
    """Why something was not drawn, in words."""
    if isinstance(error, OSError) and error.strerror:
        name = Path(str(error.filename)).name if error.filename else ""
        return f"{name}: {error.strerror}" if name else error.strerror
    return f"{' '.join(str(error).split()) or 'no words'} ({type(error).__name__})"[:400]
