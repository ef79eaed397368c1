"""The beam: segments in a row, each of one material and of one section or one linear taper; damping. No mesh here."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from femimpact.arrays import Array
from femimpact.errors import Fault, InputError, check_fields, checked, name_text, quantity, require, require_type, takes
from femimpact.units import number_text


def require_single(values: Mapping[str, Any]) -> None:
    """Refuse a width or a thickness that is a pair, with the name of the field that has the other end.

    Raises `InputError`.
    """
    pairs = [name for name in ("width", "thickness") if isinstance(values.get(name), tuple | list)]
    allowed = "must be one number: the other end of a tapered Segment is end_{}"
    faults = [Fault(name, values[name], "m", allowed.format(name)) for name in pairs]
    if faults:
        raise InputError(faults)


FORMS = (
    frozenset({"width", "thickness"}),
    frozenset({"area", "second_moment"}),
    frozenset({"area", "second_moment", "outer_fibre"}),
    frozenset({"diameter"}),
    frozenset({"diameter", "wall"}),
)
"""Fields that give a section together."""

FORMS_IN_WORDS = (
    "give width and thickness (m), or diameter (m), of a tube with wall (m), or area (m^2) and second_moment (m^4), "
    "with outer_fibre (m) for strain and stress"
)


@dataclass(frozen=True)
class Segment:
    """A stretch of beam with one material, and one section or one linear taper.

    Give the section as width and thickness (rectangle, bending along the thickness), as diameter (round bar), as
    diameter and wall (tube), or as area and second_moment, with outer_fibre for strain and stress of the surface.
    Width and thickness are those at the segment's start, its end towards the root.
    With `end_width` or `end_thickness` they change linearly to those at its other end, so that the area is a
    polynomial of degree 2 at most in x and the second moment one of degree 4.

    Parameters
    ----------
    length : float, m
        Along the beam.
    young_modulus : float, Pa
        Of the material.
    density : float, kg/m^3
        Of the material.
    width : float, m
        Of the rectangle, across the motion; with the thickness.
    thickness : float, m
        Of the rectangle, in the direction of motion.
    area : float, m^2
        Of another section, with the second moment.
    second_moment : float, m^4
        Of another section, about the axis of bending.
    name : str
        Name of the mesh region that the segment fills.
    end_width, end_thickness : float, m
        Of the rectangle at the end towards the tip; the default is that at the start.
    outer_fibre : float, m
        Of a section by area and second moment, from the neutral axis to the surface whose strain is read, that on the
        side of +w. Without it the section has no surface strain and no surface stress.
    diameter : float, m
        Of a round bar or a tube, outside.
    wall : float, m
        Thickness of a tube's wall, with the diameter.
    shear_modulus : float, Pa
        G: the segment shears, and its sections have rotary inertia; by default neither. It must not taper then.
    shear_factor : float, 1
        k in the shear stiffness k G A; 5/6 of a rectangle by default. `Beam.round` and `Beam.tube` take Cowper's.
    """

    length: float = field(metadata=quantity("m", above=0.0))
    young_modulus: float = field(metadata=quantity("Pa", above=0.0))
    density: float = field(metadata=quantity("kg/m^3", above=0.0))
    width: float | None = field(default=None, metadata=quantity("m", above=0.0))
    thickness: float | None = field(default=None, metadata=quantity("m", above=0.0))
    area: float | None = field(default=None, metadata=quantity("m^2", above=0.0))
    second_moment: float | None = field(default=None, metadata=quantity("m^4", above=0.0))
    name: str = field(default="beam", metadata=name_text())
    end_width: float | None = field(default=None, metadata=quantity("m", above=0.0))
    end_thickness: float | None = field(default=None, metadata=quantity("m", above=0.0))
    outer_fibre: float | None = field(default=None, metadata=quantity("m", above=0.0))
    diameter: float | None = field(default=None, metadata=quantity("m", above=0.0))
    wall: float | None = field(default=None, metadata=quantity("m", above=0.0))
    shear_modulus: float | None = field(default=None, metadata=quantity("Pa", above=0.0))
    shear_factor: float | None = field(default=None, metadata=quantity("1", above=0.0, at_most=1.0))

    def __post_init__(self) -> None:
        faults = []
        require_single({name: getattr(self, name) for name in ("width", "thickness")})
        set_fields = {name for name in frozenset().union(*FORMS) if getattr(self, name) is not None}
        set_words = " and ".join(sorted(set_fields)) or "nothing"
        if set_fields not in FORMS:
            faults.append(Fault("section", set_words, "", FORMS_IN_WORDS))
        elif "width" not in set_fields:
            allowed = "must be left out: a section given by {} does not taper"
            by = "diameter" if "diameter" in set_fields else "area and second_moment"
            tapers = [n for n in ("end_width", "end_thickness") if getattr(self, n) is not None]
            faults += [Fault(n, getattr(self, n), "m", allowed.format(by)) for n in tapers]
        if self.shear_modulus is None and self.shear_factor is not None:
            allowed = "must be left out without shear_modulus (Pa): the segment does not shear"
            faults.append(Fault("shear_factor", self.shear_factor, "1", allowed))
        elif self.shear_modulus is not None and self.shear_factor is None and self.width is None:
            allowed = "must be given, as only a rectangle has a default: 6 (1 + nu)/(7 + 6 nu) of a round bar (Cowper)"
            faults.append(Fault("shear_factor", None, "1", allowed))
        elif self.shear_modulus is not None and (self.end_width or self.end_thickness):
            allowed = "must be left out where the section tapers: take short segments, each of one section"
            faults.append(Fault("shear_modulus", self.shear_modulus, "Pa", allowed))
        check_fields(self, *faults)
        if self.diameter is not None and self.wall is not None:
            allowed = f"must be below half the diameter, {0.5 * self.diameter:.6g} m: a bar without a hole has no wall"
            require(2.0 * self.wall < self.diameter, "wall", self.wall, "m", allowed)
        allowed = "must give E I and rho A that are neither zero nor infinite to rounding"
        require(self._is_sized, "section", set_words, "", allowed)

    @property
    def _is_sized(self) -> bool:
        """True if E I and rho A are positive and finite at both ends."""
        try:
            ends = [self.rectangle_at(x) for x in (0.0, self.length)]
            values = [self.density * width * thickness for width, thickness in ends]
            values += [self.young_modulus * width * thickness**3 / 12.0 for width, thickness in ends]
            return all(0.0 < value < math.inf for value in values)
        except (OverflowError, ZeroDivisionError):
            return False

    @property
    def is_tapered(self) -> bool:
        """True if the section changes along the segment."""
        return self.rectangle != self.end_rectangle

    @cached_property
    def rectangle(self) -> tuple[float, float]:
        """Width and thickness (m) of the rectangle with this area and second moment, at the start of a taper."""
        if self.width is not None and self.thickness is not None:
            return self.width, self.thickness
        area, second_moment = self.area or 0.0, self.second_moment or 0.0
        if self.diameter is not None:
            wall = self.wall or 0.5 * self.diameter
            inner = self.diameter - 2.0 * wall
            area = math.pi * wall * (self.diameter - wall)
            second_moment = area * (self.diameter**2 + inner**2) / 16.0
        thickness = math.sqrt(12.0 * second_moment / area)
        return area / thickness, thickness

    @cached_property
    def end_rectangle(self) -> tuple[float, float]:
        """Width and thickness (m) at the end towards the tip."""
        width, thickness = self.rectangle
        return self.end_width or width, self.end_thickness or thickness

    def rectangle_at(self, position: float) -> tuple[float, float]:
        """Width and thickness (m) at a distance (m) from the segment's start; beyond an end, those of the end."""
        position = checked("position", position, quantity("m"))
        share = min(max(position / self.length, 0.0), 1.0)
        (width, thickness), (end_width, end_thickness) = self.rectangle, self.end_rectangle
        return width + share * (end_width - width), thickness + share * (end_thickness - thickness)

    def drawn_at(self, position: float) -> tuple[float, float]:
        """Width and height (m) with which the section is drawn at a distance (m) from the segment's start.

        Of a round bar and a tube the diameter, of a section by area and second moment the rectangle that has these.
        """
        if self.diameter is None:
            return self.rectangle_at(position)
        return self.diameter, self.diameter

    @property
    def half_height(self) -> float | None:
        """From the neutral axis to the surface on the side of +w, m; at the start of a taper.

        None of a section by area and second moment without `outer_fibre`: it does not follow from these.
        """
        size = self.diameter if self.thickness is None else self.thickness
        return self.outer_fibre if size is None else 0.5 * size

    @property
    def bending_stiffness(self) -> float:
        """E I, N m^2; at the start of a taper."""
        width, thickness = self.rectangle
        return self.young_modulus * width * thickness**3 / 12.0

    @property
    def shear_length(self) -> float:
        """sqrt(E I/(k G A)), m; 0 without a shear modulus."""
        if self.shear_modulus is None:
            return 0.0
        factor = self.shear_factor or 5.0 / 6.0
        return self.rectangle[1] * math.sqrt(self.young_modulus / (12.0 * factor * self.shear_modulus))

    @property
    def mass_per_length(self) -> float:
        """Rho A, kg/m; at the start of a taper."""
        width, thickness = self.rectangle
        return self.density * width * thickness

    @property
    def mass(self) -> float:
        """Mass, kg: the integral of rho A, with A = A(0) (1 + a s)(1 + b s) over s = 0 to 1."""
        a, b = (end / start - 1.0 for start, end in zip(self.rectangle, self.end_rectangle, strict=True))
        return self.length * self.mass_per_length * (1.0 + 0.5 * (a + b) + a * b / 3.0)


