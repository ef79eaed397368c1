r"""Where does a beam between walls jump? A slow sweep up, and one down that goes on from where the first one ended.

    M u'' + C u' + K u = -M r ub'' + b F,   ub = delta sin(2 pi f (t - t0)),   F of walls 8 mm from the tip

The walls stiffen the beam once it reaches them: the response curve leans to higher frequencies, and over a band two
steady motions are stable, one with impacts and one without. Each dwell of 150 base cycles begins at t0 with the final
state of the dwell before it. A star behind a peak says that the motion is not periodic: the value is that of this way's
start alone. The way up keeps to the motion with impacts, the way down to the one without, until that
motion ends.
"""

import math

import numpy as np

import femimpact as fi

BEAM = fi.Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
WALLS = fi.Stop("walls", "tip", 8e-3, fi.KelvinVoigt(restitution=0.6, contact_time=0.02))
BOX = fi.PointMass("box", "tip", 0.02290976)
FREQUENCIES = np.linspace(5.0, 6.6, 17)


def main(frequencies=FREQUENCIES, cycles=150):
    """Model, peaks of the tip (m) up and down, by frequency (Hz), and which are one start's, (2, frequencies)."""
    structure = fi.Structure(BEAM, masses=[BOX], stops=[WALLS], damping=fi.Rayleigh(ratio=0.0029, modes=(1, 2)))
    system, state, peaks, one = fi.reduce(fi.assemble(structure, elements=20), modes=3), fi.State(), [], []
    for f in (*frequencies, *frequencies[::-1]):
        base = fi.Sine(0.2037e-3, f, phase=-2.0 * math.pi * f * state.time)
        run = fi.integrate(system, base, fi.EventDriven(), cycles / f, fi.Recorder("tip"), state)
        peaks, state = [*peaks, run.steady.peak[0]], run.final_state
        one.append(run.steady.steadiness[0] != "periodic")
    up, down = np.split(np.array(peaks), 2)
    return system, up, down[::-1], np.array([one[: up.size], one[: up.size - 1 : -1]])


if __name__ == "__main__":
    _, *peaks, one = main()
    for f, up, down, stars in zip(FREQUENCIES, *peaks, np.where(one, "*", " ").T, strict=True):
        print(f"{f:.1f} Hz: {1e3 * up:5.2f}{stars[0]} mm on the way up, {1e3 * down:5.2f}{stars[1]} mm on the way down")
    print("* one start's value: the motion is not periodic")
