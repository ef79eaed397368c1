r"""
Two balls in two boxes
======================

How is the work shared between a ball at the tip and one in the middle of the beam? Every ball :math:`j` has its box
at a place of the beam, read by the row :math:`\mathbf b_j`, with its own clearance:

.. math::

   \mathbf M \ddot{\mathbf u} + \mathbf C \dot{\mathbf u} + \mathbf K \mathbf u
   = -\mathbf M \mathbf r\, \ddot u_b + \sum_j \mathbf b_j F_j, \qquad m_j\,(\ddot y_j + \ddot u_b) = -F_j .

The middle moves less than the tip, so that its clearance must be smaller for the ball there to meet its walls. The
table of impacts says what each ball dissipates; the energy ledger, that nothing is missing.
"""

from __future__ import annotations

import femimpact as fi


def main(duration=30.0) -> fi.response.Response:
    """One run at the resonance without balls."""
    boxes = [fi.PointMass("midbox", at="mid", mass=0.01), fi.PointMass("tipbox", at="tip", mass=0.023)]
    wall = fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
    balls = [
        fi.Impactor("middle ball", at="mid", mass=2e-3, gap=1e-3, contact=wall),
        fi.Impactor("tip ball", at="tip", mass=3.4e-3, gap=4e-3, contact=wall),
    ]
    beam = fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    damping = fi.Rayleigh(ratio=0.0029, modes=(1, 2))
    system = fi.reduce(fi.assemble(fi.Structure(beam, boxes, balls, damping), elements=20), modes=4)
    base = fi.Sine(amplitude=0.2e-3, frequency=fi.without_impactors(system).first_frequency)
    record = fi.Recorder(channels=("mid", "tip", "middle ball", "tip ball"))
    return fi.integrate(system, base, fi.EventDriven(), duration, record)


if __name__ == "__main__":
    response = main()
    for name in ("middle ball", "tip ball"):
        own = response.impacts.impactor == name
        print(f"{name}: {own.sum()} impacts, {1e3 * response.impacts.energy_loss[own].sum():.3g} mJ dissipated")
    print("wrote", fi.figures.save_figure(fi.figures.motion(response), "two_balls.png"))