def _circle(bare: Segment, shear_modulus: float | None, shear_factor: float | None) -> Segment:
    """A round bar or a tube with shear; its factor is by default that of a hollow circle (Cowper, 1966)."""
    if shear_modulus is not None and shear_factor is None:
        modulus = checked("shear_modulus", shear_modulus, quantity("Pa", above=0.0))
        nu = bare.young_modulus / (2.0 * modulus) - 1.0
        allowed = f"gives Poisson's number E/(2 G) - 1 = {nu:.4g}; must give -1 to 0.5, or give shear_factor"
        require(-1.0 < nu <= 0.5, "shear_modulus", modulus, "Pa", allowed)
        inner = 0.0 if bare.diameter is None or bare.wall is None else 1.0 - 2.0 * bare.wall / bare.diameter
        q = (1.0 + inner**2) ** 2
        shear_factor = 6.0 * (1.0 + nu) * q / ((7.0 + 6.0 * nu) * q + (20.0 + 12.0 * nu) * inner**2)
    return replace(bare, shear_modulus=shear_modulus, shear_factor=shear_factor)


@dataclass(frozen=True)
class Beam:
    """One or more segments in a row, from the root at x = 0 to the tip.

    Parameters
    ----------
    segments : tuple of Segment
        A stepped beam needs a different name for every segment.
    """

    segments: Sequence[Segment]

    def __new__(cls, *_: Any, **named: Any) -> Beam:
        """A beam whose fields are not set yet; `InputError` for the sizes that `uniform` and its like take."""
        words = "a Beam has segments; Beam.uniform, round, tube and section take length and sizes of one"
        if unknown := sorted(named.keys() - {"segments"}):
            raise InputError([Fault(", ".join(unknown), None, "", words)])
        return super().__new__(cls)

    def __post_init__(self) -> None:
        if isinstance(self.segments, list):
            object.__setattr__(self, "segments", tuple(self.segments))
        require_type(self.segments, tuple, "segments")
        for segment in self.segments:
            require_type(segment, Segment, "segments")
        require(len(self.segments) > 0, "segments", "none", "", "must hold at least one segment")
        names = [segment.name for segment in self.segments]
        require(len(set(names)) == len(names), "segments", names, "", "must have distinct names")

    def __repr__(self) -> str:
        parts = "1 segment" if len(self.segments) == 1 else f"{len(self.segments)} segments"
        names = ", ".join(segment.name for segment in self.segments)
        return f"Beam: {self.length:g} m, {self.mass:.4g} kg, {parts}: {names}"

    @classmethod
    @takes()
    def uniform(
        cls,
        *,
        length: float,
        width: float,
        thickness: float,
        young_modulus: float,
        density: float,
        shear_modulus: float | None = None,
        shear_factor: float | None = None,
    ) -> Beam:
        """A beam of one rectangle, where `round`, `tube` and `section` make others; in m, Pa and kg/m^3.

        It shears with `shear_modulus` (Pa) and `shear_factor`, as of `Segment`; so do the others.
        """
        bare = Segment(length, young_modulus, density, width, thickness)
        return cls((replace(bare, shear_modulus=shear_modulus, shear_factor=shear_factor),))

    @classmethod
    def round(
        cls,
        *,
        length: float,
        diameter: float,
        young_modulus: float,
        density: float,
        shear_modulus: float | None = None,
        shear_factor: float | None = None,
    ) -> Beam:
        """A round bar; lengths in m, moduli in Pa, density in kg/m^3; the shear factor by default as of `tube`."""
        bare = Segment(length, young_modulus, density, diameter=diameter)
        return cls((_circle(bare, shear_modulus, shear_factor),))

    @classmethod
    def tube(
        cls,
        *,
        length: float,
        diameter: float,
        wall: float,
        young_modulus: float,
        density: float,
        shear_modulus: float | None = None,
        shear_factor: float | None = None,
    ) -> Beam:
        """A round tube of an outer diameter and a wall's thickness; lengths in m, moduli in Pa, density in kg/m^3.

        The shear factor is Cowper's by default: 6 (1 + nu)/(7 + 6 nu) of a bar, 2 (1 + nu)/(4 + 3 nu) of a thin wall.
        """
        bare = Segment(length, young_modulus, density, diameter=diameter, wall=wall)
        return cls((_circle(bare, shear_modulus, shear_factor),))

    @classmethod
    def section(
        cls,
        *,
        length: float,
        area: float,
        second_moment: float,
        outer_fibre: float | None = None,
        young_modulus: float,
        density: float,
        shear_modulus: float | None = None,
        shear_factor: float | None = None,
    ) -> Beam:
        """A beam of another section: area in m^2, second moment in m^4, outer fibre in m, as of `Segment`.

        Lengths in m, moduli in Pa, density in kg/m^3. Without `outer_fibre` there is no surface strain and no surface
        stress.
        """
        segment = Segment(
            length,
            young_modulus,
            density,
            area=area,
            second_moment=second_moment,
            outer_fibre=outer_fibre,
            shear_modulus=shear_modulus,
            shear_factor=shear_factor,
        )
        return cls((segment,))

    @cached_property
    def length(self) -> float:
        """Total length, m."""
        return math.fsum(segment.length for segment in self.segments)

    @property
    def mass(self) -> float:
        """Mass of the bare beam, kg."""
        return math.fsum(segment.mass for segment in self.segments)

    @cached_property
    def joints(self) -> tuple[float, ...]:
        """Positions (m) of the segments' ends, the root's 0 first and the tip last."""
        lengths = [segment.length for segment in self.segments]
        inner = [math.fsum(lengths[: i + 1]) for i in range(len(lengths))]
        return (0.0, *inner)

    @property
    def drawn_words(self) -> str:
        """What a picture says of segments that are drawn as another section than theirs; empty where there are none."""
        names = [segment.name for segment in self.segments if segment.area is not None]
        if len(names) == 1:
            return f"{names[0]}: drawn as the rectangle of its area and second moment"
        return f"{', '.join(names)}: drawn as the rectangles of their areas and second moments" if names else ""

    def segment_index_at(self, position: float) -> int:
        """Number of the segment that holds a position (m from the root); at a joint, the one towards the tip."""
        position = checked("position", position, quantity("m"))
        return min(max(bisect_right(self.joints, position) - 1, 0), len(self.segments) - 1)

    def drawn_at(self, position: float) -> tuple[float, float]:
        """Width and height (m) with which the section is drawn at a position (m from the root); see `Segment.drawn_at`.

        At a joint, those towards the tip.
        """
        i = self.segment_index_at(position)
        return self.segments[i].drawn_at(position - self.joints[i])


# ---- damping ---------------------------------------------------------------------------------------


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
        allowed = "give either two modes (counted from 1) or two frequencies (Hz)"
        require((self.modes is None) != (self.frequencies is None), "modes", self.modes, "", allowed)
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
    (w1, w2), (z1, z2) = map(float, omega), map(float, ratio)
    require(w1 != w2, "omega", omega, "rad/s", "must be two different values")
    alpha = 2.0 * w1 * w2 * (z1 * w2 - z2 * w1) / (w2**2 - w1**2)
    beta = 2.0 * (z2 * w2 - z1 * w1) / (w2**2 - w1**2)
    allowed = (
        f"needs alpha = {number_text(alpha, 3)} 1/s and beta = {number_text(beta, 3)} s; a negative one feeds energy "
        "in: bring the two ratios closer together"
    )
    require(alpha >= 0.0 and beta >= 0.0, "damping.ratio", ratio, "1", allowed)
    return alpha, beta


def realised_damping_ratio(alpha: float, beta: float, omega: Array | float) -> Array:
    """Damping ratio alpha/(2 omega) + beta omega/2 that Rayleigh damping gives at omega (rad/s)."""
    return np.asarray(0.5 * (alpha / omega + beta * omega))
