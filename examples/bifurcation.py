r"""
Periodic or chaotic: a beam at a stop
=====================================

When does a beam that hits a stop repeat its motion, and when is it chaotic? The tip meets a rigid stop on one side at
:math:`w = d`, and rebounds with :math:`\dot w_\mathrm{after} = -e\,\dot w_\mathrm{before}`. The run is sampled once per
base cycle, at one phase of the base, which is the Poincare section

.. math::

   (w, \dot w)(t_k), \qquad 2\pi f\,t_k = 2\pi k .

A motion that repeats after n cycles leaves n points in it, a chaotic one a cloud. The section over the frequency is the
bifurcation diagram; the phase portrait shows one motion with its section.
"""

from __future__ import annotations

import numpy as np

import femimpact as fi

FREQUENCIES = np.linspace(28.0, 50.0, 221)


def main(frequencies=FREQUENCIES, duration=6.0) -> list[fi.response.Response]:
    """One run at each frequency (Hz)."""
    beam = fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    damping = fi.Rayleigh(ratio=0.02, modes=(1, 2))
    stop = fi.Stop("stop", at="tip", gap=(1e-3, np.inf), contact=fi.Rigid(0.7))
    structure = fi.Structure(beam, stops=[stop], damping=damping)
    system = fi.reduce(fi.assemble(structure, elements=20), modes=2)
    bases = [fi.Sine(amplitude=1e-3, frequency=f) for f in frequencies]
    return fi.integrate(system, bases, fi.EventDriven(), duration, fi.Recorder(channels=("tip", "tip.velocity")))


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    responses = main()
    plt.rcParams.update(fi.figures.STYLE)
    figure, axes = plt.subplots(1, 2, figsize=(13.0, 5.0), layout="constrained")
    fi.figures.bifurcation(responses, "tip", ax=axes[0])
    fi.figures.phase_portrait(responses[90], "tip", cycles=70, ax=axes[1])
    print("wrote", fi.figures.save_figure(figure, "bifurcation.png"))
