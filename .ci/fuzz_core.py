"""Fuzz of the compiled core's entries: wrong types, shapes, strides, dead arrays. An exception is right, a crash never.

`python .ci/fuzz_core.py --seconds 600` calls the entries in child processes with random arguments; it ends with status
1 where a child crashes, and prints the command that repeats it. A build with checks or sanitizers finds more.

A new entry is one more function in `ENTRIES`, that gives the arguments of a sound call: arrays, numbers, and tuples of
them, new ones for each call where they are written to.
"""

from __future__ import annotations

import argparse
import contextlib
import copy
import ctypes
import faulthandler
import functools
import random
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any
from unittest import mock

import numpy as np

import femimpact as fi
from femimpact import core

CALLS = 20_000
"""Most calls of one child process."""

MOST_RECORDED = 20
"""Calls of an entry that are kept as sound ones."""

CHILD_SECONDS = 30.0
"""Longest time of one child process, s; one call that takes ten times as long has hung."""


# ---- sound calls ----------------------------------------------------------------------------------


def exponentials(random: random.Random) -> dict[str, Any]:
    """Arguments of `core.exponentials`."""
    count = random.choice([0, 1, 2, 3, 4, 5, 8, 21])
    draw = np.random.default_rng(random.randrange(2**32))
    size = 10.0 ** random.uniform(-3.0, 308.0)
    exponent = (-draw.random(count) + 1j * draw.normal(size=count)) * size
    return {
        "exponent": exponent,
        "time": random.choice([0.0, 1.0, 1e-300, 1e300]),
        "out": np.empty(count, complex),
    }


def choose_target(random: random.Random) -> dict[str, Any]:
    """Arguments of `core.choose_target`."""
    return {
        "level": random.choice([2, 3, 4]),
        "asked": random.choice(["", core.build_info()["targets"][0]]),
    }


def numbers(count: int) -> Callable[[random.Random], dict[str, Any]]:
    """Arguments of an entry that takes so many numbers."""
    return lambda random: {str(k): random.choice([0.0, 1.0, -1.5, 1e-300, 1e300]) for k in range(count)}


def systems_with_ball() -> list[fi.System]:
    """A beam whose ball has contacts of some duration, and rigid ones; on its modes, and in its own dofs."""
    beam = fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    systems = []
    for contact in (fi.KelvinVoigt(restitution=0.6, contact_time=2e-3), fi.Rigid(restitution=0.6)):
        ball = fi.Impactor("ball", at="tip", mass=3.4e-3, gap=1e-3, contact=contact)
        whole = fi.assemble(fi.Structure(beam, [], [ball], fi.Rayleigh(ratio=0.0029, modes=(1, 2))), elements=8)
        systems += [fi.reduce(whole, modes=3), whole]
    return systems


BASE = fi.Sine(amplitude=0.2e-3, frequency=10.0)


def runs_with_impacts() -> None:
    """Event-driven runs through an impact of some duration and through rigid ones."""
    for system in systems_with_ball()[::2]:
        fi.integrate(system, BASE, fi.EventDriven(), duration=0.5, record=fi.Recorder(events=4))


def runs_with_steps() -> None:
    """Runs and sweeps by methods with steps: one case and a pack, dense and banded, with fine steps and without."""
    soft, soft_dofs, rigid, rigid_dofs = systems_with_ball()
    record = fi.Recorder(("tip", "ball"), snapshots=5, every=3)
    recorded = fi.RecordedBase(np.linspace(-1.0, 1.0, 9), 0.05)
    for excitation in (BASE, recorded):
        for system, method in (
            (soft, fi.Newmark(1e-4, refine=3)), (soft_dofs, fi.HHT(1e-4)), (rigid, fi.MoreauJean(1e-4)),
            (rigid_dofs, fi.MoreauJean(1e-4)),
        ):  # fmt: skip
            fi.integrate(system, excitation, method, 0.05, record)
    for system, method in ((soft, fi.Newmark(1e-4)), (soft_dofs, fi.Newmark(1e-4, refine=2))):
        fi.frequency_sweep(system, 1e-4, [9.0, 10.0, 11.0], method, cycles=3, threads=1)


def collisions() -> None:
    """Collisions alone, by several methods."""
    soft, _, rigid, _ = systems_with_ball()
    for method in (fi.Newmark(1e-4), fi.HHT(1e-4), fi.Newmark(1e-4, contact="energy-consistent")):
        fi.integrators.achieved_restitution(soft.contacts[0], method, 0.3)
    fi.integrators.achieved_restitution(rigid.contacts[0], fi.MoreauJean(1e-4), 0.3)


