r"""A chirp up and a chirp down
===========================

Does a beam between walls answer a chirp up as it answers one down?

.. math:: u_b = A \sin\varphi, \quad f = \dot\varphi/(2\pi) \text{ from 5.0 to 6.6 Hz or back in 120 s}

The walls stiffen the beam once it reaches them. Up, the motion with impacts goes on to a higher frequency than that at
which it begins on the way down: hysteresis. Beside the chirps stands the stepped sweep, up and then down.
"""

import numpy as np

import femimpact as fi

BEAM = fi.Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
WALLS = fi.Stop("walls", "tip", 8e-3, fi.KelvinVoigt(restitution=0.6, contact_time=0.02))
BOX, DAMPING = fi.PointMass("box", "tip", 0.02290976), fi.Rayleigh(ratio=0.0029, modes=(1, 2))
STRUCTURE = fi.Structure(BEAM, [BOX], stops=[WALLS], damping=DAMPING)


def main(duration=120.0):
    """Frequencies (Hz) and |tip| (m) on the way up and on the way down."""
    system = fi.reduce(fi.assemble(STRUCTURE, elements=20), modes=3)
    chirps = [fi.Chirp(*ends, duration, amplitude=0.2037e-3) for ends in ((5.0, 6.6), (6.6, 5.0))]
    record = fi.Recorder("tip", interval=5e-3)
    runs = fi.integrate(system, chirps, fi.EventDriven(), duration, record)
    return [(chirp.frequency_at(run.time), np.abs(run["tip"])) for chirp, run in zip(chirps, runs, strict=True)]


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    axes = plt.figure(figsize=(8.0, 4.0), layout="constrained").subplots()
    small, steps = fi.reduce(fi.assemble(STRUCTURE, elements=20), modes=3), np.linspace(5.0, 6.6, 33)
    stepped = fi.frequency_sweep(small, 0.2037e-3, steps, fi.EventDriven(), 150, direction="both")
    for (f, tip), name, colour, mark in zip(main(), stepped, fi.figures.COLOURS, "^v", strict=False):
        largest = [1e3 * tip[i : i + 200].max() for i in range(0, tip.size - 200, 40)]
        axes.plot(f[:-200:40], largest, color=colour, label=f"chirp {name}")
        axes.plot(steps, 1e3 * stepped[name].peak, mark, color=colour, label=f"stepped {name}")
    axes.set(xlabel="frequency (Hz)", ylabel="largest tip displacement in 1 s (mm)")
    axes.legend()
    fi.figures.save_figure(axes, "chirps_at_walls.png")
