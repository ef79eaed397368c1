r"""Transmissibility in closed form and as measured
===============================================

How far does a ball lower the transmissibility from the base to the tip, and how much of the motion does that number
describe?

.. math:: H_1(f) = S_{xy}/S_{xx}, \quad \gamma^2 = |S_{xy}|^2/(S_{xx} S_{yy})

Without the ball the closed form is exact. With it a transfer function is what random vibration measures at its level.
"""

import numpy as np

import femimpact as fi

G, TIP = 9.80665, "tip.absolute_acceleration"
BEAM = fi.Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
BALL = fi.Impactor("ball", at="tip", mass=3.43e-3, gap=4e-3, contact=fi.Rigid(restitution=0.6))
STRUCTURE = fi.Structure(
    BEAM, [fi.PointMass("box", "tip", 0.02290976)], [BALL], fi.Rayleigh(ratio=0.0029, modes=(1, 2))
)


def main(duration=120.0):
    """Closed form without the ball, and measured with it."""
    system = fi.reduce(fi.assemble(STRUCTURE, elements=20), modes=3)
    base = fi.RandomBase([(3.0, 1e-3 * G**2), (100.0, 1e-3 * G**2)], duration, seed=1)
    record = fi.Recorder(channels=(TIP, "tip.velocity"), interval=2e-3)
    run = fi.integrate(system, base, fi.EventDriven(), duration, record)
    alone = fi.transfer_function(fi.without_impactors(system), np.geomspace(3.0, 100.0, 600), TIP)
    return {"without ball": alone, "with ball": fi.measured_transfer(run, TIP, resolution=0.25)}


if __name__ == "__main__":
    figure = fi.figures.transfer_function(main())
    fi.figures.save_figure(figure, "transmissibility.png")
