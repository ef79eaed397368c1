r"""
Modes of a stepped and tapered blade
====================================

A foot of constant section carries a blade that becomes narrower and thinner towards the tip, with straight lines
between both ends. Its mass per length is a polynomial of degree 2, its bending stiffness one of degree 4, and both are
integrated exactly over the Hermite elements:

.. math::

   \int_0^L EI(x)\,w''\,v''\,dx = \omega^2 \int_0^L \rho A(x)\,w\,v\,dx .

What do its modes look like?
"""

from __future__ import annotations

import femimpact as fi


def main(elements: int = 24) -> tuple[fi.Structure, fi.System, fi.system.Modes]:
    """Structure, system and four modes."""
    material = {"young_modulus": 70e9, "density": 2700.0}
    foot = fi.Segment(length=0.08, width=0.025, thickness=1.6e-3, name="foot", **material)
    blade = fi.Segment(
        0.15, width=0.025, thickness=1.6e-3, end_width=0.018, end_thickness=8e-4, name="blade", **material
    )
    structure = fi.Structure(fi.Beam([foot, blade]))
    system = fi.assemble(structure, elements=elements)
    return structure, system, fi.solve_modes(system, count=4)


if __name__ == "__main__":
    structure, system, modes = main()
    print("natural frequencies (Hz):", modes.natural_frequency.round(2))
    axes = fi.figures.mode_shapes(system, modes, structure=structure)
    print("wrote", fi.figures.save_figure(axes, "tapered_blade.png"))
