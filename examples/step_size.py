r"""
Which step does a contact need?
===============================

The contact lasts :math:`T_c`. Newmark's method must resolve it. A run that is exact to rounding, event by event, is the
reference for its error over the step,

.. math::

   \epsilon = \max_t |w_{\Delta t}(t) - w(t)| \,/\, \max_t |w(t)| ,

over a time with some five impacts; later, chaos decides. How much does the energy-consistent contact gain at the same
step?
"""

from __future__ import annotations

import numpy as np

import femimpact as fi

STEPS_PER_CONTACT = np.array([10, 20, 40, 80, 160, 320])
CONTACT_TIME = 2e-3


def main(steps=STEPS_PER_CONTACT, duration: float = 0.8) -> dict[str, np.ndarray]:
    """Error (1) of the tip for each number of steps in a contact, by where the law acts."""
    beam = fi.Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    ball = fi.Impactor("ball", "tip", 3.43e-3, 4e-3, fi.KelvinVoigt(restitution=0.7, contact_time=CONTACT_TIME))
    box, damping = fi.PointMass("box", at="tip", mass=0.02290976), fi.Rayleigh(ratio=0.0029, modes=(1, 2))
    system = fi.reduce(fi.assemble(fi.Structure(beam, [box], [ball], damping), elements=20), modes=4)
    base, times = fi.Sine(0.2037e-3, 5.2), fi.Recorder("tip", interval=CONTACT_TIME / 10)
    exact = fi.integrate(system, base, fi.EventDriven(), duration, times)["tip"]
    errors = {"end": [], "energy-consistent": []}
    for contact, found in errors.items():
        for number in steps:
            method = fi.Newmark(dt=CONTACT_TIME / number, contact=contact, allow_coarse_step=True)
            tip = fi.integrate(system, base, method, duration, fi.Recorder("tip", every=int(number // 10)))["tip"]
            length = min(tip.size, exact.size)
            found.append(np.abs(tip[:length] - exact[:length]).max() / np.abs(exact).max())
    return {name: np.array(found) for name, found in errors.items()}


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    plt.rcParams.update(fi.figures.STYLE)
    axes = plt.figure(layout="constrained").subplots()
    for (name, error), mark in zip(main().items(), "os", strict=True):
        axes.loglog(STEPS_PER_CONTACT, error, f"{mark}-", label=f'contact="{name}"')
    axes.set(xlabel="steps in a contact (1)", ylabel="error of the tip (1)")
    axes.legend(frameon=False)
    print("wrote", fi.figures.save_figure(axes, "step_size.png"))
