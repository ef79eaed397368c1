r"""
How large is the stress at the root?
====================================

The surface stress at the clamped root follows from the curvature of the beam there, with h the thickness:

.. math::

   \sigma = -\tfrac{1}{2} E\,h\,w''(0, t) .

The ball halves the displacement of the tip. Does it halve the stress, too? An impact excites the higher modes, which
bend the root more for the same displacement of the tip.
"""

from __future__ import annotations

import femimpact as fi


def main(duration: float = 60.0) -> dict[str, fi.response.Response]:
    """The last 2 s of runs at the resonance of the beam alone, without and with the ball."""
    beam = fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    wall = fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
    ball = fi.Impactor("ball", at="tip", mass=3.4e-3, gap=4e-3, contact=wall)
    box, damping = fi.PointMass("box", at="tip", mass=0.023), fi.Rayleigh(ratio=0.0029, modes=(1, 2))
    system = fi.reduce(fi.assemble(fi.Structure(beam, [box], [ball], damping), elements=40), modes=8)
    base = fi.Sine(amplitude=0.1e-3, frequency=fi.without_impactors(system).first_frequency)
    record = fi.Recorder(channels=("tip", "root.surface_stress"), interval=2e-4, start=duration - 2.0)
    cases = {"without ball": fi.without_impactors(system), "with ball": system}
    return {name: fi.integrate(case, base, fi.EventDriven(), duration, record) for name, case in cases.items()}


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    plt.rcParams.update(fi.figures.STYLE)
    figure, axes = plt.subplots(2, 1, figsize=(9.0, 6.0), layout="constrained", sharex=True)
    for name, run in main().items():
        axes[0].plot(run.time, 1e3 * run["tip"], label=name)
        axes[1].plot(run.time, 1e-6 * run["root.surface_stress"])
    axes[0].set_ylabel("tip (mm)")
    axes[1].set(xlabel="time (s)", ylabel="stress at the root (MPa)")
    axes[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False)
    print("wrote", fi.figures.save_figure(figure, "root_stress.png"))
