r"""
A contact law of your own
=========================

A wall lined with felt is soft at first, and hard when it is pressed flat:

.. math::

   N(p, \dot p) = (k_1 p + k_3 p^3)\,\max(1 + 0.4\,\dot p/v_0,\; 0),

with :math:`v_0` the approach speed at the start of each contact. The law is a plain Python function of three floats,
which the time loop calls like its own laws. What does the lining do to the force, beside the bare wall?
"""

from __future__ import annotations

import femimpact as fi

SOFT, HARD = 500.0, 2e10
"""N/m and N/m^3: the cubic term takes over at 0.16 mm."""


def felt(depth: float, rate: float, approach_speed: float) -> float:
    """Normal force, N."""
    if depth <= 0.0:
        return 0.0
    return (SOFT * depth + HARD * depth**3) * max(1.0 + 0.4 * rate / approach_speed, 0.0)


def structure(contact) -> fi.Structure:
    """The beam, box and ball of the reference study with a contact law."""
    return fi.Structure(
        beam=fi.Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700),
        masses=[fi.PointMass("box", at="tip", mass=0.02290976)],
        impactors=[fi.Impactor("ball", at="tip", mass=3.43e-3, gap=4e-3, contact=contact)],
        damping=fi.Rayleigh(ratio=0.0029, modes=(1, 2)),
    )


def main(duration: float = 30.0) -> dict[str, fi.response.Response]:
    """One history at 5.0 Hz with each wall."""
    laws = {
        "felt": fi.CustomLaw(felt, name="felt"),
        "bare": fi.KelvinVoigt(stiffness=1e4, restitution=0.7),
    }
    responses = {}
    for name, law in laws.items():
        system = fi.reduce(fi.assemble(structure(law), elements=20), modes=4)
        method = fi.Newmark(dt=fi.recommended_step(system), contact="energy-consistent")
        responses[name] = fi.integrate(system, fi.Sine(0.2037e-3, 5.0), method, duration, fi.Recorder(every=20))
    return responses


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    responses = main()
    for name, response in responses.items():
        force, rms = response.statistics.peak_force, 1e3 * response.steady.rms[0]
        print(f"{name}: peak force {force:.3g} N, tip rms {rms:.3g} mm, energy residual {response.energy.residual:.1e}")
    plt.rcParams.update(fi.figures.STYLE)
    axes = plt.figure(layout="constrained").subplots()
    for (name, response), mark in zip(responses.items(), "os", strict=True):
        axes.loglog(1e3 * response.impacts["duration"], response.impacts["peak_force"], mark, alpha=0.4, label=name)
    axes.set(xlabel="duration of an impact (ms)", ylabel="its largest force (N)")
    axes.set_xticks([1, 2, 5, 10], ["1", "2", "5", "10"])
    axes.minorticks_off()
    axes.legend(title="wall", frameon=False)
    print("wrote", fi.figures.save_figure(axes, "own_contact_law.png"))
