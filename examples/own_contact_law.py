r"""A contact law of one's own: a wall lined with felt, soft at first and hard when it is pressed flat.

    N(p, p') = k_1 p + k_3 p^3, times 1 + 0.4 p'/v_0 on the way in and back,

with v_0 the approach speed at the start of each contact. It is a plain Python function of three floats; the time loop
compiles it and calls it like its own laws. What does the lining do to the force, beside the bare Kelvin-Voigt wall?
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


def main(duration: float = 30.0) -> dict[str, fi.Response]:
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
    for name, response in main().items():
        pair = response.system.contacts[0]
        alone = fi.collide(pair.law, pair.effective_mass, 0.2)
        print(
            f"{name}: at 0.2 m/s restitution {alone.restitution:.3f}, contact time {1e3 * alone.contact_time:.3g} ms, "
            f"peak force {alone.peak_force:.3g} N; in the run peak force {response.statistics.peak_force:.3g} N, "
            f"tip rms {1e3 * response.steady.rms[0]:.3g} mm, energy residual {response.energy.residual:.1e}"
        )
