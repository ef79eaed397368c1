"""Numbers of a structure that are allowed, and so unusual that another unit may have been meant."""

from __future__ import annotations

import math
from collections.abc import Iterator

from femimpact.structure.structure import Structure

__all__ = ["unusual_numbers"]

USUAL_MODULUS = (1e8, 2e12)
"""Young's moduli (Pa) of what beams are made of: from soft plastics to diamond. Rubber, from 1e6 Pa, is warned of."""

USUAL_DENSITY = (10.0, 3e4)
"""Densities (kg/m^3) of what beams are made of: from light foam to osmium, 22,600."""

HEAVY_BODY = 100.0
"""Mass of a body over that of the beam above which grams may have been typed as kilograms."""


def unusual_numbers(structure: Structure) -> list[str]:
    """A line for every number that may be in another unit: its path, its value, its unit and what is usual.

    Parameters
    ----------
    structure : Structure

    Returns
    -------
    list of str
    """
    return [*_of_sections(structure), *_of_gaps(structure), *_of_masses(structure)]


def _of_sections(structure: Structure) -> Iterator[str]:
    beam = structure.beam
    for segment in beam.segments:
        path = "beam" if len(beam.segments) == 1 else f"beam.{segment.name}"
        low, high = USUAL_MODULUS
        if not low <= segment.young_modulus <= high:
            usual = f"outside {low:g} to {high:g} Pa (rubber 1e6 to 1e8, aluminium 7e10, steel 2.1e11)"
            yield f"{path}.young_modulus = {segment.young_modulus:.4g} Pa: {usual}; is it in Pa?"
        low, high = USUAL_DENSITY
        if not low <= segment.density <= high:
            usual = f"outside {low:g} to {high:g} kg/m^3 (aluminium 2700, steel 7850)"
            yield f"{path}.density = {segment.density:.4g} kg/m^3: {usual}; is it in kg/m^3?"
        if segment.width is not None and segment.width > beam.length:
            usual = f"wider than the beam is long, {beam.length:.4g} m, which is no beam"
            yield f"{path}.width = {segment.width:.4g} m: {usual}; {_in_millimetres(segment.width)}"


def _of_gaps(structure: Structure) -> Iterator[str]:
    length = structure.beam.length
    pairs = [(f"impactor.{ball.name}", ball.gaps) for ball in structure.impactors]
    for path, gaps in [*pairs, *((f"stop.{stop.name}", stop.gaps) for stop in structure.stops)]:
        # one wall out of reach may be meant
        if length < min(gaps):
            usual = f"wider than the beam is long, {length:.4g} m"
            yield f"{path}.gap = {min(gaps):.4g} m: {usual}; {_in_millimetres(min(gaps))}"
    for body in structure.masses:
        if length < abs(body.offset):
            usual = f"longer than the beam, {length:.4g} m"
            yield f"mass.{body.name}.offset = {body.offset:.4g} m: {usual}; {_in_millimetres(body.offset)}"


def _of_masses(structure: Structure) -> Iterator[str]:
    beam = structure.beam.mass
    # a density out of range is named already
    solid = all(USUAL_DENSITY[0] <= segment.density for segment in structure.beam.segments)
    heavy = [body for body in structure.masses if solid and body.mass > HEAVY_BODY * beam]
    for body in heavy:
        usual = f"more than {HEAVY_BODY:g} times the beam's {beam:.4g} kg"
        yield f"mass.{body.name}.mass = {body.mass:.4g} kg: {usual}; {_in_grams(body.mass)}"
    # beside a body in grams a ball in grams is not heavy
    whole = beam + math.fsum(body.mass for body in structure.masses if body not in heavy)
    for ball in structure.impactors:
        if ball.mass > whole:
            usual = f"more than beam and bodies together, {whole:.4g} kg"
            yield f"impactor.{ball.name}.mass = {ball.mass:.4g} kg: {usual}; {_in_grams(ball.mass)}"


def _in_millimetres(metres: float) -> str:
    return f"is it in metres? {metres:.4g} mm are {1e-3 * metres:.4g} m"


def _in_grams(kilograms: float) -> str:
    return f"is it in kilograms? {kilograms:.4g} g are {1e-3 * kilograms:.4g} kg"