def searches() -> None:
    """The tests of the search for events, which alone call it from Python."""
    import pytest

    pytest.main(
        [
            "-q",
            "-x",
            "--no-header",
            "--tb=no",
            "-p",
            "no:cacheprovider",
            "tests/test_search.py",
        ]
    )


class _EnoughError(Exception):
    """Ends what is recorded."""


@functools.cache
def _calls_of(name: str, run: Callable[[], None]) -> list[tuple[Any, ...]]:
    """Arguments that an entry is handed while something runs, of some calls."""
    calls: list[tuple[Any, ...]] = []
    entry = getattr(core, name)

    def recorded(*arguments: Any) -> Any:
        if len(calls) == MOST_RECORDED:
            raise _EnoughError
        calls.append(copy.deepcopy(arguments))
        return entry(*arguments)

    with mock.patch.object(core, name, recorded), contextlib.suppress(_EnoughError):
        run()
    return calls


def recorded(name: str, run: Callable[[], None]) -> Callable[[random.Random], dict[str, Any]]:
    """Arguments of an entry, as they were handed while something ran."""
    return lambda random: {str(k): each for k, each in enumerate(copy.deepcopy(random.choice(_calls_of(name, run))))}


ENTRIES: dict[str, Callable[[random.Random], dict[str, Any]]] = {
    "advance": recorded("advance", runs_with_steps),
    "choose_target": choose_target,
    "collide": recorded("collide", collisions),
    "cosine_and_sine": numbers(1),
    "elastic_potential": numbers(4),
    "exponentials": exponentials,
    "keep_present": recorded("keep_present", runs_with_steps),
    "next_event": recorded("next_event", searches),
    "normal_force": numbers(7),
    "penetration": numbers(3),
    "run_cases": recorded("run_cases", runs_with_impacts),
    "switching_potential": numbers(5),
    "switching_stiffness": numbers(5),
    "write_energies": recorded("write_energies", runs_with_steps),
}


# ---- what is wrong with them ----------------------------------------------------------------------


def _dead(array: np.ndarray) -> memoryview:
    view = memoryview(array)
    view.release()
    return view


def _shifted(array: np.ndarray) -> np.ndarray:
    """An array that does not begin where its numbers may."""
    memory = bytearray(array.nbytes + 1)
    return np.frombuffer(memory, dtype=array.dtype, count=array.size, offset=1).reshape(array.shape)


def _frozen(array: np.ndarray) -> np.ndarray:
    array = array.copy()
    array.flags.writeable = False
    return array


def _full_of(array: np.ndarray, value: float) -> np.ndarray:
    """Numbers that no kernel may choke on; an index that leads nowhere is made by Python, and is not tried."""
    return np.full(array.shape, value, array.dtype) if array.dtype.kind in "fc" else array


class _Raising:
    def __float__(self) -> float:
        raise RuntimeError("no number")

    __index__ = __float__

    @property
    def __array_interface__(self) -> dict[str, Any]:
        raise RuntimeError("no array")


TYPES = [
    "f4",
    "f8",
    ">f8",
    "f2",
    "g",
    "c8",
    "c16",
    ">c16",
    "i1",
    "i4",
    "i8",
    "u8",
    ">i8",
    "?",
    "S8",
    "U2",
    "O",
    "V16",
]

WRONG_ARRAYS: list[Callable[[np.ndarray, random.Random], Any]] = [
    lambda array, _: array.tolist(),
    lambda array, _: array.tobytes(),
    lambda array, _: bytearray(array.tobytes()),
    lambda array, _: memoryview(array),
    lambda array, _: memoryview(array.tobytes()),
    lambda array, _: _dead(array),
    lambda array, _: _shifted(array),
    lambda array, _: _frozen(array),
    lambda array, _: array[::-1],
    lambda array, _: np.repeat(array, 2, axis=-1)[..., ::2],
    lambda array, _: np.asfortranarray(array[None].repeat(2, axis=0)),
    lambda array, _: np.broadcast_to(array.reshape(-1)[:1] if array.size else array, array.shape),
    lambda array, _: array.reshape(()) if array.size == 1 else array[..., None],
    lambda array, _: array[..., :-1],
    lambda array, _: np.concatenate([array, array]),
    lambda array, _: np.empty((0,) * (array.ndim + 1), array.dtype),
    lambda array, random: np.zeros((1,) * random.randint(0, 32), array.dtype),
    lambda array, random: np.zeros(array.shape, random.choice(TYPES)),
    lambda array, _: np.ma.masked_array(array, np.zeros(array.shape, bool)),
    lambda array, _: _full_of(array, np.nan),
    lambda array, _: _full_of(array, np.inf),
    lambda array, _: _full_of(array, -np.inf),
    lambda array, _: (ctypes.c_double * max(array.size, 1))(),
    lambda array, _: (ctypes.c_char * 7)(),
]

