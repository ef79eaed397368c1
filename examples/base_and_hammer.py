r"""A hammer beside the shaker
==========================

What does a blow do to a beam that a shaker keeps at resonance, and which of the two feeds the ball's impacts?

.. math::

   \mathbf M \ddot{\mathbf u} + \mathbf C \dot{\mathbf u} + \mathbf K \mathbf u
   = -\mathbf M \mathbf r\, \ddot u_b(t) + \mathbf b_\text{mid} F(t) + \sum_j \mathbf b_j F_j

Both drives act at once, and the energy ledger has the work of each.
"""

import femimpact as fi

BEAM = fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
STRUCTURE = fi.Structure(
    BEAM,
    [fi.PointMass("box", "tip", 0.0229)],
    [fi.Impactor("ball", "tip", mass=3.43e-3, gap=4e-3, contact=fi.Rigid(0.6))],
    damping=fi.Rayleigh(ratio=0.0029, modes=(1, 2)),
)


def main(duration=10.0):
    """The run: the blow falls after five seconds."""
    system = fi.reduce(fi.assemble(STRUCTURE, elements=20), modes=4)
    shaker = fi.Sine(amplitude=0.3e-3, frequency=5.3)
    hammer = fi.HammerBlow("mid", impulse=5e-3, duration=2e-3, begin=5.0, name="hammer")
    return fi.integrate(system, shaker + hammer, fi.EventDriven(), duration, fi.Recorder("tip", interval=2e-3))


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    run = main()
    work = run.energy.work_of
    print({name: f"{1e3 * joules[-1]:.3g} mJ" for name, joules in work.items()})
    axes = plt.figure(figsize=(8.0, 4.0), layout="constrained").subplots()
    for name, joules in work.items():
        axes.plot(run.time, 1e3 * joules, label=name)
    axes.set(xlabel="time (s)", ylabel="work (mJ)")
    axes.legend()
    fi.figures.save_figure(axes, "base_and_hammer.png")
