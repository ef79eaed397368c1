r"""
Which gap for which level of the base?
======================================

The reader's beam carries a ball of mass :math:`m` in a box. Its base moves by :math:`u_b \sin 2\pi f t` at a level
:math:`u_b` that the customer decides, at any frequency of a band. The map shows, over gap :math:`d` and level, the
largest motion of the tip at the worst frequency: the median over 5 starts of

.. math::

   \mathbf M \ddot{\mathbf u} + \mathbf C \dot{\mathbf u} + \mathbf K \mathbf u = -\mathbf M \mathbf r\,\ddot u_b, \quad
   \ddot y = -\ddot u_b, \quad |y - \mathbf b^T \mathbf u| < d, \quad v_\mathrm{after} = -e\,v_\mathrm{before}.

Two lines in closed form stand on it. With :math:`\phi` the first mode at the ball, mass-normalised, :math:`\Gamma` its
participation factor and :math:`\mu = m \phi^2`, two impacts in a cycle that lose little leave the least motion at

.. math:: d^* = \frac{\pi^2\, \Gamma \phi\, u_b}{8\,\mu},

where the impulses of the ball take up all that the base puts in. It is a lower limit of the best gap and the rule for
a first one. Runs of this beam over 28 gaps and 23 frequencies have their best gap at 1.1, 1.2, 1.25 and 1.35 times
:math:`d^*` for restitutions of 0.35, 0.41, 0.46 and 0.52, and at 1.6, 2.1 and 2.9 times for 0.6, 0.7 and 0.8, for
which no closed form is known within 10 %; below it the motion rises steeply. The second line is the level that wakes
a ball which rests in space: the largest absolute displacement of its place without the ball, which grows in
proportion to the level, is then the gap. A ball that moves already does not fall asleep there: below this line the
map, whose balls start with a velocity, is still that of a damper.
"""

import numpy as np

import femimpact as fi

STRUCTURE = fi.Structure(
    fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700),
    [fi.PointMass("box", at="tip", mass=0.023)],
    [fi.Impactor("ball", at="tip", mass=5e-3, gap=3e-3, contact=fi.Rigid(0.5))],
    fi.Rayleigh(ratio=0.0029, modes=(1, 2)),
)
"""The reader's: beam, tip box, ball, restitution and damping."""


def gaps_of_unit_level(system):
    """Best gap of a light loss, and largest gap that wakes a ball at rest in space, over the level of the base."""
    drive = fi.Sine(1e-4, fi.solve_modes(system, 1).natural_frequency[0])
    found = fi.preflight(system, drive, duration=100.0 / drive.frequency, initial=fi.State.at_rest("space"))
    words = ("first gap to try", "beside its gap")
    return [next(row.value for row in found.rows if word in row.what) / drive.amplitude for word in words]


def main(gaps, levels, frequencies, structure=STRUCTURE, **more):
    """Worst of the band over gap and level, and the two lines over the level."""
    system = fi.reduce(fi.assemble(structure, elements=20), modes=3)
    axes = {f"impactor.{structure.impactors[0].name}.gap": gaps, "base.amplitude": levels}
    axes["base.frequency"] = frequencies
    found = fi.parameter_study(system, axes, ["peak"], excitation=fi.Sine(1e-4, 5.0), starts=5, **more)
    worst = found.isel({"base.frequency": found["peak"].argmax("base.frequency")})
    return worst, *(gap * np.asarray(levels) for gap in gaps_of_unit_level(system))


if __name__ == "__main__":
    gaps, levels = np.geomspace(0.5e-3, 16e-3, 14), np.geomspace(0.05e-3, 1e-3, 10)
    worst, light, woken = main(gaps, levels, np.linspace(4.6, 5.6, 9))
    axes = fi.figures.study(worst, "peak", title="worst of the band; ball of 5 g, restitution 0.5")
    axes.add_artist(axes.get_legend())
    for line, style, label in ((light, "-", "best gap of a light loss"), (woken, "--", "largest gap that wakes")):
        inside = (line >= gaps[0]) & (line <= gaps[-1])
        # cells are numbered along both axes
        places = np.interp(np.log(line[inside]), np.log(gaps), np.arange(gaps.size))
        axes.plot(places, np.flatnonzero(inside), style, color="black", linewidth=2.0, label=label)
    axes.legend(loc="upper left")
    fi.figures.save_figure(axes, "design_map.png")
