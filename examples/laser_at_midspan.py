r"""A laser at mid-beam
===================

What does a laser at mid-beam say of the tip? The published sweep without and with ball, read as it was measured.

.. math:: w_\mathrm{tip} = w_\mathrm{mid} \, \phi_1(\mathrm{tip})/\phi_1(\mathrm{mid})

The laser stands at mid-beam, for its range of 20 mm to either side does not hold the tip, and the first mode carries
its reading there. Without the ball only that mode moves; with it impacts excite the others, which the factor
multiplies too.
"""

import matplotlib.pyplot as plt
import numpy as np

import femimpact as fi

BEAM = fi.Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
BALL = fi.Impactor("ball", "tip", 3.43e-3, 4e-3, fi.KelvinVoigt(restitution=0.78, contact_time=2e-3))
BOX, DAMPING = fi.PointMass("box", "tip", 0.02290976), fi.Rayleigh(ratio=0.0029, modes=(1, 2))
FREQUENCIES = np.linspace(4.6, 5.6, 21)
LASER = fi.Laser("mid", range=40e-3, noise=10e-6, sample_rate=1000.0)


def main(frequencies=FREQUENCIES, cycles=600, laser=LASER):
    """Peaks of the tip (m) over the last third of each run, true and by the laser, by name."""
    system, found = fi.reduce(fi.assemble(fi.Structure(BEAM, [BOX], [BALL], DAMPING), elements=20), modes=6), {}
    for name, one in {"without ball": fi.without_impactors(system), "with ball": system}.items():
        for f in frequencies:
            record = fi.Recorder(("tip", "mid"), interval=1e-3, start=2 / 3 * cycles / f)
            run = fi.integrate(one, fi.Sine(0.2037e-3, f), fi.EventDriven(), cycles / f, record)
            read = fi.signals.extrapolate(one, laser.measure(run, seed=1), "tip")
            found.setdefault(name, []).append([abs(run["tip"]).max(), abs(read.displacement).max(), read.clipped])
    return frequencies, {name: np.array(rows).T for name, rows in found.items()}


if __name__ == "__main__":
    frequencies, curves = main()
    for (name, (true, read, clipped)), colour in zip(curves.items(), fi.figures.COLOURS, strict=False):
        k, m = np.argmax(true), np.argmax(read)
        print(f"{name}: {1e3 * true[k]:.2f} mm at {frequencies[k]:.2f} Hz, by the laser {1e3 * read[m]:.2f} mm at "
              f"{frequencies[m]:.2f} Hz; {100 * clipped.max():.2g} % clipped")  # fmt: skip
        plt.semilogy(frequencies, 1e3 * true, color=colour, label=f"{name}: tip")
        plt.semilogy(frequencies, 1e3 * read, "--", color=colour, label=f"{name}: laser at mid-beam")
    plt.gca().set(xlabel="base frequency (Hz)", ylabel="largest displacement of the tip (mm)")
    plt.legend()
    fi.figures.save_figure(plt.gca(), "laser_at_midspan.png")
