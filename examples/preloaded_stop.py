r"""
A beam that rests on a stop
===========================

A cantilever with a box hangs under gravity onto a stop that is placed below it. At rest the stop carries a part of the
weight:

.. math::

   \mathbf K \mathbf u = \mathbf f + \mathbf b F, \qquad F \ge 0, \quad \text{gap} \ge 0, \quad F \cdot \text{gap} = 0 .

The run starts from this static state. With a small motion of the base the beam stays on the stop; with a larger one
it lifts off and comes back in impacts. Where is the border?
"""

from __future__ import annotations

import math

import numpy as np

import femimpact as fi

ACCELERATIONS = np.linspace(1.0, 10.0, 19)
"""Amplitudes of the base's acceleration, m/s^2."""


def main(accelerations=ACCELERATIONS, frequency=12.0, duration=4.0) -> list[fi.response.Response]:
    """One run for each amplitude, from the static state."""
    beam = fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    stop = fi.Stop("stop", at="tip", gap=(math.inf, 4e-3), contact=fi.KelvinVoigt(restitution=0.5, contact_time=5e-3))
    box, damping = fi.PointMass("box", at="tip", mass=0.023), fi.Rayleigh(ratio=0.01, modes=(1, 2))
    structure = fi.Structure(beam, [box], stops=[stop], damping=damping, gravity=-9.81)
    system = fi.reduce(fi.assemble(structure, elements=20), modes=4)
    bases = [fi.Sine(a / (2 * np.pi * frequency) ** 2, frequency) for a in accelerations]
    return fi.integrate(system, bases, fi.EventDriven(), duration, initial=fi.State.static())


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    runs = main()
    plt.rcParams.update(fi.figures.STYLE)
    figure, axes = plt.subplots(1, 2, figsize=(13.0, 4.5), layout="constrained")
    axes[0].plot(ACCELERATIONS, [len(run.impacts) for run in runs], "o-")
    axes[0].set(xlabel="acceleration of the base (m/s$^2$)", ylabel="impacts in 4 s")
    axes[1].plot(runs[-1].time, runs[-1]["contact_force"], linewidth=0.8)
    axes[1].set(xlabel="time (s)", ylabel="force of the stop (N)", title="the largest amplitude")
    print("wrote", fi.figures.save_figure(figure, "preloaded_stop.png"))
