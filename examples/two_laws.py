r"""
Does the contact law matter?
============================

A steel ball on its wall is better described by Hunt and Crossley's law than by a spring with a dashpot,

.. math::

   N = k\,p^{3/2}\,(1 + b\,\dot p), \qquad N = k\,p + c\,\dot p .

The spring and dashpot get the restitution and the contact time that the first law has at one approach speed. At other
speeds the two differ: a dashpot has one restitution and one contact time for all. Does the response curve show that?
"""

from __future__ import annotations

import numpy as np

import femimpact as fi

SPEED, MASS = 0.1, 3.4e-3
"""m/s and kg."""


def laws() -> tuple[fi.HuntCrossley, fi.KelvinVoigt]:
    """Two laws of one restitution and one contact time at `SPEED`."""
    hunt = fi.HuntCrossley(stiffness=1e6, restitution=0.5)
    alone = fi.collide(hunt, MASS, SPEED)
    return hunt, fi.KelvinVoigt(restitution=alone.restitution, contact_time=alone.contact_time)


def main(points=31, cycles=150) -> dict[str, fi.sweep.FrequencyResponse]:
    """Response curve with each law, by the law's name."""
    beam = fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    box = fi.PointMass("box", at="tip", mass=0.023)
    curves = {}
    for law in laws():
        ball = fi.Impactor("ball", at="tip", mass=MASS, gap=4e-3, contact=law)
        structure = fi.Structure(beam, [box], [ball], fi.Rayleigh(ratio=0.0029, modes=(1, 2)))
        system = fi.reduce(fi.assemble(structure, elements=20), modes=3)
        method = fi.Newmark(dt=fi.recommended_step(system))
        curves[law.name] = fi.frequency_sweep(system, 0.2e-3, np.linspace(4.4, 5.6, points), method, cycles)
    return curves


if __name__ == "__main__":
    axes = fi.figures.response_curve(main())
    print("wrote", fi.figures.save_figure(axes, "two_laws.png"))
