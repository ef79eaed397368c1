r"""
Two starts, two motions
=======================

A run starts at rest relative to the base or at rest in the inertial frame:

.. math::

   \dot{\mathbf u} = 0, \; \dot y = 0 \qquad \text{or} \qquad
   \dot{\mathbf u} = -\mathbf r\,\dot u_b(0), \; \dot y = -\dot u_b(0) .

In the first the ball drifts at once, at the speed that the base had. In the second it stays where it is until the
beam's motion exceeds the gap. At some frequencies the two end in different steady motions. At which?
"""

from __future__ import annotations

import numpy as np

import femimpact as fi

STARTS = {"base": "at rest relative to the base", "space": "at rest in the inertial frame"}


def main(points: int = 61, cycles: int = 300) -> dict[str, fi.sweep.FrequencyResponse]:
    """The response curve from each start."""
    beam = fi.Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    wall = fi.KelvinVoigt(restitution=0.78, contact_time=2e-3)
    ball = fi.Impactor("ball", at="tip", mass=3.43e-3, gap=4e-3, contact=wall)
    box, damping = fi.PointMass("box", at="tip", mass=0.02290976), fi.Rayleigh(ratio=0.0029, modes=(1, 2))
    system = fi.reduce(fi.assemble(fi.Structure(beam, [box], [ball], damping), elements=20), modes=4)
    frequencies = np.linspace(4.6, 5.8, points)
    return {
        words: fi.frequency_sweep(
            system, 0.2037e-3, frequencies, fi.EventDriven(), cycles, initial=fi.State.at_rest(frame)
        )
        for frame, words in STARTS.items()
    }


if __name__ == "__main__":
    axes = fi.figures.response_curve(main())
    print("wrote", fi.figures.save_figure(axes, "two_starts.png"))
