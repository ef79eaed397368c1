r"""
A ball that comes to rest on its wall
=====================================

Under gravity a ball bounces on a rigid wall with restitution e. Each bounce is shorter than the one before by the
factor e, so that infinitely many of them end after

.. math::

   t = \frac{2 v}{g}\,(1 + e + e^2 + \dots) = \frac{2 v}{g\,(1 - e)} ,

v the speed after the first impact. From then on ball and wall move together: a sticking phase, which ends when the
contact force changes its sign. When does the base, moving faster and faster, throw the ball off again?
"""

from __future__ import annotations

import numpy as np

import femimpact as fi


def main(frequency: float = 12.0, acceleration: float = 14.0, duration: float = 1.0) -> fi.response.Response:
    """A ball in a stiff box on a base whose acceleration (m/s^2) exceeds that of gravity."""
    beam = fi.Beam.uniform(length=0.05, width=0.020, thickness=1e-2, young_modulus=70e9, density=2700)
    ball = fi.Impactor("ball", at="tip", mass=3.4e-3, gap=4e-3, contact=fi.Rigid(restitution=0.3))
    structure = fi.Structure(beam, impactors=[ball], damping=fi.Rayleigh(0.2, modes=(1, 2)), gravity=-9.81)
    system = fi.reduce(fi.assemble(structure, elements=10), modes=1)
    base = fi.Sine(acceleration / (2 * np.pi * frequency) ** 2, frequency)
    return fi.integrate(system, base, fi.EventDriven(), duration, fi.Recorder("ball", interval=1e-3))


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    run = main()
    plt.rcParams.update(fi.figures.STYLE)
    axes = plt.figure(figsize=(9.0, 4.0), layout="constrained").subplots()
    axes.plot(run.time, 1e3 * run["ball"], label="ball")
    ends = np.nan_to_num(run.sticking["end"], nan=run.time[-1])
    for start, end in zip(run.sticking["start"], ends, strict=True):
        axes.axvspan(start, end, color="0.85", label="sticking" if start == run.sticking["start"][0] else None)
    axes.set(xlabel="time (s)", ylabel="ball relative to the base (mm)")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False)
    print("wrote", fi.figures.save_figure(axes, "sticking_ball.png"))
