r"""
Where does the energy go?
=========================

The work of the base is stored in beam, ball and walls, or lost in the beam's damping and in impacts:

.. math::

   W = E_\mathrm{kinetic} + E_\mathrm{strain} + E_\mathrm{ball} + E_\mathrm{contact}
   + L_\mathrm{structure} + L_\mathrm{contact} .

Every term is computed on its own, so that what is left of the balance is an error of the computation. How much of the
work do the impacts take at the resonance, and how large is that error?
"""

from __future__ import annotations

import femimpact as fi


def main(duration: float = 20.0) -> fi.response.Response:
    """One run at the resonance."""
    beam = fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    wall = fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
    ball = fi.Impactor("ball", at="tip", mass=3.4e-3, gap=4e-3, contact=wall)
    box, damping = fi.PointMass("box", at="tip", mass=0.023), fi.Rayleigh(ratio=0.0029, modes=(1, 2))
    system = fi.reduce(fi.assemble(fi.Structure(beam, [box], [ball], damping), elements=40), modes=8)
    return fi.integrate(system, fi.Sine(amplitude=0.2e-3, frequency=5.0), fi.EventDriven(), duration)


if __name__ == "__main__":
    run = main()
    share = run.energy.contact_loss[-1] / run.energy.work[-1]
    print(f"lost in impacts: {100 * share:.0f} % of the work; unaccounted for: {run.energy.residual:.1e}")
    print("wrote", fi.figures.save_figure(fi.figures.energies(run), "energy_ledger.png"))
