"""Damping of the structure: Rayleigh coefficients from target ratios, or ratios mode by mode."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.errors import check_fields, checked, quantity, real_array, require
from femimpact.units import number_text


@dataclass(frozen=True)
class Rayleigh:
    """Mass- and stiffness-proportional damping C = alpha M + beta K of the structure only.

    Two ratios zeta_i = alpha/(2 omega_i) + beta omega_i/2 give alpha and beta (Clough and Penzien, 2003).

    Parameters
    ----------
    ratio : float or pair of float, 1
        Target damping ratio at both places, or one for each.
    modes : pair of int, optional
        The two modes (counted from 1) that get the target ratios.
    frequencies : pair of float, Hz, optional
        The two frequencies that get them; give either modes or frequencies.
    """

    ratio: float | tuple[float, float] = field(metadata=quantity("1", at_least=0.0, below=1.0, several=True))
    modes: tuple[int, int] | None = field(default=None, metadata=quantity("1", at_least=1, integer=True, several=True))
    frequencies: tuple[float, float] | None = field(default=None, metadata=quantity("Hz", above=0.0, several=True))

    def __post_init__(self) -> None:
        check_fields(self)
        if isinstance(self.ratio, tuple):
            require(len(self.ratio) == 2, "ratio", self.ratio, "1", "must be one number or two")
        require(
            (self.modes is None) != (self.frequencies is None),
            "modes",
            self.modes,
            "",
            "give either two modes (counted from 1) or two frequencies (Hz)",
        )
        pair, name = (self.modes, "modes") if self.modes else (self.frequencies, "frequencies")
        distinct = isinstance(pair, tuple) and len(pair) == 2 and pair[0] != pair[1]
        require(distinct, name, pair, "", "must be two different values")


@dataclass(frozen=True)
class ModalDamping:
    """Given damping ratios of the lowest modes, and damping in proportion to the stiffness above them.

    C = beta K + sum_k (2 ratio_k omega_k - beta omega_k^2) (M phi_k)(M phi_k)^T over the given modes, with
    beta = 2 ratio_n/omega_n of the last one. Every given mode has its ratio exactly; a mode above has
    ratio_n omega/omega_n, the last ratio times its frequency over the last one's. Modes stay decoupled, so that the
    system may be reduced. C is a full matrix: on physical dofs of a fine mesh, reduce first.

    Parameters
    ----------
    ratios : float or tuple of float, 1
        Of modes 1, 2, ...; one number is that of the first mode.

    Notes
    -----
    Clough and Penzien (2003), on damping matrices by modal superposition.
    """

    ratios: float | tuple[float, ...] = field(metadata=quantity("1", at_least=0.0, below=1.0, several=True))

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def each(self) -> tuple[float, ...]:
        """The ratios, one for each given mode."""
        return self.ratios if isinstance(self.ratios, tuple) else (self.ratios,)


def rayleigh_coefficients(
    omega: tuple[float, float],  # pair of float, rad/s
    ratio: tuple[float, float],  # pair of float, 1
) -> tuple[float, float]:  # 1/s and s
    """Coefficients (alpha in 1/s, beta in s) of C = alpha M + beta K from two target ratios.

    ratio_i = alpha/(2 omega_i) + beta omega_i/2 for i = 1, 2 (Clough and Penzien, 2003).

    Raises `InputError` if the targets need a negative coefficient, which would feed energy in elsewhere, or the two
    frequencies are one.
    """
    w1, w2 = _two("omega", omega, quantity("rad/s", above=0.0, several=True))
    z1, z2 = _two("damping.ratio", ratio, quantity("1", several=True))
    require(w1 != w2, "omega", omega, "rad/s", "must be two different values")
    alpha = 2.0 * w1 * w2 * (z1 * w2 - z2 * w1) / (w2**2 - w1**2)
    beta = 2.0 * (z2 * w2 - z1 * w1) / (w2**2 - w1**2)
    require(
        alpha >= 0.0 and beta >= 0.0,
        "damping.ratio",
        ratio,
        "1",
        f"needs alpha = {number_text(alpha, 3)} 1/s and beta = {number_text(beta, 3)} s; a negative one feeds energy "
        "in: "
        "bring the two ratios closer together",
    )
    return alpha, beta


def _two(key: str, values: Any, metadata: dict[str, Any]) -> tuple[float, float]:
    pair = checked(key, values, metadata)
    require(isinstance(pair, tuple) and len(pair) == 2, key, values, metadata["unit"], "must be two numbers")
    return pair[0], pair[1]


def realised_damping_ratio(alpha: float, beta: float, omega: ArrayLike) -> NDArray[np.float64]:
    """Damping ratio alpha/(2 omega) + beta omega/2 that Rayleigh damping gives at omega (rad/s)."""
    a = checked("alpha", alpha, quantity("1/s", at_least=0.0))
    b = checked("beta", beta, quantity("s", at_least=0.0))
    allowed = "must be finite numbers > 0"
    w = real_array("omega", omega, "rad/s", allowed)
    require(bool(np.all(w > 0.0)), "omega", omega, "rad/s", allowed)
    return np.asarray(0.5 * (a / w + b * w))
