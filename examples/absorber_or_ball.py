r"""
A tuned absorber or a ball?
===========================

For 3.43 g at the tip of the reference beam there are two offers. A ball in a box with gaps of 4 mm needs no spring, and
its effect depends on the level of the base. A body on a spring and a dashpot,

.. math::

   m (\ddot y + \ddot u_b) = -k (y - w) - c (\dot y - \dot w),

is linear, and has to be tuned: `tuned_absorber` finds the :math:`k` and :math:`c` that leave the smallest resonance.
Both are compared by what is left of the largest motion of the tip, at the worst frequency of a sine of the base and
over its amplitude: over the level, and where the first frequency of the beam is not the one that the absorber was made
for. The stiffness :math:`EI` goes with the square of that frequency. A third curve is the absorber with a tenth of its
dashpot: 0.2 of critical damping is not easily had in a part of 3 g.

The motion with the ball does not repeat: its values are medians over starts at other places and speeds of the ball.
Without a damper 184 times the amplitude of the base are left.
"""

from dataclasses import replace

import numpy as np

import femimpact as fi

MASS, LEVEL, NEAR, WIDE = 3.43e-3, 0.2e-3, np.linspace(0.85, 1.15, 31), np.linspace(0.7, 1.3, 121)


def cantilever(shift=0.0, **dampers):
    """The reference beam with impactors or absorbers; its frequencies are off by a share."""
    modulus = 70e9 * (1.0 + shift) ** 2
    beam = fi.Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=modulus, density=2700)
    box, damping = fi.PointMass("box", at="tip", mass=0.02290976), fi.Rayleigh(ratio=0.0029, modes=(1, 2))
    return fi.Structure(beam, [box], damping=damping, **dampers)


def amplification(structure, levels, span, **more):
    """Largest peak of the tip around the first mode over the base's amplitude (1), at each level."""
    system = fi.reduce(fi.assemble(structure, elements=20), modes=3)
    axes = {"base.amplitude": levels, "base.frequency": fi.solve_modes(system, 1).natural_frequency[0] * span}
    found = fi.parameter_study(system, axes, ["peak"], excitation=fi.Sine(LEVEL, 5.0), **more)
    return found["peak"].max("base.frequency") / found["base.amplitude"]


def main(levels, shifts, starts=5, cycles=300):
    """Amplifications over the levels, and at one level over the shifts of the first frequency, by damper."""
    ball, body = fi.Impactor("ball", "tip", MASS, 4e-3, fi.Rigid(0.6)), fi.tuned_absorber(cantilever(), MASS, "tip")
    dampers = {"ball": {"impactors": [ball]}, "absorber": {"absorbers": [body]}}
    dampers["absorber, a tenth of its dashpot"] = {"absorbers": [replace(body, damping=0.1 * body.damping)]}
    by_level, by_shift = {}, {}
    for name, own in dampers.items():
        # what is linear has one answer, from every start, and two broad or narrow peaks
        run = {"cycles": cycles} | ({"span": NEAR, "starts": starts} if name == "ball" else {"span": WIDE})
        by_level[name] = amplification(cantilever(**own), levels, **run)
        by_shift[name] = np.array([float(amplification(cantilever(s, **own), [LEVEL], **run)[0]) for s in shifts])
    return by_level, by_shift


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    plt.rcParams.update(fi.figures.STYLE)
    levels, shifts = np.geomspace(2e-5, 1e-3, 18), np.linspace(-0.3, 0.3, 25)
    by_level, by_shift = main(levels, shifts)
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.4), layout="constrained", sharey=True)
    for name, own in by_shift.items():
        print(name, *(f"{v.min():.1f} to {v.max():.1f}" for v in (by_level[name], own[np.abs(shifts) < 0.101], own)))
        left.loglog(1e3 * levels, by_level[name], label=name)
        right.plot(1e2 * shifts, own)
    right.axvspan(-10.0, 10.0, color="#eeeeee", zorder=0)
    left.set(xlabel="amplitude of the base (mm)", ylabel="largest motion, tip over base", title="as designed")
    right.set(xlabel=f"first frequency off by (%), base {1e3 * LEVEL:g} mm", title="out of tune; grey: 10 %")
    figure.legend(loc="outside lower center", ncols=3)
    print("wrote", fi.figures.save_figure(figure, "absorber_or_ball.png"))
