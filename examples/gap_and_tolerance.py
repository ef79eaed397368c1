r"""
Which gap, and how wrong may it be?
===================================

A beam, a base level, and at most 5 g of ball: the heaviest ball takes most. Free are the gap :math:`d` to either wall
and the restitution :math:`e`,

.. math::

   \mathbf M \ddot{\mathbf u} + \mathbf C \dot{\mathbf u} + \mathbf K \mathbf u = -\mathbf M \mathbf r\,\ddot u_b, \quad
   \ddot y = -\ddot u_b, \quad |y - \mathbf b^T \mathbf u| < d, \quad v_\mathrm{after} = -e\,v_\mathrm{before},

of which a workshop meets :math:`d` to some tenths of a millimetre and nobody knows :math:`e` to a tenth. Each cell of
the map is the largest motion of the tip at the worst of the frequencies around the resonance: the median over 8 starts
that differ in where the ball lies and how fast it moves. Cells that the starts cannot tell from their neighbours have a
triangle in their corner. What is printed is the worst that any restitution makes of each gap: the smallest is the gap
to choose, and its neighbours say how wrong it may be.
"""

import numpy as np

import femimpact as fi


def main(gaps, restitutions, frequencies, **more):
    """The study at the worst frequency of each gap and restitution."""
    beam = fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    ball = fi.Impactor("ball", at="tip", mass=5e-3, gap=4e-3, contact=fi.Rigid(0.6))
    box, damping = fi.PointMass("box", at="tip", mass=0.023), fi.Rayleigh(ratio=0.0029, modes=(1, 2))
    system = fi.reduce(fi.assemble(fi.Structure(beam, [box], [ball], damping), elements=20), modes=3)
    axes = {"impactor.ball.gap": gaps, "impactor.ball.contact.restitution": restitutions, "base.frequency": frequencies}
    found = fi.parameter_study(system, axes, ["peak"], excitation=fi.Sine(0.2e-3, 5.0), starts=8, **more)
    return found.isel({"base.frequency": found["peak"].argmax("base.frequency")})


if __name__ == "__main__":
    worst = main(1e-3 * np.arange(1, 11), np.linspace(0.3, 0.8, 6), np.linspace(4.7, 5.6, 13))
    drawn = fi.figures.study(worst, "peak", title="ball of 5 g, base 0.2 mm, worst of 4.7 to 5.6 Hz")
    fi.figures.save_figure(drawn, "gap_and_tolerance.png")
    print(worst["peak"].max("impactor.ball.contact.restitution").to_pandas())
