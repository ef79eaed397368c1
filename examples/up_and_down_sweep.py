r"""
Where does a beam between walls jump?
=====================================

A slow sweep up, and one down that goes on from where the first one ended,

.. math::

   \mathbf M \ddot{\mathbf u} + \mathbf C \dot{\mathbf u} + \mathbf K \mathbf u
   = -\mathbf M \mathbf r\, \ddot u_b + \mathbf b F,
   \qquad u_b = \delta \sin 2\pi f (t - t_0),

with the force F of walls 8 mm from the tip. They stiffen the beam once it reaches them: the response curve leans to
higher frequencies, and over a band two steady motions are stable, one with impacts and one without. Each dwell of 150
base cycles begins at :math:`t_0` with the final state of the dwell before it. The way up keeps to the motion with
impacts, the way down to the one without, until that motion ends. A hollow dot is a value of one start: the motion is
not periodic.
"""

from __future__ import annotations

import math

import numpy as np

import femimpact as fi

BEAM = fi.Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
WALLS = fi.Stop("walls", "tip", 8e-3, fi.KelvinVoigt(restitution=0.6, contact_time=0.02))
BOX = fi.PointMass("box", "tip", 0.02290976)
FREQUENCIES = np.linspace(5.0, 6.6, 17)


def main(frequencies=FREQUENCIES, cycles=150):
    """Model, peaks of the tip (m) up and down, by frequency (Hz), and which are one start's, (2, frequencies)."""
    structure = fi.Structure(BEAM, masses=[BOX], stops=[WALLS], damping=fi.Rayleigh(ratio=0.0029, modes=(1, 2)))
    system, state, peaks, one = fi.reduce(fi.assemble(structure, elements=20), modes=3), fi.State(), [], []
    for f in (*frequencies, *frequencies[::-1]):
        base = fi.Sine(0.2037e-3, f, phase=-2.0 * math.pi * f * state.time)
        run = fi.integrate(system, base, fi.EventDriven(), cycles / f, fi.Recorder("tip"), state)
        peaks, state = [*peaks, run.steady.peak[0]], run.final_state
        one.append(run.steady.steadiness[0] != "periodic")
    up, down = np.split(np.array(peaks), 2)
    return system, up, down[::-1], np.array([one[: up.size], one[: up.size - 1 : -1]])


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    _, *peaks, one = main()
    plt.rcParams.update(fi.figures.STYLE)
    axes = plt.figure(layout="constrained").subplots()
    for peak, start, name, mark in zip(peaks, one, ("way up", "way down"), "^v", strict=True):
        (line,) = axes.plot(FREQUENCIES, 1e3 * peak, f"{mark}-", label=name)
        axes.plot(FREQUENCIES[start], 1e3 * peak[start], f"w{mark}", markeredgecolor=line.get_color())
    axes.axhline(8.0, color="0.5", linestyle="--", linewidth=1.0, label="walls")
    axes.set(xlabel="frequency of the base (Hz)", ylabel="peak of the tip (mm)")
    axes.legend(frameon=False)
    print("wrote", fi.figures.save_figure(axes, "up_and_down_sweep.png"))
