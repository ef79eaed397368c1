"""Shock response spectra: the largest responses of oscillators on a base, over their natural frequency."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from femimpact.arrays import Array
from femimpact.errors import Fault, InputError, column, kind_of, optional, quantity, require, takes
from femimpact.excitation import BrokenLine, PiecewisePolynomial, RecordedBase, require_excitation
from femimpact.excitation.excitation import words_of
from femimpact.excitation.harmonic import PiecewiseMotion
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.event_driven.run import find_extremes
from femimpact.response.channels import Motion
from femimpact.response.response import Recorder, Response
from femimpact.spectra.densities import absolute_motion
from femimpact.spectra.transfer import checked_frequencies
from femimpact.structure.structure import Position
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.table import Head, column_units, head_of_columns, short_repr

if TYPE_CHECKING:
    import xarray

READINGS = 16.0
"""Readings of a run in pieces: extremes between them are exact, so that few will do."""

LONGEST = 1e6
"""Longest time that oscillators are followed, s."""


@short_repr
@dataclass(frozen=True, eq=False)
class ShockResponseSpectrum:
    """Largest responses of single oscillators on a moving base, over their natural frequency.

    The pseudo velocity is 2 pi f times the displacement relative to the base. Its positive side is that of a mass that
    lags behind a positive acceleration, so that without damping it is the acceleration over 2 pi f on both sides.

    Parameters
    ----------
    frequency : ndarray (n,), Hz
        Natural ones, undamped.
    positive_acceleration, negative_acceleration : ndarray (n,), m/s^2
        Largest absolute acceleration of the mass in either direction, as sizes >= 0.
    positive_pseudo_velocity, negative_pseudo_velocity : ndarray (n,), m/s
    ratio : float, 1
        Damping ratio.
    of : str
        What moves the base.
    """

    frequency: Array = field(metadata=column("Hz", "n"))
    positive_acceleration: Array = field(metadata=column("m/s^2", "n"))
    negative_acceleration: Array = field(metadata=column("m/s^2", "n"))
    positive_pseudo_velocity: Array = field(metadata=column("m/s", "n"))
    negative_pseudo_velocity: Array = field(metadata=column("m/s", "n"))
    ratio: float
    of: str

    @property
    def acceleration(self) -> Array:
        """Maxi-max of the absolute acceleration, m/s^2: the larger one of both directions."""
        return np.maximum(self.positive_acceleration, self.negative_acceleration)

    @property
    def pseudo_velocity(self) -> Array:
        """Maxi-max of the pseudo velocity, m/s."""
        return np.maximum(self.positive_pseudo_velocity, self.negative_pseudo_velocity)

    @property
    def _columns(self) -> dict[str, tuple[Array, str]]:
        units = column_units(self) | {"acceleration": "m/s^2", "pseudo_velocity": "m/s"}
        return {name: (getattr(self, name), unit) for name, unit in units.items()}

    @property
    def _head(self) -> Head:
        title = f"ShockResponseSpectrum of {self.of}: damping ratio {self.ratio:g}"
        columns = {name: values for name, (values, _) in self._columns.items()}
        return head_of_columns(title, columns, {name: unit for name, (_, unit) in self._columns.items()})

    def to_xarray(self) -> xarray.Dataset:
        """All columns and both maxi-max as a labelled dataset over frequency."""
        import xarray

        columns: dict[str, Any] = {
            name: ("frequency", values, {"units": unit, "long_name": name.replace("_", " ")})
            for name, (values, unit) in self._columns.items()
        }
        axis = {"frequency": columns.pop("frequency")}
        return xarray.Dataset(columns, coords=axis, attrs={"damping_ratio": self.ratio, "of": self.of})


@takes(ratio=quantity("1", at_least=0.0, below=1.0), duration=optional(quantity("s", above=0.0, at_most=LONGEST)))
def shock_response_spectrum(
    of: Any,
    frequency: ArrayLike,
    ratio: float = 0.05,
    *,
    channel: Position | None = None,
    duration: float | None = None,
) -> ShockResponseSpectrum:
    """Shock response spectrum of a motion of the base, or of a recorded channel of a run.

    Each frequency is an oscillator at rest on the base, computed by events: its extremes lie between samples too, and
    are exact for the closed form of the motion (of a half-sine within 1e-9). It is followed until the motion ends and
    one period more, so that primary and residual responses are in it. A record or a channel is read as straight lines
    between samples.

    Parameters
    ----------
    of : excitation or Response
        A motion of the base with a closed form, or a run.
    frequency : array_like (n,), Hz
        Natural frequencies, above zero.
    ratio : float
        Damping ratio; 0.05 is a quality factor of 10.
    channel : str or float, optional
        Of a run: an acceleration or a velocity, of which the absolute one is taken. Beside rigid contacts the velocity
        has the impulses that the acceleration lacks.
    duration : float, s, optional
        Up to when the oscillators are followed; needed for a motion that does not end.

    Returns
    -------
    ShockResponseSpectrum

    Raises
    ------
    InputError
        If a frequency or the ratio is out of range, the excitation is a force or has no closed form or no end, or the
        channel is no acceleration or velocity.

    Examples
    --------
    A half-sine of 30 g and 11 ms:

    >>> import femimpact as fi
    >>> shock = fi.Shock("half-sine", acceleration=30 * 9.80665, duration=0.011)
    >>> found = fi.shock_response_spectrum(shock, [10.0, 75.0, 1000.0], ratio=0.05)
    >>> bool(found.acceleration[1] > 1.5 * 30 * 9.80665)
    True
    """
    f = checked_frequencies(frequency)
    if isinstance(of, Response):
        base, words = _base_of(of, channel)
    else:
        require(channel is None, "channel", channel, "", "must be left out: it belongs to a run")
        require_excitation(of, "of")
        base, words = of, words_of(of)
    require(getattr(base, "at", None) is None, "of", kind_of(base), "", "must be a motion of the base, and is a force")
    end = _end_of(base) if duration is None else duration
    sizes = []
    for one in f:
        last = end + (0.0 if duration is not None else 1.0 / (one * math.sqrt(1.0 - ratio**2)))
        sizes.append(_extremes(base, float(one), ratio, last))
    up, down, faster, slower = np.array(sizes).T
    return ShockResponseSpectrum(f, up, down, faster, slower, ratio, words)


def _end_of(base: Any) -> float:
    """When a motion ends, s."""
    form = getattr(base, "closed_form", None)
    if isinstance(form, BrokenLine):
        return form.interval * (len(form.samples) - 1)
    if isinstance(form, PiecewisePolynomial):
        return float(form.knots[-1])
    raise InputError([Fault("duration", None, "", f"must be given: {words_of(base)} does not end by itself")])


def _extremes(base: Any, frequency: float, ratio: float, end: float) -> tuple[float, float, float, float]:
    """Both sizes of the absolute acceleration (m/s^2) and of the pseudo velocity (m/s) of one oscillator."""
    omega = 2.0 * math.pi * frequency
    given = [[1.0]], [[2.0 * ratio * omega]], [[omega**2]]
    system = System.from_matrices(*given, points={"mass": [1.0]})
    base = base.until(end) if hasattr(base, "until") else base
    in_pieces = isinstance(getattr(base, "closed_form", None), BrokenLine | PiecewisePolynomial)
    recorder = Recorder("mass", interval=end / READINGS if in_pieces else None)
    found: list[float] = []
    for read, factor in ((Motion("mass", 2, True), 1.0), (Motion("mass"), -omega)):
        extremes = find_extremes(system, base, EventDriven(), end, recorder, State(), read)
        values = [factor * one.value for one in extremes]
        found += [max(*values, 0.0), max(-min(values), 0.0)]
    return found[0], found[1], found[2], found[3]


class _Motion(PiecewiseMotion):
    """A base whose velocity is a broken line."""

    def __init__(self, pieces: PiecewisePolynomial) -> None:
        self._pieces = pieces

    @property
    def _form(self) -> PiecewisePolynomial:
        """Acceleration of the base, m/s^2."""
        return self._pieces

    @property
    def frequency(self) -> float:
        """Half the sampling rate, Hz."""
        return 0.5 / float(self._pieces.knots[1] - self._pieces.knots[0])


def _base_of(response: Response, channel: Position | None) -> tuple[Any, str]:
    """The absolute motion that a channel is, as one of a base, and its name."""
    name, unit, values, interval = absolute_motion(response, channel)
    if unit == "m/s^2":
        return RecordedBase(values, interval), name
    knots = interval * np.arange(values.size)
    slopes = np.diff(values)[:, None] / interval
    return _Motion(PiecewisePolynomial(knots, slopes, float(values[0]))), name
