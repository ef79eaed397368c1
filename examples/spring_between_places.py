r"""
A spring between two places of the beam
=======================================

A spring of stiffness k ties the place :math:`x_1` to the tip. It adds

.. math::

   k\,\bigl(w(x_1) - w(L)\bigr)\,\bigl(v(x_1) - v(L)\bigr)

to the stiffness form. How do the natural frequencies rise with k, and where do they end?
"""

from __future__ import annotations

import numpy as np

import femimpact as fi

STIFFNESSES = np.geomspace(1.0, 1e5, 26)


def main(stiffnesses=STIFFNESSES, place: float = 0.1) -> np.ndarray:
    """Three natural frequencies (Hz) for each stiffness (N/m), (stiffnesses, 3)."""
    beam = fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    frequencies = []
    for stiffness in stiffnesses:
        tie = fi.Spring("tie", at=place, stiffness=stiffness, to="tip")
        system = fi.assemble(fi.Structure(beam, springs=[tie]), elements=20)
        frequencies.append(fi.solve_modes(system, count=3).natural_frequency)
    return np.array(frequencies)


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    plt.rcParams.update(fi.figures.STYLE)
    axes = plt.figure(layout="constrained").subplots()
    for number, frequency in enumerate(main().T, 1):
        axes.loglog(STIFFNESSES, frequency, label=f"mode {number}")
    axes.set(xlabel="stiffness of the spring (N/m)", ylabel="natural frequency (Hz)")
    axes.legend(frameon=False)
    print("wrote", fi.figures.save_figure(axes, "spring_between_places.png"))