WRONG: list[Callable[[], Any]] = [
    lambda: None, lambda: 0, lambda: -1, lambda: 2**63, lambda: 2**2000, lambda: float("nan"), lambda: float("inf"),
    lambda: 1j, lambda: "", lambda: "é\0" * 100, lambda: b"", lambda: [], lambda: {}, lambda: object(),
    lambda: _Raising(),
    lambda: np, lambda: np.float64(1.0), lambda: np.array(1.0), lambda: np.zeros(3), lambda: print, lambda: int,
]  # fmt: skip


def spoiled(arguments: Sequence[Any], random: random.Random) -> list[Any]:
    """The arguments of a call, with none, one or several of them wrong, exchanged, left out or doubled."""
    for _ in range(random.choice([0, 1, 1, 1, 2, 3])):
        arguments = _spoiled_once(arguments, random)
    return list(arguments)


def _spoiled_once(arguments: Sequence[Any], random: random.Random) -> list[Any]:
    arguments = list(arguments)
    if not arguments:
        return arguments
    k = random.randrange(len(arguments))
    if isinstance(arguments[k], tuple) and random.random() < 0.9:
        arguments[k] = tuple(_spoiled_once(arguments[k], random))
        return arguments
    what = random.random()
    if what < 0.6 and isinstance(arguments[k], np.ndarray):
        arguments[k] = random.choice(WRONG_ARRAYS)(arguments[k], random)
    elif what < 0.85:
        arguments[k] = random.choice(WRONG)()
    elif what < 0.9:
        # the same memory twice
        arguments[k] = random.choice(arguments)
    elif what < 0.95:
        del arguments[k]
    else:
        arguments.insert(k, random.choice(WRONG)())
    return arguments


def run_child(seed: int) -> None:
    """Call entries at random; any exception is an answer."""
    faulthandler.enable()
    draw = random.Random(seed)
    answers = {"returned": 0, "refused": 0}
    # sound calls are recorded before the time begins: on a busy machine that alone may take it
    for sound in ENTRIES.values():
        sound(random.Random(seed))
    end = time.monotonic() + CHILD_SECONDS
    for _ in range(CALLS):
        if time.monotonic() > end:
            break
        name = draw.choice(sorted(ENTRIES))
        try:
            arguments = spoiled(list(ENTRIES[name](draw).values()), draw)
        except (ValueError, TypeError, IndexError, OverflowError):
            # numpy itself refuses to make such an array
            continue
        try:
            getattr(core, name)(*arguments)
            answers["returned"] += 1
        except (TypeError, ValueError, OverflowError, RuntimeError, ImportError):
            answers["refused"] += 1
    # a fuzz in which nothing is taken, or nothing refused, tries nothing
    if min(answers.values()) < max(1, sum(answers.values()) // 100):
        sys.exit(f"nearly all calls had one outcome: {answers}")
    print(sum(answers.values()))


def main() -> None:
    """Run child processes until the time is over."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--seed", type=int, help="run this one child alone, in this process")
    options = parser.parse_args()
    if options.seed is not None:
        run_child(options.seed)
        return
    # every function that takes arguments, and no other
    different = (set(core.__all__) - {"build_info", "tables"}) ^ set(ENTRIES)
    if different:
        sys.exit(f"ENTRIES is not what the core has: {', '.join(sorted(different))}")
    end, seed, calls = time.monotonic() + options.seconds, 0, 0
    while time.monotonic() < end:
        command = [sys.executable, "-W", "ignore", __file__, "--seed", str(seed)]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=10.0 * CHILD_SECONDS)
        except subprocess.TimeoutExpired:
            sys.exit(f"a call hung; repeat it with {' '.join(command)}")
        if done.returncode != 0:
            print(done.stdout + done.stderr)
            sys.exit(f"a call crashed (status {done.returncode}); repeat it with {' '.join(command)}")
        seed, calls = seed + 1, calls + int(done.stdout.split()[-1])
    print(f"fuzz: {calls} calls of {', '.join(ENTRIES)}, no crash")


if __name__ == "__main__":
    main()
