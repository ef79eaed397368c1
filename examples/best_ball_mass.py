r"""
How heavy should the ball be?
=============================

The base shakes the beam through its resonance; a ball of mass :math:`m` in a box of clearance :math:`d` takes energy
from it,

.. math::

   \mathbf M \ddot{\mathbf u} + \mathbf C \dot{\mathbf u} + \mathbf K \mathbf u
   = -\mathbf M \mathbf r\, \ddot u_b + \mathbf b F,
   \qquad m\,(\ddot y + \ddot u_b) = -F .

A ball without mass changes nothing, for its force goes to zero with :math:`m`. A heavier one takes more at each impact,
until the largest motion of the sweep falls no further: the second panel shows from which mass on. A filled dot there is
one start's value, as its motion is not periodic.
"""

from __future__ import annotations

import numpy as np

import femimpact as fi

MASSES = 1e-3 * np.array([0.5, 1, 1.5, 2, 3, 4, 6, 8, 12])


def main(masses=MASSES, points=51, cycles=300) -> list[fi.sweep.FrequencyResponse]:
    """The response curve without the ball, and with a ball of each mass (kg)."""
    beam = fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    box = fi.PointMass("box", at="tip", mass=0.023)
    wall = fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
    curves = []
    for balls in [[], *([fi.Impactor("ball", "tip", mass, gap=4e-3, contact=wall)] for mass in masses)]:
        structure = fi.Structure(beam, [box], balls, fi.Rayleigh(ratio=0.0029, modes=(1, 2)))
        system = fi.reduce(fi.assemble(structure, elements=20), modes=3)
        curves.append(fi.frequency_sweep(system, 0.2e-3, np.linspace(4.3, 5.8, points), fi.EventDriven(), cycles))
    return curves


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    curves = main()
    plt.rcParams.update(fi.figures.STYLE)
    figure, axes = plt.subplots(1, 2, figsize=(13.0, 5.0), layout="constrained")
    fi.figures.response_curve({"without ball": curves[0], "ball of 3 g": curves[5]}, ax=axes[0])
    rms, one = np.array([[1e3 * curve.rms.max(), curve.is_sample[curve.rms.argmax()]] for curve in curves[1:]]).T
    axes[1].semilogy(1e3 * MASSES, rms, "oC0-", 1e3 * MASSES[one == 0], rms[one == 0], "ow", markeredgecolor="C0")
    axes[1].set_yticks([1, 2, 5, 10], ["1", "2", "5", "10"])
    axes[1].set(xlabel="mass of the ball (g)", ylabel="largest rms of the tip (mm)", title="filled: one start's value")
    print("wrote", fi.figures.save_figure(figure, "best_ball_mass.png"))
