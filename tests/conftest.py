"""The reference structure behind the published 5.30 and 4.98 Hz, modes with another last bit, and processes of tests.

Files of tests are run side by side, where there are more than a few, by one process for each core (pytest-xdist);
`pytest -n 0` runs them one after the other.

`pytest --perturb-modes SEED` runs the tests marked `impacts` on modes that differ in their last bits, as they do
between processors: the linear-algebra kernel decides those bits, and impacts amplify them.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import command
import numpy as np
import pytest
from builders import REFERENCE, SMALL_STUDY, reduced, with_ball

import femimpact as fi
import femimpact.system.modes
from femimpact.integrators import cases

LAST_BITS = 1e-15
"""Relative: a few units in the last place, as far as another linear-algebra kernel moves a mode."""


FEW_FILES = 3
"""Files that one process runs sooner than several, each of which takes some seconds to begin."""

MOST_PROCESSES = 8
"""Each takes some 500 MB."""

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables by which linear algebra is told its number of cases, before it is loaded."""


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config):
    """Ask pytest-xdist for files side by side, unless the command line says how many processes there shall be."""
    # its processes come here too, and must not begin further ones
    if "PYTEST_XDIST_WORKER" in os.environ or hasattr(config, "workerinput"):
        return
    option = config.option
    if getattr(option, "numprocesses", 0) is None and option.dist == "no":
        option.numprocesses = processes_for(config.args, config.invocation_params.dir, interactive(option))
        option.dist = "loadfile"


def interactive(option) -> bool:
    """Whether somebody looks on while a test runs: by a debugger, or at what is printed."""
    return option.usepdb or option.trace or option.capture == "no"


def processes_for(args, folder, alone: bool) -> int:
    """Processes of tests for the arguments of a command line: none beside its own for a few files."""
    named = {word.partition("::")[0] for word in args}
    few = len(named) <= FEW_FILES and all(Path(folder, name).is_file() for name in named)
    return 0 if few or alone else min(cases.cores(), MOST_PROCESSES)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_setupnodes(config, specs):
    """Share the cores between processes that begin: what a user has set stays."""
    for name in THREADS:
        os.environ.setdefault(name, str(share_of_cores(len(specs))))


