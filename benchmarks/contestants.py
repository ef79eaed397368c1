"""femimpact's own methods, in the form of a peer, and the list of all that run against one another."""

from __future__ import annotations

import importlib
import importlib.metadata
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from peers import Sweep

import femimpact as fi

__all__ = ["OWN", "PEERS", "SEPARATE", "Own", "versions"]

PEERS = (
    "hand_c_adaptive", "hand_c_eight", "hand_c", "hand_c_dofs", "scipy_loop", "scipy_lsoda", "exudyn_ode", "opensees",
    "mujoco_chain",
)  # fmt: skip
"""Modules of `peers`, fastest first."""

SEPARATE = ("exudyn_ode", "opensees", "mujoco_chain")
"""Those that are separate tools: each runs in a separate process, which may fail without harm."""

PACKAGES = ("femimpact", "numpy", "scipy", "numba", "exudyn", "openseespy", "mujoco")


@dataclass(frozen=True)
class Own:
    """One of femimpact's methods.

    Parameters
    ----------
    NAME, SPACE : str
    MODES : int
        Kept, and those of the exact history it is held against.
    SETTINGS : tuple
        From coarse to fine.
    make : callable
        The method of a setting.
    usual : callable
        The setting for a task.
    tasks : str
        Those it takes part in.
    """

    NAME: str
    SPACE: str
    MODES: int
    SETTINGS: tuple[Any, ...]
    make: Callable[[Any], Any]
    usual: Callable[[Any], Any]
    tasks: str = "AB"

    def missing(self) -> str:
        """Nothing is missing."""
        return ""

    def system(self, problem, task):
        """On its modes, or in all dofs where it keeps all of them."""
        physical = self.SPACE.endswith("dofs")
        return problem.full(ball=task.ball) if physical else problem.modal(ball=task.ball, modes=self.MODES)

    def sweep(self, problem, task, threads=1) -> Sweep:
        """All frequencies through the public interface."""
        curve = fi.frequency_sweep(
            self.system(problem, task), problem.amplitude, problem.frequencies, self.make(self.usual(task)),
            duration=task.duration, window=task.window, ledger=False, threads=threads,
        )  # fmt: skip
        return Sweep(curve.peak, curve.rms)

    def peaks(self, problem, task, frequencies, duration, window):
        """Of a short sweep, through the same interface."""
        return fi.frequency_sweep(
            self.system(problem, task), problem.amplitude, frequencies, self.make(self.usual(task)),
            duration=duration, window=window, ledger=False, threads=1,
        ).peak  # fmt: skip

    def history(self, problem, task, frequency, duration, setting):
        """The tip through the public interface."""
        sine = fi.Sine(problem.amplitude, frequency)
        record = fi.Recorder(channels=("tip",), ledger=False)
        run = fi.integrate(self.system(problem, task), sine, self.make(setting), duration, record)
        return np.asarray(run.time), np.asarray(run["tip"])


def _newmark(dt):
    return fi.Newmark(dt=dt, allow_coarse_step=True)


def _refined(dt):
    return fi.Newmark(dt=dt, contact="energy-consistent", refine=20, allow_coarse_step=True)


def _event_driven(samples):
    return fi.EventDriven(samples_per_cycle=samples)


def _given(task):
    return task.dt


COARSE = (1 / 500, 1 / 1000, 1 / 2000, 1 / 5000, 1 / 10_000, 1 / 20_000, 1 / 50_000, 1 / 100_000)
STEPS = (2e-4, 1e-4, 5e-5, 2e-5, 1e-5, 5e-6, 2e-6)
OWN = (
    Own("femimpact, event-driven", "8 modes", 8, (64, 256), _event_driven, lambda task: 64),
    Own("femimpact, Newmark", "8 modes", 8, STEPS, _newmark, _given),
    Own("femimpact, Newmark refined in touch", "8 modes", 8, COARSE, _refined, lambda task: COARSE[1], "B"),
    Own("femimpact, Newmark refined, 1/500 s", "8 modes", 8, (), _refined, lambda task: COARSE[0], "B"),
    Own("femimpact, Newmark, all dofs", "20 dofs", 20, STEPS, _newmark, _given),
)


def peer(name):
    """One of PEERS, as a module."""
    return importlib.import_module("peers." + name)


def versions() -> dict[str, str]:
    """Of the packages that take part, where installed."""
    found = {}
    for name in PACKAGES:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found
