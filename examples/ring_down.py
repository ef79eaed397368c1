r"""
From a ring-down to a damping curve
===================================

A beam with a ball is bent and released. The energy of a cycle that the ball takes does not grow with the square of the
amplitude :math:`A`, so that the logarithmic decrement :math:`\Lambda = \ln (A_i/A_{i+1})` and the damping ratio

.. math::

   \zeta = \frac{\Lambda}{2\pi}

depend on the amplitude. What is read of it from 8 s of a displacement sensor with noise of 1 % of the first amplitude,
in a file of columns, and how sure is it? The beam alone is read beside it. Its decay is linear: one damped sine has the
whole record for its two numbers.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import xarray

import femimpact as fi


def ring_down(system: fi.System, amplitude: float) -> fi.response.Response:
    """The motion of the first mode from a deflection of the tip (m) on, the ball at rest at its place in the box."""
    start = fi.State.of_mode(system, 1, amplitude)
    return fi.integrate(system, fi.Rest(), fi.EventDriven(), 8.0, fi.Recorder(("tip",), interval=2e-3), initial=start)


def main(amplitude: float = 0.02, noise: float = 0.01, seed: int = 1) -> dict[str, fi.signals.DecayEstimate]:
    """Damping without and with the ball, each from the file of a sensor."""
    box, wall = fi.PointMass("box", at="tip", mass=0.023), fi.Rigid(restitution=0.6)
    ball = fi.Impactor("ball", at="tip", mass=3.0e-3, gap=3e-3, contact=wall)
    beam = fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    damping = fi.Rayleigh(ratio=0.0029, modes=(1, 2))
    system = fi.reduce(fi.assemble(fi.Structure(beam, [box], [ball], damping), elements=20), modes=1)
    found, random = {}, np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        for name, one in {"without ball": fi.without_impactors(system), "with ball": system}.items():
            run = ring_down(one, amplitude)
            tip = run["tip"] + noise * amplitude * random.standard_normal(run.time.size)
            signal = xarray.Dataset({"tip": ("time", tip, {"units": "m"})}, {"time": run.time})
            record = fi.read_record(fi.excitation.write_record(Path(folder) / "tip.csv", signal))
            found[name] = fi.identify_decay(record["time"], record["tip"])
    return found


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    plt.rcParams.update(fi.figures.STYLE)
    axes = plt.figure(figsize=(9.0, 4.8), layout="constrained").subplots(1, 2)
    for ax, (name, estimate) in zip(axes, main().items(), strict=True):
        print(f"{name}: {estimate}")
        fi.figures.decay(estimate, ax=ax)
        ax.set_title(name, loc="right")
    print("wrote", fi.figures.save_figure(axes[0], "ring_down.png"))
