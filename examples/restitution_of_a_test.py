r"""
Which restitution does my test have?
====================================

A cantilever with a box at its tip was swept twice: without the ball around its resonance, and with it from 4 to 6 Hz in
steps of 0.1 Hz. The peaks of both tests are all that is known. What are the damping of the beam, the restitution of the
ball and the gap that it really has, and how sure is that?

The bare beam first: one mode,

.. math:: |X(f)| = \frac{s\,f^2}{\sqrt{(f_0^2 - f^2)^2 + (2 \zeta f_0 f)^2}},

is fitted by four lines. Then all cases of a grid of gaps and restitutions are run at the measured frequencies from 8
starts, since the motions are chaotic, and each gets the probability that the measured peaks have there. The map shows
the posterior; the band, where nine of ten peaks of such a test lie. Here the test is a simulated one with 2 % of
noise, each dwell from another start, a gap of 3.7 mm and a restitution of 0.57, which the calibration does not know.
"""

import numpy as np

import femimpact as fi

AMPLITUDE, GAP, RESTITUTION = 0.2037e-3, 3.7e-3, 0.57
BOUNDS = {"impactor.ball.gap": (2e-3, 6e-3), "impactor.ball.contact.restitution": (0.3, 0.9)}


def damper(ratio):
    """The beam with its ball in three modes."""
    beam = fi.Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    ball = fi.Impactor("ball", at="tip", mass=3.43e-3, gap=GAP, contact=fi.Rigid(RESTITUTION))
    box, damping = fi.PointMass("box", at="tip", mass=0.02290976), fi.Rayleigh(ratio=ratio, modes=(1, 2))
    return fi.reduce(fi.assemble(fi.Structure(beam, [box], [ball], damping), elements=40), modes=3)


def simulated_test(around, frequencies, random):
    """Peaks (m) of the bare beam and of the damper with 2 % of noise; each dwell of the damper has another start."""
    system, drive = damper(0.0029), fi.Sine(AMPLITUDE, 5.0)
    bare = fi.frequency_sweep(fi.without_impactors(system), AMPLITUDE, around, fi.EventDriven(), 1500)
    dwells = [
        fi.parameter_study(system, {"base.frequency": [f]}, ["peak"], excitation=drive, cycles=300, seed=10 + i)
        for i, f in enumerate(frequencies.tolist())
    ]
    with_ball = np.array([float(one["peak"][0]) for one in dwells])
    return (peaks * (1.0 + 0.02 * random.standard_normal(peaks.size)) for peaks in (bare.peak, with_ball))


def main(frequencies, starts=8, **more):
    """Damping of the bare beam, and the calibration of the ball."""
    around = np.linspace(5.2, 5.4, 21)
    bare, with_ball = simulated_test(around, frequencies, np.random.default_rng(3))
    # the four lines of the bare beam
    damping = fi.fit_one_pole(around, bare)
    system = damper(damping.ratio)
    drive = fi.Sine(AMPLITUDE, 5.0)
    return damping, fi.calibrate(system, frequencies, with_ball, BOUNDS, excitation=drive, starts=starts, **more)


if __name__ == "__main__":
    damping, found = main(np.round(np.linspace(4.0, 6.0, 21), 3))
    print(damping)
    print(found)
    axes = fi.figures.calibration(found, title=f"true: {1e3 * GAP:g} mm, restitution {RESTITUTION:g}")
    fi.figures.save_figure(axes, "restitution_of_a_test.png")
