r"""
Which clearance, which restitution?
===================================

Which clearance and which restitution damp the resonance of the beam most? Between impacts the beam and its ball obey
linear equations; an impact at a wall turns the relative speed,

.. math::

   \mathbf M \ddot{\mathbf u} + \mathbf C \dot{\mathbf u} + \mathbf K \mathbf u
   = -\mathbf M \mathbf r\, \ddot u_b, \quad
   \ddot y = -\ddot u_b, \quad |y - \mathbf b^T \mathbf u| < d, \quad v_\mathrm{after} = -e\,v_\mathrm{before},

in which the clearance d (to either wall) and the restitution e are free. The map shows the largest rms of the tip over
the frequencies around the resonance, over that without the ball. Doubling d and the base's amplitude doubles the motion
and leaves the map as it is: only their ratio matters. A star is at the values of one start, as the motion is not
periodic: another start has another value.
"""

from __future__ import annotations

import numpy as np
import xarray

import femimpact as fi

TITLE = "largest rms of the tip, with over without the ball"
GAPS, RESTITUTIONS = 1e-3 * np.array([1, 2, 3, 4, 6, 8, 10, 12]), np.linspace(0.1, 0.9, 9)


def main(gaps=GAPS, restitutions=RESTITUTIONS, amplitude=0.2e-3, cycles=200) -> tuple[np.ndarray, np.ndarray]:
    """Largest rms of the tip with the ball over that without it, (gaps, restitutions), and where it is one start's."""
    beam = fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    box = fi.PointMass("box", at="tip", mass=0.023)

    def largest_rms(*balls: fi.Impactor) -> tuple[float, bool]:
        structure = fi.Structure(beam, [box], balls, fi.Rayleigh(ratio=0.0029, modes=(1, 2)))
        system = fi.reduce(fi.assemble(structure, elements=20), modes=3)
        frequencies = np.linspace(4.6, 5.6, 21)
        curve = fi.frequency_sweep(system, amplitude, frequencies, fi.EventDriven(), cycles)
        return curve.rms.max(), curve.is_sample[curve.rms.argmax()]

    balls = [[fi.Impactor("ball", "tip", 3.4e-3, gap, fi.Rigid(e)) for e in restitutions] for gap in gaps]
    rms, samples = np.moveaxis(np.array([[largest_rms(ball) for ball in row] for row in balls]), -1, 0)
    return rms / largest_rms()[0], samples > 0


if __name__ == "__main__":
    ratio, samples = main()
    cells = {"rms": ratio, "periodic_starts": ~samples, "failed_starts": 0 * samples, "finished": samples | True}
    clearance = ("clearance", GAPS, {"units": "m", "long_name": "clearance to either wall"})
    table = xarray.Dataset(
        {name: (("clearance", "restitution"), values) for name, values in cells.items()},
        {"restitution": RESTITUTIONS, "clearance": clearance},
    )
    axes = fi.figures.study(table.transpose("restitution", "clearance"), "rms", title=TITLE)
    print("wrote", fi.figures.save_figure(axes, "clearance_restitution_map.png"))
