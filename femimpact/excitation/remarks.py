"""Warnings and notes on a motion of the base that is allowed, and so unusual that another one may have been meant."""

from __future__ import annotations

from femimpact.excitation.excitation import BrokenLine, Excitation

__all__ = ["motion_notes", "motion_warnings"]

FAR = 0.5
"""Displacement of the base over the length of the beam beyond which a wrong unit, or an offset, is likely."""


def motion_warnings(excitation: Excitation, length: float) -> tuple[str, ...]:
    """A warning where the base moves further than half the length of the beam.

    Parameters
    ----------
    excitation : Excitation
        Of one whose closed form is a `BrokenLine` the mean of its samples is named.
    length : float, m
        0 for a structure without one, which has no warning.

    Returns
    -------
    tuple of str
    """
    far = float(excitation.amplitude)
    if not 0.0 < FAR * length < far:
        return ()
    moved = f"the base moves by up to {far:.4g} m, beside a beam of {length:.4g} m"
    line = getattr(excitation, "closed_form", None)
    if not isinstance(line, BrokenLine):
        return (f"{moved}: is the amplitude of the base in metres?",)
    mean = float(line.samples.mean())
    return (
        f"{moved}: the mean acceleration of its record is {mean:.3g} m/s^2; remove offset and drift first, as "
        'RecordedBase.from_csv(..., detrend="line") does; is the record in m/s^2?',
    )


def motion_notes(excitation: Excitation, end: float) -> tuple[str, ...]:
    """A note where a run ends (s) after the record that drives it."""
    line = getattr(excitation, "closed_form", None)
    if not isinstance(line, BrokenLine):
        return ()
    last = (len(line.samples) - 1) * line.interval
    # a run ends at a whole step or sample
    if end <= last + 1.5 * line.interval:
        return ()
    speed = float(line.motion_at(last)[1])
    return (
        f"the run ends at {end:.6g} s, the record at {last:.6g} s: from there on the base moves on at {speed:.3g} m/s, "
        "without acceleration",
    )
