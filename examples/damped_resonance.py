r"""
How much does a ball damp a cantilever?
=======================================

A cantilever with a box at its tip is shaken through its first resonance. In the box a ball moves freely between two
walls 4 mm from it:

.. math::

   \mathbf M \ddot{\mathbf u} + \mathbf C \dot{\mathbf u} + \mathbf K \mathbf u
   = -\mathbf M \mathbf r\, \ddot u_b + \mathbf b F,
   \qquad m\,(\ddot y + \ddot u_b) = -F, \qquad F = F(y - \mathbf b^T \mathbf u).

The response curve of the tip without and with the ball is the shortest complete script. Dots are motions that do not
repeat: the value is that of this start.
"""

from __future__ import annotations

import numpy as np

import femimpact as fi


def main(points: int = 301, cycles: int = 600) -> dict[str, fi.sweep.FrequencyResponse]:
    """Response curves without and with the ball."""
    wall = fi.KelvinVoigt(restitution=0.8, contact_time=2e-3)
    structure = fi.Structure(
        beam=fi.Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700),
        masses=[fi.PointMass("box", at="tip", mass=0.02290976)],
        impactors=[fi.Impactor("ball", at="tip", mass=3.43e-3, gap=4e-3, contact=wall)],
        damping=fi.Rayleigh(ratio=0.0029, modes=(1, 2)),
    )
    system = fi.reduce(fi.assemble(structure, elements=40), modes=8)
    cases = {"without ball": fi.without_impactors(system), "with ball": system}
    frequencies = np.linspace(4.0, 6.0, points)
    return {
        name: fi.frequency_sweep(case, 0.2037e-3, frequencies, fi.EventDriven(), cycles) for name, case in cases.items()
    }


if __name__ == "__main__":
    curves = main()
    for name, curve in curves.items():
        print(f"{name}: peak {1e3 * curve.peak_amplitude:.1f} mm at {curve.peak_frequency:.2f} Hz")
    print("wrote", fi.figures.save_figure(fi.figures.response_curve(curves), "damped_resonance.png"))
