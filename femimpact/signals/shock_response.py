"""Shock response spectra: the largest responses of oscillators on a base, over their natural frequency."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from femimpact.arrays import Array
from femimpact.errors import column, kind_of, optional, quantity, require, takes, warns
from femimpact.excitation.drives import until
from femimpact.excitation.excitation import BrokenLine, is_force, require_excitation, words_of
from femimpact.excitation.harmonic import PiecewiseMotion
from femimpact.excitation.piecewise_polynomial import PiecewisePolynomial, half_sine, pieces_of
from femimpact.excitation.records import RecordedBase
from femimpact.excitation.shock import Shock
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.event_driven.run import find_extremes
from femimpact.response.channels import motion_at
from femimpact.response.response import Recorder, Response
from femimpact.signals.densities import absolute_motion, remarks
from femimpact.signals.transfer import checked_frequencies
from femimpact.structure.structure import Position
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.table import Head, column_units, head_of_columns, short_repr

if TYPE_CHECKING:
    import xarray

READINGS = 16.0
"""Readings of a run in pieces: extremes between them are exact, so that few will do."""

PIECES = 20
"""Polynomials in a half-sine alone: 12 leave 8e-9 without damping where an oscillator has four periods in a piece."""

LONGEST_RESIDUAL = 10.0
"""Undamped periods after the end of a motion: a damped one may be longer, and nothing is left after so many."""

FOLLOWED = 0.1
"""Natural frequency over the reading rate beyond which the straight lines between samples are no longer the motion."""

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
    notes, warnings : tuple of str
    """

    frequency: Array = field(metadata=column("Hz", "n"))
    positive_acceleration: Array = field(metadata=column("m/s^2", "n"))
    negative_acceleration: Array = field(metadata=column("m/s^2", "n"))
    positive_pseudo_velocity: Array = field(metadata=column("m/s", "n"))
    negative_pseudo_velocity: Array = field(metadata=column("m/s", "n"))
    ratio: float
    of: str
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

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
        warned = ", with a warning" if self.warnings else ""
        title = f"ShockResponseSpectrum of {self.of}: damping ratio {self.ratio:g}{warned}"
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
        return xarray.Dataset(columns, coords=axis, attrs={"damping_ratio": self.ratio, "of": self.of} | remarks(self))


@warns
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
    are exact for the closed form of the motion (of one half-sine within 1e-9, of several, or compensated ones, 1e-8).
    It is followed until the motion ends and one period more, so that primary and residual responses are in it. A record
    or a channel is read as straight lines between samples: a warning says from which frequency on these count.

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

    Examples
    --------
    A half-sine of 30 g and 11 ms:

    >>> import femimpact as fi
    >>> shock = fi.Shock("half-sine", acceleration=30 * 9.80665, duration=0.011)
    >>> spectrum = fi.shock_response_spectrum(shock, [10.0, 75.0, 1000.0], ratio=0.05)
    >>> bool(spectrum.acceleration[1] > 1.5 * 30 * 9.80665)
    True
    """
    f = checked_frequencies(frequency)
    if isinstance(of, Response):
        base, words = _base_of(of, channel)
    else:
        require(channel is None, "channel", channel, "", "must be left out: it belongs to a run")
        require_excitation(of, "of")
        base, words = of, words_of(of)
    require(not is_force(base), "of", kind_of(base), "", "must be a motion of the base, and is a force")
    if duration is not None:
        base = until(base, duration)
    form = getattr(base, "closed_form", None)
    pieces = pieces_of(form) if isinstance(form, BrokenLine | PiecewisePolynomial) else None
    allowed = f"must be given: {words} does not end by itself"
    require(pieces is not None or duration is not None, "duration", None, "", allowed)
    warnings: tuple[str, ...] = ()
    # lines between samples: those of a velocity are steps of the acceleration
    if isinstance(form, BrokenLine) or isinstance(base, _Motion):
        rate = 1.0 / form.interval if isinstance(form, BrokenLine) else 2.0 * base.frequency
        text = f"above {FOLLOWED * rate:.4g} Hz, a tenth of the sampling rate, what lies between samples is not known"
        warnings = (text,) if f.max() > FOLLOWED * rate else ()
    if isinstance(of, Shock) and of.kind == "half-sine" and of.pulses == 1 and not of.compensated:
        base = _Motion(half_sine(of.level, of.duration, of.delay, PIECES))
    end, later = (pieces.duration, 1.0) if duration is None and pieces is not None else (duration or 0.0, 0.0)
    # each alone: 100 oscillators of 5 to 2000 Hz in one system take 1.9 s for both extremes of both quantities, where
    # each is read as finely and as long as any of them needs, and agree to 2e-10; one by one they take 0.5 s
    periods = later * min(1.0 / math.sqrt(1.0 - ratio**2), LONGEST_RESIDUAL)
    sizes = [_extremes(base, float(fn), ratio, end + periods / fn, pieces is not None) for fn in f]
    up, down, faster, slower = np.array(sizes).T
    return ShockResponseSpectrum(f, up, down, faster, slower, ratio, words, warnings=warnings)


def _extremes(
    base: Any, frequency: float, ratio: float, end: float, in_pieces: bool
) -> tuple[float, float, float, float]:
    """Both sizes of the absolute acceleration (m/s^2) and of the pseudo velocity (m/s) of one oscillator."""
    omega = 2.0 * math.pi * frequency
    matrices = [[1.0]], [[2.0 * ratio * omega]], [[omega**2]]
    system = System.from_matrices(*matrices, points={"mass": [1.0]})
    recorder = Recorder("mass", interval=end / READINGS if in_pieces else None)
    sizes: list[float] = []
    for read, factor in ((motion_at("mass", 2, True), 1.0), (motion_at("mass"), -omega)):
        extremes = find_extremes(system, base, EventDriven(), end, recorder, State(), read)
        values = [factor * extreme.value for extreme in extremes]
        sizes += [max(*values, 0.0), max(-min(values), 0.0)]
    return sizes[0], sizes[1], sizes[2], sizes[3]


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
