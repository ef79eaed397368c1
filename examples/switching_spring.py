r"""
What do the printed equations do?
=================================

The paper couples the ball by a spring on the full relative displacement x, chosen by the state before the step, with
the step :math:`\Delta t = 1/(20 f_1)`, which is 9.4 ms:

.. math::

   F = k\,x, \qquad k = k_I \text{ if } x > d_+ \text{ or } x < -d_- \text{ one step earlier, else } k_{I0} .

The law is a function of x and has a potential. So everything by which kinetic, strain and contact energy and the losses
fail to balance the work of the base is energy that the late decision and the coarse step create or destroy. The audit
shows it at the paper's step, at one that resolves the contact, and for a Kelvin-Voigt contact of the same stiffness.
"""

from __future__ import annotations

import dataclasses

import femimpact as fi
from femimpact.app.demo import paper_study

PAPER_STEP = 1.0 / (20.0 * 5.30)


def main(stiffness: float = 1e3, duration: float = 60.0) -> dict[str, fi.response.Response]:
    """One run of each law at 5.3 Hz, by the law and its step."""
    structure, spring = paper_study().structure, fi.contact.SwitchingSpring(free_stiffness=0.0, stiffness=stiffness)
    cases = {"paper": (spring, PAPER_STEP), "fine step": (spring, None)}
    cases["Kelvin-Voigt"] = (fi.KelvinVoigt(stiffness=stiffness, restitution=0.8), None)
    runs = {}
    for name, (law, step) in cases.items():
        ball = dataclasses.replace(structure.impactors[0], contact=law)
        system = fi.reduce(fi.assemble(dataclasses.replace(structure, impactors=(ball,)), elements=40), modes=8)
        method = fi.Newmark(dt=step or fi.recommended_step(system), allow_coarse_step=True, divergence_limit=1e9)
        runs[name] = fi.integrate(system, fi.Sine(0.2037e-3, 5.3), method, duration, fi.Recorder("tip"))
    return runs


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    runs = main()
    plt.rcParams.update(fi.figures.STYLE)
    figure, axes = plt.subplots(1, 3, figsize=(15.0, 4.5), layout="constrained")
    for panel, (name, run) in zip(axes, runs.items(), strict=True):
        panel.plot(run.time, 1e3 * run["tip"], linewidth=0.5)
        title = f"{name}\nenergy unaccounted for / put in: {run.energy.residual:.1g}"
        panel.set(title=title, xlabel="time (s)", ylabel="tip (mm)")
    print("wrote", fi.figures.save_figure(figure, "switching_spring.png"))
