"""Closed forms of a system with Kelvin-Voigt contacts: one for every state of contact, for many cases at once.

In contact with a wall a pair adds k P P^T to the stiffness, c P P^T to the damping and -P k side gap to the
load: with the direction P of a force on the structure the motion stays linear.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from femimpact.contact.formulas import KELVIN_VOIGT
from femimpact.errors import require
from femimpact.integrators.complex_modes import ComplexModes, complex_modes
from femimpact.integrators.driving import Drive
from femimpact.integrators.event_driven import Outputs
from femimpact.integrators.flight_space import Equations, equations_of, undamped_modes, wall_offset
from femimpact.integrators.kernels.forms import Forms, Waves
from femimpact.integrators.kernels.passage import Reading
from femimpact.integrators.layout import CYCLE_COLUMNS
from femimpact.system import ContactPair, System

__all__ = ["Compliant", "compliant_forms", "is_compliant", "reading_of", "waves_of"]


def is_compliant(system: System) -> bool:
    """Whether there are contacts and all of them are Kelvin-Voigt."""
    kinds = [pair.parameters.kind for pair in system.contacts]
    return bool(kinds) and all(kind == KELVIN_VOIGT for kind in kinds)


@dataclass(frozen=True, eq=False)
class Compliant:
    """A system's equations and the closed forms of all its states of contact.

    Parameters
    ----------
    equations : Equations
    states : tuple of tuple of int
        Side of the wall that each pair touches, 0 for none, in the order of the forms.
    forms : Forms
    matrices : tuple of (K, C)
        Of every state.
    """

    equations: Equations
    states: tuple[tuple[int, ...], ...]
    forms: Forms
    matrices: tuple[tuple[NDArray[Any], NDArray[Any]], ...]


_KNOWN: WeakKeyDictionary[System, dict[tuple[bytes, float], Compliant]] = WeakKeyDictionary()
"""Closed forms already found: they take longer than a second of flight."""


@dataclass(frozen=True, eq=False)
class _Form:
    """Closed form of one state; see Forms."""

    modes: ComplexModes
    shape: NDArray[Any]
    particle_shape: NDArray[Any]
    particle_given: NDArray[Any]
    static: NDArray[Any]
    to_entry_u: NDArray[Any]
    to_entry_v: NDArray[Any]
    to_particle: NDArray[Any]


def compliant_forms(system: System, drive: Drive) -> Compliant:
    """Closed forms of all states of contact; what of them depends on the frequency is in `waves_of`.

    Parameters
    ----------
    system : System
        On its modes, all contacts Kelvin-Voigt.
    drive : Drive
        Any of the cases: they differ by frequency, amplitude and phase.

    Returns
    -------
    Compliant
    """
    known = _KNOWN.setdefault(system, {})
    key = drive.load.tobytes(), drive.share
    if key not in known:
        known[key] = _prepare(system, drive)
    return known[key]


def _prepare(system: System, drive: Drive) -> Compliant:
    pairs = system.contacts
    whole = equations_of(system, drive)
    # the first pair has the lowest digit of a state's number
    states = tuple(s[::-1] for s in itertools.product((0, 1, -1), repeat=len(pairs)))
    kv = np.array([(pair.parameters.stiffness, pair.parameters.damping) for pair in pairs]).reshape(-1, 2)
    forms, matrices = list[_Form](), []
    known: dict[bytes, tuple[_Form, NDArray[Any], NDArray[Any]]] = {}
    for sides in states:
        touching = np.abs(sides).astype(bool)
        directions = whole.force[:, touching]
        K = whole.K + (directions * kv[touching, 0]) @ directions.T
        C = whole.C + (directions * kv[touching, 1]) @ directions.T
        walled = [j for j, side in enumerate(sides) if side and math.isfinite(pairs[j].gaps[0 if side > 0 else 1])]
        key = touching.tobytes()
        known[key] = known[key] if key in known else _homogeneous(whole, K, C)
        forms.append(_with_static(known[key], whole, wall_offset(system, whole, tuple((j, sides[j]) for j in walled))))
        matrices.append((K, C))
    return Compliant(whole, states, _stacked(system, whole, forms, kv), tuple(matrices))


def _gap(pair: ContactPair, side: int) -> float:
    """Gap to a wall (m); any number will do for one that is not there: its state is never entered."""
    gap = pair.gaps[0 if side > 0 else 1]
    return gap if math.isfinite(gap) else 0.0


def _homogeneous(whole: Equations, K: NDArray[Any], C: NDArray[Any]) -> tuple[_Form, NDArray[Any], NDArray[Any]]:
    """Closed form of a state without its loads; the compliance of its bound motions and its loose shapes."""
    omega_squared, shapes = undamped_modes(K, whole.M)
    damping = shapes.T @ C @ shapes
    # what nothing pulls back and nothing brakes moves on parabolas: free balls
    stiff = omega_squared > 0.0
    braked = np.max(np.abs(damping), axis=0, initial=0.0) > 1e-15 * max(float(np.abs(damping).max(initial=0.0)), 1e-300)
    bound = stiff | braked
    omega_squared = np.where(stiff, omega_squared, 0.0)
    elastic, loose = shapes[:, bound], shapes[:, ~bound]
    modes = complex_modes(omega_squared[bound], damping[np.ix_(bound, bound)])
    momentum = elastic.T @ whole.M
    with np.errstate(divide="ignore"):
        compliance = (elastic * np.where(stiff[bound], 1.0 / omega_squared[bound], 0.0)) @ elastic.T
    empty = np.zeros(0)
    form = _Form(
        modes, elastic @ modes.shape, loose, empty, empty, modes.from_u @ momentum, modes.from_v @ momentum,
        loose.T @ whole.M,
    )  # fmt: skip
    return form, compliance, loose


def _with_static(found: tuple[_Form, NDArray[Any], NDArray[Any]], whole: Equations, offset: NDArray[Any]) -> _Form:
    """With its static position: seen from where the walls are just met, no contact spring is strained by the gap."""
    form, compliance, loose = found
    given = whole.given - whole.K @ offset
    return _Form(
        form.modes, form.shape, form.particle_shape, loose.T @ given, offset + compliance @ given, form.to_entry_u,
        form.to_entry_v, form.to_particle,
    )  # fmt: skip


def _stacked(system: System, whole: Equations, forms: Sequence[_Form], kv: NDArray[Any]) -> Forms:
    """All states in arrays of one size; entries and particles that a state lacks have no weight."""
    entries = max(form.modes.exponent.size for form in forms)
    particles = max(form.particle_given.size for form in forms)

    def padded(name: str, axis: int, size: int) -> NDArray[Any]:
        return _padded([getattr(form, name) for form in forms], {axis: size})

    modes = [form.modes for form in forms]
    exponent = _padded([m.exponent for m in modes], {0: entries})
    coupling = _padded([m.coupling for m in modes], {0: entries, 1: entries})
    shape, particle_shape = padded("shape", 1, entries), padded("particle_shape", 1, particles)
    shape_rate = shape @ (coupling + exponent[:, None, :] * np.eye(entries))
    static = np.array([form.static for form in forms])
    rows = -whole.force.T
    x, x_particle, x_static = rows @ shape, rows @ particle_shape, static @ rows.T
    k, c = kv[:, 0], kv[:, 1]
    weight = np.concatenate([x, k[:, None] * x + c[:, None] * (rows @ shape_rate)], axis=1)
    return Forms(
        exponent=exponent,
        coupling=coupling,
        blocks=_padded([m.blocks for m in modes], {0: max(len(m.blocks) for m in modes)}),
        size=_padded([m.size for m in modes], {0: entries}),
        particle_given=padded("particle_given", 0, particles),
        weight=np.ascontiguousarray(weight),
        weight_size=np.abs(weight),
        particle_weight=np.concatenate([x_particle, k[:, None] * x_particle], axis=1),
        particle_rate_weight=np.concatenate([0.0 * x_particle, c[:, None] * x_particle], axis=1),
        constant=np.concatenate([x_static, k * x_static], axis=1),
        shape=shape,
        shape_rate=np.ascontiguousarray(shape_rate),
        particle_shape=particle_shape,
        static=static,
        to_entry_u=padded("to_entry_u", 0, entries),
        to_entry_v=padded("to_entry_v", 0, entries),
        to_particle=padded("to_particle", 0, particles),
        gap=np.array([pair.gaps for pair in system.contacts]).reshape(-1, 2).T.copy(),
        stiffness=np.ascontiguousarray(k),
    )


def _padded(arrays: Sequence[NDArray[Any]], sizes: dict[int, int]) -> NDArray[Any]:
    """All arrays in one, each filled up with zeros to these sizes of its axes."""
    columns = []
    for array in arrays:
        width = [(0, sizes.get(i, length) - length) for i, length in enumerate(array.shape)]
        columns.append(np.pad(array, width))
    return np.ascontiguousarray(np.array(columns))


def waves_of(system: System, found: Compliant, drives: Sequence[Drive]) -> Waves:
    """What the drives of all cases add to the closed forms.

    Raises
    ------
    InputError
        If a drive is a resonance without damping, whose closed form is unbounded.
    """
    whole, omega = found.equations, np.array([drive.omega for drive in drives])
    amplitude = np.array([drive.amplitude for drive in drives])
    wave = -1j * amplitude
    harmonic = np.zeros((omega.size, len(found.states), whole.M.shape[0]), dtype=complex)
    for s, (K, C) in enumerate(found.matrices):
        dynamic = K - omega[:, None, None] ** 2 * whole.M + 1j * omega[:, None, None] * C
        _check_resonance(K, whole.M, C, omega)
        answer = np.linalg.solve(dynamic, np.broadcast_to(whole.drive, (omega.size, whole.drive.size))[:, :, None])
        harmonic[:, s] = answer[:, :, 0] * wave[:, None]
    rows = -whole.force.T
    x = harmonic @ rows.T
    k = np.array([pair.parameters.stiffness for pair in system.contacts])
    c = np.array([pair.parameters.damping for pair in system.contacts])
    sine = np.concatenate([x, (k + 1j * omega[:, None, None] * c) * x], axis=2)
    phase = np.array([drive.phase for drive in drives])
    return Waves(omega, phase, amplitude, np.ascontiguousarray(sine), harmonic)


def _check_resonance(K: NDArray[Any], M: NDArray[Any], C: NDArray[Any], omega: NDArray[Any]) -> None:
    """Refuse an undamped mode driven at its own frequency."""
    undamped = np.abs(C).sum(axis=0) == 0.0
    near = np.abs(np.diag(K) - omega[:, None] ** 2 * np.diag(M)) < 1e-9 * np.diag(K)
    hit = np.any(near & undamped & (np.diag(K) > 0.0), axis=1)
    if np.any(hit):
        frequency = float(omega[hit][0]) / (2.0 * np.pi)
        allowed = "must not be a natural frequency of an undamped mode: the steady answer is unbounded; add damping"
        require(False, "frequency", frequency, "Hz", allowed)


def reading_of(
    system: System, found: Compliant, waves: Waves, outputs: Outputs, interval: NDArray[Any], samples: int,
    per_cycle: int, cycles: int,
) -> Reading:  # fmt: skip
    """Rows of what is read at every sample, in every state of contact.

    Parameters
    ----------
    system : System
    found : Compliant
    waves : Waves
    outputs : Outputs
        Number 0 gets statistics, its rate is number 1; a pair's force is read while it touches, and is 0 else.
    interval : ndarray (cases,), s
    samples : int
        Most that one call keeps of a case.
    per_cycle, cycles : int
        Samples of a base cycle, and cycles of which one call keeps statistics.

    Returns
    -------
    Reading
    """
    forms, position, rate = found.forms, outputs.position, outputs.rate
    weight = position @ forms.shape + rate @ forms.shape_rate
    particle, particle_rate = position @ forms.particle_shape, rate @ forms.particle_shape
    constant = forms.static @ position.T
    wave = 1j * waves.omega[:, None, None]
    sine = waves.harmonic @ position.T + wave * (waves.harmonic @ rate.T)
    pairs = len(system.contacts)
    for o, j in enumerate(outputs.force):
        for s, sides in enumerate(found.states):
            if j >= 0 and sides[j] != 0:
                wall = sides[j] * forms.stiffness[j] * _gap(system.contacts[j], sides[j])
                weight[s, o], sine[:, s, o] = forms.weight[s, pairs + j], waves.sine[:, s, pairs + j]
                constant[s, o] = forms.constant[s, pairs + j] - wall
    return Reading(
        interval=np.array(interval, dtype=float),
        weight=np.ascontiguousarray(weight),
        particle=np.ascontiguousarray(particle),
        particle_rate=np.ascontiguousarray(particle_rate),
        constant=np.ascontiguousarray(constant),
        sine=np.ascontiguousarray(sine),
        values=np.zeros((waves.omega.size, samples, len(outputs.force))),
        origin=np.zeros(waves.omega.size, dtype=np.int64),
        last=np.zeros((waves.omega.size, 2)),
        per_cycle=per_cycle,
        cycles=np.zeros((waves.omega.size, cycles, len(CYCLE_COLUMNS))),
    )