def share_of_cores(processes: int) -> int:
    """Threads of each of so many processes."""
    return max(cases.cores() // processes, 1)


def pytest_addoption(parser):
    words = "run the tests marked impacts, on modes whose last bits are changed by this seed"
    parser.addoption("--perturb-modes", type=int, metavar="SEED", help=words)


def pytest_configure(config):
    config.addinivalue_line("markers", "impacts: runs impacts, whose motion may be chaotic")


def pytest_ignore_collect(collection_path, config):
    """Files without a marked test are not imported where only such tests are run."""
    if config.getoption("--perturb-modes") is None or collection_path.suffix != ".py":
        return None
    return True if "mark.impacts" not in collection_path.read_text(encoding="utf-8") else None


def pytest_collection_modifyitems(config, items):
    if config.getoption("--perturb-modes") is None:
        return
    marked = [item for item in items if item.get_closest_marker("impacts")]
    config.hook.pytest_deselected(items=[item for item in items if item.get_closest_marker("impacts") is None])
    items[:] = marked


def perturbed(modes: fi.system.Modes, system: fi.System, seed: int) -> fi.system.Modes:
    """The modes times 1 + 1e-15 r, r within 1 by seed and index: the same input gives the same output.

    `reduce` builds its diagonal matrices from these frequencies and ratios, so that they stay diagonal.
    """
    count = modes.natural_frequency.size
    # a column of random numbers of its own seed for each mode: its frequency, its ratio, its vector
    draws = [np.random.default_rng([seed, mode]).uniform(-1.0, 1.0, 2 + system.dofs) for mode in range(count)]
    factors = 1.0 + LAST_BITS * np.column_stack(draws)
    vectors = modes.vectors * factors[2:]
    participation = vectors.T @ system.base_load
    changed = replace(
        modes,
        natural_frequency=modes.natural_frequency * factors[0],
        damping_ratio=modes.damping_ratio * factors[1],
        participation_factor=participation,
        vectors=vectors,
    )
    for values in vars(changed).values():
        values.setflags(write=False)
    return changed


@pytest.fixture(scope="session", autouse=True)
def _perturbed_modes(request):
    """`lowest_modes`, below `solve_modes` and `reduce`, gives perturbed modes where --perturb-modes asks for them."""
    seed = request.config.getoption("--perturb-modes")
    if seed is None:
        yield
        return
    exact = femimpact.system.modes.lowest_modes

    def lowest_modes(system, count):
        return perturbed(exact(system, count), system, seed)

    with pytest.MonkeyPatch.context() as patch:
        # a module that is imported later takes it from femimpact.system.modes
        for name, module in list(sys.modules.items()):
            if name.partition(".")[0] == "femimpact" and vars(module).get("lowest_modes") is exact:
                patch.setattr(module, "lowest_modes", lowest_modes)
        yield


@pytest.fixture(scope="session", autouse=True)
def _shared_cores():
    """Beside other processes of tests, sweeps take this one's share of the cores where they are not told a number."""
    processes = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    share = share_of_cores(processes)
    with pytest.MonkeyPatch.context() as patch:
        if processes > 1:
            patch.setattr(cases, "cores", lambda: share)
        yield


@pytest.fixture(scope="session")
def reference() -> fi.Structure:
    return REFERENCE


@pytest.fixture(scope="session")
def system(reference: fi.Structure) -> fi.System:
    return fi.assemble(reference, elements=40)


@pytest.fixture(scope="session")
def small(system: fi.System) -> fi.System:
    return fi.reduce(system, modes=8)


@pytest.fixture(scope="session")
def bouncing(reference: fi.Structure) -> fi.System:
    """A light ball that loses little: thrown between walls at rest it bounces regularly, and meets no chaos."""
    law = fi.KelvinVoigt(restitution=0.9, contact_time=2e-3)
    return reduced(with_ball(reference, mass=1e-5, contact=law), 4, 10)


@pytest.fixture
def undrawn(monkeypatch) -> None:
    """Nothing draws the pictures of a run, whose data are written; for tests that look at no picture."""

    def draw_kinds(_folder, kinds, _report, _study):
        return dict.fromkeys(kinds), {}

    monkeypatch.setattr("femimpact.app.tasks.task.draw_kinds", draw_kinds)


@pytest.fixture
def empty_pictures(monkeypatch) -> None:
    """Figures of a page are drawn, and stand on it as empty pictures; for tests that look at what is around them."""
    empty = '<svg xmlns="http://www.w3.org/2000/svg" width="100pt" height="60pt" viewBox="0 0 100 60"/>'
    monkeypatch.setattr("femimpact.app.report.markup.svg_text", lambda _drawn: empty)


@pytest.fixture(scope="session")
def finished(tmp_path_factory) -> Iterator[Path]:
    """A directory with `study.toml` and what a run of it left in `out`; a test that changes it takes a copy.

    It is made once, also for several processes of tests: whoever comes first puts it where all look.
    """
    own = tmp_path_factory.mktemp("finished")
    shared = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared = shared.parent
    place = shared / "finished-run"
    if not place.exists():
        (own / "study.toml").write_text(SMALL_STUDY, encoding="utf-8")
        command.femimpact("run", "study.toml", "-o", "out", cwd=own)
        with suppress(OSError):
            # another process was first: a folder that is not empty is not replaced
            own.rename(place)
    before = _seen(place)
    yield place
    assert _seen(place) == before, "a test has changed the finished run, which all share"


def _seen(folder: Path) -> dict[str, tuple[int, int]]:
    """Size and time of every file in a folder."""
    found = {path: path.stat() for path in folder.rglob("*")}
    return {str(path): (about.st_size, about.st_mtime_ns) for path, about in found.items()}
