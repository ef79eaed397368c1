"""Meshes of a beam along x: sorted nodes, named points, named regions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from heapq import heapify, heapreplace

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import Fault, InputError, checked, made, name_text, quantity, real_array, require, require_type
from femimpact.structure.structure import Structure
from femimpact.table import Head, head_of_values, short_repr

SAME_PLACE = 1e-9
"""Two positions closer than this share of the beam's length are one place."""


MOST_ELEMENTS = 100_000
"""Most elements of a mesh made here; more is taken for a mistake."""


@short_repr
@dataclass(frozen=True, eq=False)
class Mesh:
    """Line elements between sorted nodes.

    Parameters
    ----------
    nodes : ndarray (n,), m
        Increasing, root first.
    points : mapping of str to float
        Named places, m from the root; "root", "tip" and "mid" are always there.
    regions : mapping of str to ndarray
        Element numbers of each named region.

    Raises
    ------
    InputError
        If the nodes do not increase, a place is not on the beam, "root", "tip" or "mid" is given another
        place, or a region names an element that does not exist.

    Examples
    --------
    >>> import femimpact as fi
    >>> mesh = fi.uniform_mesh(structure, elements=10)
    >>> fi.assemble(structure, mesh=mesh).dofs
    20
    """

    nodes: Array
    points: Mapping[str, float] = field(default_factory=dict)
    regions: Mapping[str, NDArray[np.int64]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        allowed = "must be two or more increasing positions"
        nodes = real_array("mesh.nodes", self.nodes, "m", allowed)
        increasing = nodes.ndim == 1 and nodes.size >= 2 and bool(np.all(np.diff(nodes) > 0))
        require(increasing, "mesh.nodes", None, "m", allowed)
        at_root = abs(nodes[0]) <= SAME_PLACE * (nodes[-1] - nodes[0])
        require(bool(at_root), "mesh.nodes", float(nodes[0]), "m", "must begin with the root, at 0 m")
        nodes.setflags(write=False)
        object.__setattr__(self, "nodes", nodes)
        object.__setattr__(self, "points", self._checked_points())
        object.__setattr__(self, "regions", self._checked_regions())

    def _checked_points(self) -> dict[str, float]:
        """Places by name: the three that every mesh has, and those given."""
        require_type(self.points, Mapping, "mesh.points")
        root, tip = float(self.nodes[0]), float(self.nodes[-1])
        places = _ends_and_middle(root, tip)
        slack = SAME_PLACE * (tip - root)
        for name, place in self.points.items():
            checked("mesh.points", name, name_text())
            on_beam = quantity("m", at_least=root - slack, at_most=tip + slack)
            at = min(max(checked(f"mesh.points.{name}", place, on_beam), root), tip)
            # a name that every mesh has means its place: another one would move what is attached there
            meant = abs(at - places.get(name, at)) <= slack
            allowed = f"must lie at {places.get(name, at):.9g} m, where {name!r} is on every beam: take another name"
            require(meant, f"mesh.points.{name}", place, "m", allowed)
            places.setdefault(name, at)
        return places

    def _checked_regions(self) -> dict[str, NDArray[np.int64]]:
        """Elements by name of their region."""
        require_type(self.regions, Mapping, "mesh.regions")
        regions = {}
        for name, elements in self.regions.items():
            checked("mesh.regions", name, name_text())
            key, allowed = f"mesh.regions.{name}", f"must be numbers of elements, 0 to {self.elements - 1}, each once"
            members = real_array(key, elements, "", allowed)
            sound = members.ndim == 1 and bool(np.all((members % 1 == 0) & (members >= 0) & (members < self.elements)))
            require(sound and np.unique(members).size == members.size, key, None, "", allowed)
            regions[name] = members.astype(int)
        return regions

    @property
    def _head(self) -> Head:
        lengths = np.diff(self.nodes)
        values = {
            "element lengths": f"{lengths.min():.5g} to {lengths.max():.5g} m",
            "points": ", ".join(f"{name} at {x:.5g} m" for name, x in self.points.items()),
            "regions": ", ".join(f"{name}: {members.size}" for name, members in self.regions.items()) or "none",
        }
        return head_of_values(f"Mesh: {self.elements} elements on {self.nodes[-1]:.5g} m", values)

    @cached_property
    def elements(self) -> int:
        """Number of elements."""
        return self.nodes.size - 1

    @property
    def largest(self) -> float:
        """Length (m) of the longest element."""
        return float(np.diff(self.nodes).max())

    def refined(self, times: int = 1) -> Mesh:
        """The mesh with each element halved, again and again; points and regions keep their names.

        Parameters
        ----------
        times : int

        Returns
        -------
        Mesh
            With 2^times the elements. The nodes of this mesh are among its nodes, to the last bit.

        Raises
        ------
        InputError
            If it gives more than 100,000 elements.
        """
        times = checked("times", times, quantity("1", at_least=0, at_most=17, integer=True))
        count = self.elements * 2**times
        require(count <= MOST_ELEMENTS, "times", times, "", f"gives {count} elements; must give <= {MOST_ELEMENTS}")
        nodes, regions = self.nodes, self.regions
        for _ in range(times):
            middles = 0.5 * (nodes[1:] + nodes[:-1])
            nodes = np.append(np.column_stack([nodes[:-1], middles]).ravel(), nodes[-1])
            regions = {name: np.add.outer(2 * members, [0, 1]).ravel() for name, members in regions.items()}
        return Mesh(nodes, self.points, regions)


def _ends_and_middle(root: float, tip: float) -> dict[str, float]:
    """The places (m) that every mesh names."""
    return {"root": root, "tip": tip, "mid": 0.5 * (root + tip)}


def _distinct(positions: Iterable[float], length: float) -> list[float]:
    """Sorted positions without those that coincide with the one before."""
    places: list[float] = []
    for x in sorted(positions):
        if not places or x - places[-1] > SAME_PLACE * length:
            places.append(x)
    if length - places[-1] <= SAME_PLACE * length:
        places[-1] = length
    return places


def with_nodes(mesh: Mesh, places: Iterable[float]) -> Mesh:
    """The mesh with nodes at these places (m), too; points and regions keep their names."""
    length = float(mesh.nodes[-1])
    new = [x for x in places if np.abs(mesh.nodes - x).min() > SAME_PLACE * length]
    if not new:
        return mesh
    nodes = np.array(_distinct([*mesh.nodes, *new], length))
    owner = np.searchsorted(mesh.nodes, 0.5 * (nodes[1:] + nodes[:-1])) - 1
    regions = {name: np.flatnonzero(np.isin(owner, members)) for name, members in mesh.regions.items()}
    return Mesh(nodes, mesh.points, regions)


def uniform_mesh(structure: Structure, elements: int) -> Mesh:
    """A mesh of N elements with a node at every joint, support, mass and impactor.

    The elements are shared out among the stretches between those places in proportion to their
    lengths, at least one each; a uniform cantilever with everything at its tip gets N equal ones.

    Parameters
    ----------
    elements : int
        Number of elements.

    Raises
    ------
    InputError
        If there are fewer elements than stretches, or a place is named that no mesh gives.

    Examples
    --------
    >>> import femimpact as fi
    >>> fi.assemble(structure, mesh=fi.uniform_mesh(structure, elements=10)).dofs
    20
    """
    breaks = _breaks(structure)
    return _filled(structure, breaks, breaks, elements, lambda a, b, n: np.linspace(a, b, n, endpoint=False))


def graded_mesh(structure: Structure, elements: int, ratio: float) -> Mesh:
    """A mesh whose element length grows evenly from the root to the tip, with nodes where `uniform_mesh` has them.

    The nodes are x = L (r^s - 1)/(r - 1) at values of s that are even between joints and attachments: element
    lengths are in proportion to 1 + (r - 1) x/L. Meshes of one ratio are a family in which every length falls as 1/N.

    Parameters
    ----------
    elements : int
        Number of elements.
    ratio : float, 1
        r, the element length at the tip over that at the root; above 1 the root is the finer end.

    Raises
    ------
    InputError
        If there are fewer elements than stretches.
    """
    ratio = checked("ratio", ratio, quantity("1", at_least=1e-3, at_most=1e3))
    breaks, length = _breaks(structure), structure.beam.length
    if ratio == 1.0:
        return uniform_mesh(structure, elements)
    mapped = np.log1p((ratio - 1.0) * breaks / length) / np.log(ratio)

    def graded(first: float, last: float, count: int) -> Array:
        s = np.linspace(first, last, count, endpoint=False)
        return np.asarray(length * np.expm1(s * np.log(ratio)) / (ratio - 1.0))

    return _filled(structure, breaks, mapped, elements, graded)


def random_mesh(structure: Structure, elements: int, seed: int) -> Mesh:
    """A mesh of N elements of random lengths, with nodes where `uniform_mesh` has them.

    Between joints and attachments the lengths are in proportion to numbers drawn evenly from 0.5 to 1.5: neighbours
    differ by a factor of 3 at most. What needs a smooth or even mesh does not hold on such a one.

    Parameters
    ----------
    elements : int
        Number of elements.
    seed : int
        The same one gives the same mesh.

    Raises
    ------
    InputError
        If there are fewer elements than stretches.
    """
    seed = checked("seed", seed, quantity("1", at_least=0, integer=True))
    breaks = _breaks(structure)
    generator = np.random.default_rng(seed)

    def drawn(first: float, last: float, count: int) -> Array:
        ends = np.concatenate([[0.0], np.cumsum(generator.uniform(0.5, 1.5, count))])
        return np.asarray(first + (last - first) * ends[:-1] / ends[-1])

    return _filled(structure, breaks, breaks, elements, drawn)


def _breaks(structure: Structure) -> Array:
    """Positions (m) where every mesh made here has a node: joints and attachments."""
    require_type(structure, Structure, "structure")
    beam = structure.beam
    named = _ends_and_middle(0.0, beam.length)
    places = [(key, item.at, structure.place_of(item.at)) for key, item in structure.attachments]
    unknown = [(key, at) for key, at, place in places if isinstance(place, str) and place not in named]
    if unknown:
        raise InputError([Fault(f"{key}.at", at, "", _places_for(key, named, structure)) for key, at in unknown])
    attached = [named[place] if isinstance(place, str) else float(place) for _, _, place in places]
    return np.array(_distinct([*beam.joints, *attached], beam.length))


def _filled(
    structure: Structure, breaks: Array, shares: Array, elements: int, nodes_of: Callable[[float, float, int], Array]
) -> Mesh:
    """A mesh whose stretches have elements in proportion to their length on `shares`, the scale of `nodes_of`.

    The nodes between two breaks, the first included, are `nodes_of` their shares and the number of elements.
    """
    elements = checked("mesh.elements", elements, quantity("1", at_least=1, at_most=MOST_ELEMENTS, integer=True))
    stretches = np.diff(shares)
    wanted = f"must be >= {stretches.size}: one for each stretch between joints and attachments"
    require(elements >= stretches.size, "mesh.elements", elements, "", wanted)
    counts = _share(stretches, elements)
    pieces = [nodes_of(a, b, n) for a, b, n in zip(shares, shares[1:], counts, strict=False)]
    for piece, first in zip(pieces, breaks, strict=False):
        # the very number, where a scale has rounded it
        piece[0] = first
    nodes = np.concatenate([*pieces, breaks[-1:]])
    middles = 0.5 * (nodes[1:] + nodes[:-1])
    beam = structure.beam
    owner = np.searchsorted(np.array(beam.joints[1:-1]), middles)
    regions = {segment.name: np.flatnonzero(owner == i) for i, segment in enumerate(beam.segments)}
    nodes.setflags(write=False)
    return made(Mesh, nodes=nodes, points=_ends_and_middle(0.0, float(nodes[-1])), regions=regions)


def _places_for(key: str, named: Mapping[str, float], structure: Structure) -> str:
    """Places that one item of a structure may have on a mesh made here; a body's name is not a place for itself."""
    bodies = [body.name for body in structure.masses if key != f"mass.{body.name}"]
    return f"must be one of {', '.join([*named, *bodies])}, or metres from the root"


def _share(lengths: Array, total: int) -> NDArray[np.int64]:
    """Whole numbers >= 1 with the given total: the longest element is split, again and again."""
    # the longest element first, and of equal ones that nearest to the root
    longest = [(-length, i) for i, length in enumerate(lengths.tolist())]
    heapify(longest)
    counts = [1] * lengths.size
    for _ in range(total - lengths.size):
        i = longest[0][1]
        counts[i] += 1
        heapreplace(longest, (-float(lengths[i]) / counts[i], i))
    return np.array(counts)
