r"""
A measured motion of the base
=============================

What does a measured motion of the base do to the beam, and how much of it does the ball take away?

The base's acceleration :math:`a(t)` comes from a file of two columns, time (s) and acceleration (m/s^2). Between
samples it is straight, so that velocity and displacement of the base are its exact integrals and the relative motion

.. math::

   \mathbf M \ddot{\mathbf u} + \mathbf C \dot{\mathbf u} + \mathbf K \mathbf u
   = -\mathbf M \mathbf r\, a(t) + \mathbf b F,
   \qquad m\,(\ddot y + a(t)) = -F

has a closed form between impacts. The file of this example is a sweep over 12 s from 4 to 6 Hz. A file from an
accelerometer takes its place, with ``scale=9.80665`` where it is in g, and ``detrend="line"`` where the sensor has an
offset or drifts.
"""

from __future__ import annotations

from pathlib import Path

import femimpact as fi

FILE = Path(__file__).with_name("base_acceleration.csv")


def main(path=FILE) -> dict[str, fi.response.Response]:
    """The run without and with the ball."""
    base = fi.RecordedBase.from_csv(path)
    box, wall = fi.PointMass("box", at="tip", mass=0.023), fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
    ball = fi.Impactor("ball", at="tip", mass=3.4e-3, gap=2e-3, contact=wall)
    beam = fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    damping = fi.Rayleigh(ratio=0.0029, modes=(1, 2))
    system = fi.reduce(fi.assemble(fi.Structure(beam, [box], [ball], damping), elements=20), modes=3)
    systems = {"without ball": fi.without_impactors(system), "with ball": system}
    return {name: fi.integrate(s, base, fi.EventDriven(), duration=base.duration) for name, s in systems.items()}


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    plt.rcParams.update(fi.figures.STYLE)
    axes = plt.figure(figsize=(9.0, 4.0), layout="constrained").subplots()
    for name, response in main().items():
        axes.plot(response.time, 1e3 * response["tip"], label=name)
    axes.set(xlabel="time (s)", ylabel="tip relative to the base (mm)")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False)
    print("wrote", fi.figures.save_figure(axes, "base_from_csv.png"))
