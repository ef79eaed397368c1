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

The motion with the ball does not repeat; its values are medians over starts at other places and speeds of the ball.
"""

from dataclasses import replace

import numpy as np

import femimpact as fi

MASS, LEVEL = 3.43e-3, 0.2e-3


def cantilever(shift=0.0, **dampers):
    """The reference beam, undamped frequencies off by a share, with impactors or absorbers."""
    modulus = 70e9 * (1.0 + shift) ** 2
    beam = fi.Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=modulus, density=2700)
    box, damping = fi.PointMass("box", at="tip", mass=0.02290976), fi.Rayleigh(ratio=0.0029, modes=(1, 2))
    return fi.Structure(beam, [box], damping=damping, **dampers)


def amplification(structure, levels, span, **more):
    """Largest peak of the tip over the frequencies of a sine of the base, over its amplitude (1), at each level."""
    system = fi.reduce(fi.assemble(structure, elements=20), modes=3)
    frequencies = fi.solve_modes(system, 1).natural_frequency[0] * span
    axes = {"base.amplitude": list(levels), "base.frequency": frequencies}
    found = fi.parameter_study(system, axes, ["peak"], excitation=fi.Sine(LEVEL, 5.0), **more)
    return found["peak"].max("base.frequency").values / np.asarray(levels)


def main(levels, shifts, starts=5, points=31, cycles=300):
    """Absorber, and amplifications by damper: over levels with the ball, over shifts with each."""
    near, wide = np.linspace(0.85, 1.15, points), np.linspace(0.7, 1.3, 4 * points - 3)
    ball = fi.Impactor("ball", at="tip", mass=MASS, gap=4e-3, contact=fi.Rigid(0.6))
    absorber = fi.tuned_absorber(cantilever(), MASS, at="tip")
    light = replace(absorber, damping=0.1 * absorber.damping)
    chaotic = {"span": near, "starts": starts, "cycles": cycles}
    by_level = amplification(cantilever(impactors=[ball]), levels, **chaotic)
    by_shift = {"ball": [amplification(cantilever(s, impactors=[ball]), [LEVEL], **chaotic)[0] for s in shifts]}
    for name, body in (("absorber", absorber), ("absorber, a tenth of its dashpot", light)):
        by_shift[name] = [
            amplification(cantilever(s, absorbers=[body]), [LEVEL], span=wide, cycles=2 * cycles)[0] for s in shifts
        ]
    return absorber, by_level, {name: np.array(values) for name, values in by_shift.items()}


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    levels, shifts = np.geomspace(2e-5, 1e-3, 18), np.linspace(-0.3, 0.3, 25)
    absorber, by_level, by_shift = main(levels, shifts)
    modes = fi.solve_modes(fi.assemble(cantilever(), elements=20), 1)
    shape = fi.assemble(cantilever(), elements=20).point_row("tip") @ modes.vectors[:, 0]
    bare = float(modes.participation_factor[0] * shape / (2.0 * modes.damping_ratio[0]))
    print(absorber)
    print(f"no damper: {bare:.0f} times the base; ball from {by_level.min():.1f} to {by_level.max():.1f}")
    for name, values in by_shift.items():
        within = values[np.abs(shifts) < 0.101]
        print(f"{name}: {values[shifts.size // 2]:.1f}, within 10 % {within.min():.1f} to {within.max():.1f}")
    with plt.rc_context(fi.figures.STYLE):
        figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained", sharey=True)
        for colour, dashes, (name, values) in zip(fi.figures.COLOURS, ("-", "-", "--"), by_shift.items()):
            same = by_level if name == "ball" else np.full(levels.size, values[shifts.size // 2])
            left.plot(1e3 * levels, same, dashes, color=colour, label=name)
            right.plot(100.0 * shifts, values, dashes, color=colour)
        for axis in (left, right):
            axis.axhline(bare, color="grey", linewidth=1.0, label="no damper")
        right.axvspan(-10.0, 10.0, color="#eeeeee", zorder=0)
        left.set(xscale="log", yscale="log", xlabel="amplitude of the base (mm)", ylim=(2.0, 300.0))
        left.set_ylabel("largest motion of the tip, over that of the base")
        right.set_xlabel(f"first frequency off by (%), base of {1e3 * LEVEL:g} mm")
        left.set_title("the beam that the absorber was made for", loc="left")
        right.set_title("grey: 10 % either way", loc="left")
        figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    print("wrote", fi.figures.save_figure(figure, "absorber_or_ball.png"))
