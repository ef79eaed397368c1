"""Displacements as a laser reads them, and what the first mode makes of them at another place."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import CubicSpline

from femimpact.arrays import Array
from femimpact.errors import (
    check_fields,
    column,
    faults_of,
    instance,
    optional,
    place,
    quantity,
    require,
    takes,
    text,
    warns,
)
from femimpact.response.channels import channel_key
from femimpact.response.response import Response
from femimpact.structure.structure import Position
from femimpact.system.modes import mode_count, solve_modes
from femimpact.system.state import STILL
from femimpact.system.system import System
from femimpact.table import Head, head_of_columns, short_repr

ROUNDING = 1e-6
"""Share of an interval between samples: an instant this near to a sample of the response is that sample."""


@short_repr
@dataclass(frozen=True, eq=False)
class LaserReading:
    """Displacement that a laser has read.

    Parameters
    ----------
    time : ndarray (n,), s
    displacement : ndarray (n,), m
        Relative to the base, from the place at rest.
    at : str or float
        The place whose displacement it is.
    clipped : float, 1
        Share of the samples at an end of the range, 0 to 1.
    warnings : tuple of str
    """

    time: Array = field(metadata=column("s", "samples", finite=True))
    displacement: Array = field(metadata=column("m", "samples", finite=True))
    at: Position = field(metadata=place())
    clipped: float = field(default=0.0, metadata=quantity("1", at_least=0.0, at_most=1.0))
    warnings: tuple[str, ...] = field(default=(), metadata=text(several=True))

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def _head(self) -> Head:
        warned = f"{100.0 * self.clipped:.3g} % of the samples clipped" if self.clipped else "no sample clipped"
        title = f"LaserReading of {self.at}, relative to the base: {warned}"
        columns = {"time": self.time, "displacement": self.displacement}
        return head_of_columns(title, columns, {"time": "s", "displacement": "m"})


@dataclass(frozen=True)
class Laser:
    """A displacement sensor that moves with the base: of limited range, with noise, and sampled.

    It reads w(t) + noise, cut off at offset - range/2 and at offset + range/2.

    Parameters
    ----------
    at : str or float
        The place that it is pointed at.
    range : float, m
        From one end of what it can read to the other.
    noise : float, m
        Standard deviation of what is added to each sample, normally distributed.
    sample_rate : float, Hz, optional
        Samples in a second; by default those of the response.
    offset : float, m
        Of the middle of the range from the place at rest.
    """

    at: Position = field(metadata=place())
    range: float = field(metadata=quantity("m", above=0.0))
    noise: float = field(default=0.0, metadata=quantity("m", at_least=0.0))
    sample_rate: float | None = field(default=None, metadata=optional(quantity("Hz", above=0.0)))
    offset: float = field(default=0.0, metadata=quantity("m"))

    def __post_init__(self) -> None:
        check_fields(self)

    @warns
    @takes(response=instance(Response), seed=quantity("1", at_least=0, integer=True))
    def measure(self, response: Response, seed: int = 0) -> LaserReading:
        """The displacement of a recorded place as this laser reads it.

        Between samples of the response its cubic spline is read.

        Parameters
        ----------
        response : Response
            With the place among its channels, at no fewer samples in a second than the laser takes.
        seed : int
            Of the noise, by numpy's generator.
        """
        name, rate = channel_key(self.at), self.sample_rate
        has_history = response.streamed_to is None and name in response.channels
        wanted = "" if rate is None else f", interval={1.0 / rate:g}"
        allowed = f"was not recorded: run with fi.Recorder(channels=({name!r},){wanted})"
        require(has_history and response.time.size > 1, "at", self.at, "", allowed)
        time, moved = response.time, response.channels[name]
        if rate is not None:
            spacing = float(np.diff(time).max())
            allowed = (
                f"must be at most {1.0 / spacing:.6g} Hz, at which the response was recorded: run with "
                f"fi.Recorder(channels=({name!r},), interval={1.0 / rate:g}) for EventDriven, or a smaller step"
            )
            require(spacing * rate <= 1.0 + ROUNDING, "sample_rate", rate, "Hz", allowed)
            count = int(np.floor((time[-1] - time[0]) * rate + ROUNDING)) + 1
            instants = np.minimum(time[0] + np.arange(count) / rate, time[-1])
            time, moved = instants, CubicSpline(response.time, moved)(instants)
        moved = moved + self.noise * np.random.default_rng(seed).standard_normal(moved.size)
        low, high = self.offset - 0.5 * self.range, self.offset + 0.5 * self.range
        share = float(np.mean((moved < low) | (moved > high)))
        warnings: tuple[str, ...] = ()
        if share > 0.0:
            warnings = (
                f"{100.0 * share:.3g} % of the samples are clipped: {name} moves beyond {1e3 * low:.4g} to "
                f"{1e3 * high:.4g} mm",
            )
        return LaserReading(np.array(time), np.clip(moved, low, high), self.at, share, warnings)


@takes(
    system=instance(System), measured=instance(LaserReading), to=place(), mode=quantity("1", at_least=1, integer=True)
)
def extrapolate(system: System, measured: LaserReading, to: Position = "tip", mode: int = 1) -> LaserReading:
    """The reading carried to another place by the shape of one mode: w(to) = w(at) phi(to)/phi(at).

    It is the motion there where that mode moves alone. All that other modes do at the place of the laser is multiplied
    too.

    Parameters
    ----------
    system : System
    measured : LaserReading
    to : str or float
    mode : int
        From 1 on.

    Raises
    ------
    InputError
        If the system has no such mode or place, or the laser's place is at rest in it.
    """
    shape = solve_modes(system, mode_count(system, mode, "mode")).vectors[:, mode - 1]
    row = system.point_row(measured.at)
    seen = float(row @ shape)
    still = abs(seen) <= STILL * float(np.linalg.norm(row) * np.linalg.norm(shape))
    require(not still, "measured.at", measured.at, "", f"must be a place that moves in mode {mode}")
    with faults_of("to"):
        factor = float(system.point_row(to) @ shape) / seen
    return replace(measured, displacement=factor * measured.displacement, at=to)
