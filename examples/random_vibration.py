r"""Random vibration with a ball
============================

How much does a ball take out of random vibration? 60 s of flat density from 5 to 100 Hz at 0.001 g^2/Hz.

.. math:: \ddot u_b = \sum_k \sqrt{2 S \, \Delta f} \cos(2 \pi f_k t + \varphi_k)

The figure is the spectral density of the stress at the root with and without the ball, and its rms.
"""

import femimpact as fi

G = 9.80665
BEAM = fi.Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
BALL = fi.Impactor("ball", at="tip", mass=3.43e-3, gap=4e-3, contact=fi.Rigid(restitution=0.6))
STRUCTURE = fi.Structure(
    BEAM, [fi.PointMass("box", "tip", 0.02290976)], [BALL], fi.Rayleigh(ratio=0.0029, modes=(1, 2))
)


def main(duration=60.0, modes=4):
    """Runs without and with the ball, by name."""
    system = fi.reduce(fi.assemble(STRUCTURE, elements=20), modes=modes)
    base = fi.RandomBase([(5.0, 1e-3 * G**2), (100.0, 1e-3 * G**2)], duration, seed=1)
    record = fi.Recorder(channels=("tip", "root.surface_stress"), interval=1e-3)
    systems = {"without ball": fi.without_impactors(system), "with ball": system}
    return {name: fi.integrate(one, base, fi.EventDriven(), duration, record) for name, one in systems.items()}


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    axes = plt.figure(figsize=(8.0, 4.4), layout="constrained").subplots()
    for name, run in main().items():
        fi.figures.spectrum(run, "root.surface_stress", highest=100.0, ax=axes)
        rms = 1e-6 * (run["root.surface_stress"] ** 2).mean() ** 0.5
        axes.get_lines()[-1].set_label(f"{name}: rms {rms:.2f} MPa")
    axes.legend()
    fi.figures.save_figure(axes, "random_vibration.png")
