"""Transfer functions of the linear system, contacts open, in closed form."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import ArrayLike

from femimpact.arrays import Array, Complex
from femimpact.errors import (
    Fault,
    InputError,
    choice,
    faults_of,
    instance,
    optional,
    real_array,
    require,
    require_name,
    takes,
    warns,
)
from femimpact.excitation.drives import PLACE_OR_LINE
from femimpact.excitation.excitation import LineLoad
from femimpact.integrators.channel_rows import Drive, channel_rows, mode_notes
from femimpact.response.channels import Channel, channel_key, resolve_channels
from femimpact.response.response import Recorder
from femimpact.signals.densities import remarks
from femimpact.structure.structure import Position
from femimpact.system.system import System
from femimpact.table import Head, head_of_values, short_repr

if TYPE_CHECKING:
    import xarray

INPUTS = {"base.displacement": ("m", 2), "base.velocity": ("m/s", 1), "base.acceleration": ("m/s^2", 0)}
"""Motions of the base by name: unit, and how often the acceleration is integrated to it."""


@short_repr
@dataclass(frozen=True, eq=False)
class TransferFunction:
    """Outputs over one input by frequency, complex: an input cos(2 pi f t) gives |H| cos(2 pi f t + arg H).

    Parameters
    ----------
    frequency : ndarray (n,), Hz
    values : mapping of str to complex ndarray (n,)
        By output; of measured ones the estimate H1. `transfer["tip"]` reads one.
    units : mapping of str to str
        Of the values: "1" where both have one unit, as of a transmissibility.
    of : str
        The input: "base.acceleration", "force at tip" or a channel.
    h2 : mapping of str to complex ndarray (n,)
        The estimate H2 of measured ones; empty of the closed form.
    coherence : mapping of str to ndarray (n,), 1
        Of measured ones.
    notes, warnings : tuple of str
    """

    frequency: Array
    values: Mapping[str, Complex]
    units: Mapping[str, str]
    of: str
    h2: Mapping[str, Complex]
    coherence: Mapping[str, Array]
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def _head(self) -> Head:
        outputs = {
            name: f"({unit}), largest {np.abs(self.values[name]).max():.5g}" for name, unit in self.units.items()
        }
        texts = {name: text for name, text in remarks(self).items() if text}
        f = self.frequency
        title = f"TransferFunction of {self.of}: {f.size} frequencies, {f.min():.5g} to {f.max():.5g} Hz"
        return head_of_values(title, outputs | texts)

    def __getitem__(self, channel: Position) -> Complex:
        name = channel_key(channel)
        require_name(name, self.values, "channel")
        return self.values[name]

    def to_xarray(self) -> xarray.Dataset:
        """All outputs as a labelled dataset over frequency, with H2 and coherence where they were measured."""
        import xarray

        columns: dict[str, Any] = {}
        for name, unit in self.units.items():
            columns[name] = ("frequency", self.values[name], {"units": unit, "of": self.of})
            if name in self.coherence:
                columns[f"{name} H2"] = ("frequency", self.h2[name], {"units": unit, "of": self.of})
                columns[f"{name} coherence"] = ("frequency", self.coherence[name], {"units": "1"})
        axis = ("frequency", self.frequency, {"units": "Hz"})
        return xarray.Dataset(columns, coords={"frequency": axis}, attrs={"of": self.of} | remarks(self))


@warns
@takes(system=instance(System), of=optional(choice(*INPUTS)), force_at=optional(PLACE_OR_LINE))
def transfer_function(
    system: System,
    frequency: ArrayLike,
    to: Position | Channel | Sequence[Position | Channel] | None = None,
    of: str | None = None,
    *,
    force_at: Position | LineLoad | None = None,
) -> TransferFunction:
    """Transfer functions of the linear system in closed form, from the base or from a force to any channels.

    Contacts are open: balls move freely, on their centring springs where they have these, and absorbers count. Constant
    loads have no share. The transmissibility of a place is `to="tip.absolute_acceleration"` of the base's acceleration.

    Parameters
    ----------
    system : System
        Physical or reduced.
    frequency : array_like (n,), Hz
        Above zero.
    to : str, float or Channel, or a sequence of them, optional
        Outputs, as of `Recorder.channels`; by default the absolute acceleration of the default place.
    of : {"base.displacement", "base.velocity", "base.acceleration"}, optional
        Input; the acceleration by default.
    force_at : str, float or LineLoad, optional
        Place of a force, which is the input in place of a motion of the base, which is at rest; of a line load the
        input is its history.

    Raises
    ------
    InputError
        If a frequency is not above zero, a place or a channel is unknown, both `of` and `force_at` are given, or an
        undamped system has no finite answer at a frequency.

    Examples
    --------
    The largest transmissibility of the tip from 4 to 7 Hz:

    >>> import numpy as np
    >>> import femimpact as fi
    >>> transfer = fi.transfer_function(system, np.linspace(4.0, 7.0, 301), "tip.absolute_acceleration")
    >>> bool(np.abs(transfer["tip.absolute_acceleration"]).max() > 1.0)
    True
    """
    f = checked_frequencies(frequency)
    outputs = f"{system.default_place}.absolute_acceleration" if to is None else to
    with faults_of("to"):
        channels = resolve_channels(system, Recorder(outputs).channels)  # type: ignore[arg-type]
    require(len(channels) > 0, "to", outputs, "", "must name an output")
    require(of is None or force_at is None, "of", of, "", "must be left out: the force is the input")
    if force_at is None:
        of = of or "base.acceleration"
        drive, share, name = Drive(-system.base_load, 1.0, 1.0, np.zeros_like, None), 1.0, of
    else:
        with faults_of("force_at"):
            drive, share = Drive(system.point_row(force_at), 0.0, 1.0, np.zeros_like, None, force_at), 0.0
        name = force_name(force_at)
    rows = channel_rows(system, drive, channels, springs_apart=True)
    spectra = np.empty((f.size, len(channels)), dtype=complex)
    for i, frequency_hz in enumerate(f):
        rate = 2j * math.pi * frequency_hz
        u, y = harmonic_amplitudes(system, drive.load, share, frequency_hz, rate, rate**2)
        read = (rows.displacement + rate * rows.velocity) @ u + (rows.ball_displacement + rate * rows.ball_velocity) @ y
        spectra[i] = read + share * (rows.base @ [1.0 / rate**2, 1.0 / rate, 1.0]) + rows.drive[:, 0]
    unit, integrals = INPUTS[of] if of else ("1" if isinstance(force_at, LineLoad) else "N", 0)
    spectra *= (2j * math.pi * f[:, None]) ** integrals
    values = {channel.name: spectra[:, i] for i, channel in enumerate(channels)}
    units = {channel.name: unit_over(channel.unit, unit) for channel in channels}
    pressed = ", ".join(pair.name for pair in system.contacts if pair.is_preloaded)
    warnings = (f"in contact at rest, and open here: {pressed}",) if pressed else ()
    notes = mode_notes(system, drive, channels)
    return TransferFunction(f, values, units, name, {}, {}, notes=notes, warnings=warnings)


def harmonic_amplitudes(
    system: System,
    load: Array,  # (dofs,) of the structure per unit of s
    share: float,  # 1 where s is the base's acceleration, which balls have a part of, 0 where it is a force
    frequency: float,  # Hz
    # v/u (1/s) and a/u (1/s^2) of the steady motion: i omega and -omega^2, or as the formulas of a step relate them
    velocity: complex,
    acceleration: complex,
) -> tuple[Complex, Complex]:
    """Complex amplitudes of the structure (dofs,) and of the pairs (pairs,) per unit of s, contacts open.

    The stiffness is applied through its factor, as in `solve_stiffness`, so that fine meshes keep their digits.
    """
    from scipy.sparse.linalg import splu

    alpha, beta = system.rayleigh or (0.0, 0.0)
    rest = (acceleration + alpha * velocity) * system.M
    if system.rayleigh is None:
        rest = rest + velocity * system.C
    factor = sparse.csr_array(system.stiffness_factor)
    scale = 2.0 * math.pi * (system.first_frequency or frequency)
    # balls without a spring and a dashpot stay where they are in space
    y = np.array([0.0 if pair.is_stop else -share / acceleration for pair in system.contacts], dtype=complex)
    held = [
        j for j, pair in enumerate(system.contacts) if not pair.is_stop and (pair.free_stiffness or pair.free_damping)
    ]
    pairs = [system.contacts[j] for j in held]
    springs = np.array([pair.free_stiffness + velocity * pair.free_damping for pair in pairs], dtype=complex)
    masses = np.array([pair.mass for pair in pairs])
    directions = sparse.csr_array(np.array([pair.direction for pair in pairs]).reshape(len(pairs), system.dofs))
    if held:
        rest = rest + directions.T @ sparse.diags_array(springs) @ directions
    blocks: Any = [
        [scale * sparse.eye_array(factor.shape[0]), factor],
        [(1.0 + beta * velocity) * factor.T, rest / -scale],
    ]
    right = np.concatenate([np.zeros(factor.shape[0]), load / -scale]).astype(complex)
    if held:
        coupling = sparse.diags_array(springs) @ directions / scale
        blocks[0].append(None)
        blocks[1].append(coupling.T)
        blocks.append([None, coupling, sparse.diags_array((acceleration * masses + springs) / -scale)])
        right = np.concatenate([right, share * masses / scale])
    matrix = sparse.block_array(blocks, format="csc").astype(complex)
    try:
        solver = splu(matrix)
    except RuntimeError:
        allowed = "must not be a natural frequency of a system without damping"
        raise InputError([Fault("frequency", frequency, "Hz", allowed)]) from None
    unknowns = solver.solve(right)
    # one refinement: without it 256 elements leave 1e-9, with it 1024 leave 1e-10
    unknowns = unknowns + solver.solve(right - matrix @ unknowns)
    first, last = factor.shape[0], factor.shape[0] + system.dofs
    y[held] = unknowns[last:]
    return np.asarray(unknowns[first:last]), y


LOWEST, HIGHEST = 1e-6, 1e9
"""Frequencies, Hz: beyond them a number is a mistake."""


def checked_frequencies(frequency: ArrayLike) -> Array:
    """Frequencies (Hz) as an array (n,), above zero."""
    allowed = f"must be one or more numbers of {LOWEST:g} to {HIGHEST:g}"
    f = np.atleast_1d(real_array("frequency", frequency, "Hz", allowed))
    require(f.ndim == 1 and f.size > 0, "frequency", f"array of shape {f.shape}", "Hz", allowed)
    outside = f[(f < LOWEST) | (f > HIGHEST)]
    require(not outside.size, "frequency", float(outside[0]) if outside.size else None, "Hz", allowed)
    return f


def force_name(at: Position | LineLoad) -> str:
    """The name of a force as an input: "force at tip"."""
    return f"force at {f'{at:g} m' if isinstance(at, (int, float)) else at}"


def unit_over(unit: str, other: str) -> str:
    """The unit of a quotient: "1", "m/N", "Pa/(m/s^2)"."""
    if unit == other or other == "1":
        return unit if other == "1" else "1"
    return f"{unit or '1'}/{other if other.isalpha() else f'({other})'}"
