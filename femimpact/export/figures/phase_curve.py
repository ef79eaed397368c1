"""The curve of a motion in the plane of displacement and velocity: smooth between impacts, with its corners at them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femimpact.response.response import Response

__all__ = ["changes_of_contact", "corners_of", "phase_curve"]

Array = NDArray[np.float64]
Corners = tuple[Array, Array, Array, Array]

SHORT = 0.25
"""Share of the usual interval between two samples below which one beside a corner is drawn straight."""
POINTS = 1024
"""Of a base cycle, at least: pieces of a curve that fills a picture of 1000 pixels are then some 2 pixels long."""


def corners_of(response: Response, pair: str) -> Corners:
    """Instants (s) at which a ball touches a wall of its box; its place there (m), its rate (m/s) before and after.

    The table of impacts holds both speeds. After the touch of a compliant contact the rate is as before it; how deep
    the ball is when that contact ends is not in the table.

    Parameters
    ----------
    response : Response
    pair : str
        Name of the ball.

    Returns
    -------
    tuple of four ndarray (n,)
        In the order of time.
    """
    impacts = response.impacts
    (contact,) = [one for one in response.system.contacts if one.name == pair]
    own = np.flatnonzero(impacts.impactor == pair)
    own = own[np.argsort(impacts.time[own], kind="stable")]
    side = impacts.side[own].astype(float)
    wall = np.where(side > 0, contact.gaps[0], contact.gaps[1])
    approach, rebound = impacts.approach_speed[own], impacts.rebound_speed[own]
    after = np.where(impacts.duration[own] > 0.0, approach, -rebound)
    return impacts.time[own], side * wall, side * approach, side * after


def changes_of_contact(response: Response) -> Array:
    """Instants (s) at which a contact begins or ends, ascending; there a rate or its slope may jump."""
    impacts, sticking = response.impacts, response.sticking
    times = np.concatenate([impacts.time, impacts.time + impacts.duration, sticking.start, sticking.end])
    return np.sort(times[np.isfinite(times)])


def phase_curve(
    time: Array, value: Array, rate: Array, changes: Array, corners: Corners | None = None, points: int = 1
) -> tuple[Array, Array, Array]:
    """Points of the curve through samples of a value and its rate.

    Between two samples it is the cubic that has the value and the rate of both, and its derivative. Where a contact
    begins or ends between them it is a straight line, unless that is one of the corners.

    Parameters
    ----------
    time : ndarray (n,), s
        Ascending.
    value : ndarray (n,)
    rate : ndarray (n,), 1/s
    changes : ndarray (k,), s
        As of `changes_of_contact`.
    corners : tuple of four ndarray (m,), optional
        As of `corners_of`, in units of the value.
    points : int
        Points in each interval.

    Returns
    -------
    time : ndarray (p,), s
    value : ndarray (p,)
    rate : ndarray (p,), 1/s
    """
    if corners is not None:
        time, value, rate, changes = _with_corners(time, value, rate, changes, corners)
    step = np.diff(time)
    smooth = np.searchsorted(changes, time[1:], side="left") == np.searchsorted(changes, time[:-1], side="right")
    share = np.arange(points) / points
    # rows are intervals, columns the points in them
    s, h = share[None, :], step[:, None]
    times = time[:-1, None] + s * h
    x0, x1, v0, v1 = value[:-1, None], value[1:, None], rate[:-1, None], rate[1:, None]
    mean = np.divide(x1 - x0, h, out=np.zeros_like(h), where=h > 0.0)
    # in a short interval it is nearly straight, and the cubic's rate would magnify an error of its two places
    smooth &= step > SHORT * np.median(step)
    cubic = x0 + s * (h * v0 + s * (h * (3.0 * mean - 2.0 * v0 - v1) + s * h * (v0 + v1 - 2.0 * mean)))
    slope = v0 + s * (2.0 * (3.0 * mean - 2.0 * v0 - v1) + 3.0 * s * (v0 + v1 - 2.0 * mean))
    drawn = np.where(smooth[:, None], cubic, x0 + s * (x1 - x0))
    drawn_rate = np.where(smooth[:, None], slope, v0 + s * (v1 - v0))
    return np.append(times, time[-1]), np.append(drawn, value[-1]), np.append(drawn_rate, rate[-1])


def _with_corners(
    time: Array, value: Array, rate: Array, changes: Array, corners: Corners
) -> tuple[Array, Array, Array, Array]:
    """Samples, with each corner twice: before and after; and the changes that no corner is."""
    at, place, before, after = corners
    inside = (at >= time[0]) & (at <= time[-1])
    at, place, before, after = at[inside], place[inside], before[inside], after[inside]
    # a sample at the instant of an impact is on one side of it only
    kept = ~np.isin(time, at)
    times = np.concatenate([time[kept], np.repeat(at, 2)])
    values = np.concatenate([value[kept], np.repeat(place, 2)])
    rates = np.concatenate([rate[kept], np.stack([before, after], axis=1).ravel()])
    order = np.argsort(times, kind="stable")
    return times[order], values[order], rates[order], changes[~np.isin(changes, at)]
