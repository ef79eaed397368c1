"""Whether an excitation is given by its displacement or by its acceleration."""

from __future__ import annotations

from femimpact.errors import require

__all__ = ["level_of"]


def level_of(
    amplitude: float | None, acceleration: float | None, level: float | None, by: str | None
) -> tuple[float | None, str | None]:
    """The level and the name of what was given: exactly one of amplitude and acceleration, or level and `by`.

    Raises
    ------
    InputError
        If both or none of them are given.
    """
    given = {"amplitude": amplitude, "acceleration": acceleration}
    named = [name for name, value in given.items() if value is not None]
    if not named and (level is not None or by is not None):
        require(level is not None, "level", level, "m or m/s^2", "must be a finite number >= 0")
        return level, by
    allowed = "must be given alone: one of amplitude (m) and acceleration (m/s^2)"
    require(len(named) == 1, "amplitude", "both" if named else None, "", allowed)
    return given[named[0]], named[0]
