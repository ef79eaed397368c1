r"""A half-sine shock
=================

What stress does a shock of 10 g and 11 ms leave at the root of the beam?

.. math:: \ddot u_b = 10 g \sin(\pi t/T), \quad 0 \le t \le T = 11 \text{ ms}

The peak is exact: it is found between the samples too.
"""

import femimpact as fi

BEAM = fi.Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
STRUCTURE = fi.Structure(
    BEAM, [fi.PointMass("box", "tip", 0.02290976)], damping=fi.Rayleigh(ratio=0.0029, modes=(1, 2))
)


def main(modes=6):
    """The run."""
    system = fi.reduce(fi.assemble(STRUCTURE, elements=20), modes=modes)
    shock = fi.Shock("half-sine", acceleration=10.0 * 9.80665, duration=0.011)
    return fi.integrate(system, shock, fi.EventDriven(), 0.5, fi.Recorder("root.surface_stress", interval=2e-4))


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    run, stress = main(), "root.surface_stress"
    print(peak := run.largest(stress))
    axes = plt.figure(figsize=(8.0, 4.0), layout="constrained").subplots()
    axes.plot(run.time, 1e-6 * run[stress])
    axes.plot(peak.time, 1e-6 * peak.value, "o")
    axes.set(xlabel="time (s)", ylabel="surface stress at the root (MPa)")
    fi.figures.save_figure(axes, "half_sine_shock.png")
