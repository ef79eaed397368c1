r"""How much does a rattling ball damp a cantilever? The shortest complete script.

M u'' + C u' + K u = -M r ub'' + b F,    m (y'' + ub'') = -F,    F = F(y - b^T u)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import femimpact as fi


@dataclass(frozen=True)
class Result:
    """Curves without and with the ball, and one history."""

    empty: fi.FrequencyResponse
    ball: fi.FrequencyResponse
    response: fi.Response


def main(points: int = 201, cycles: int = 600, duration: float = 20.0) -> Result:
    """Model, one history, and the sweep without and with the ball."""
    structure = fi.Structure(
        beam=fi.Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700),
        masses=[fi.PointMass("box", at="tip", mass=0.02290976)],
        impactors=[
            fi.Impactor(
                "ball", at="tip", mass=3.43e-3, gap=4e-3, contact=fi.KelvinVoigt(restitution=0.8, contact_time=2e-3)
            )
        ],
        damping=fi.Rayleigh(ratio=0.0029, modes=(1, 2)),
    )
    small = fi.reduce(fi.assemble(structure, elements=40), modes=8)
    method = fi.Newmark(dt=fi.recommended_step(small))
    base = fi.Sine(amplitude=0.2037e-3, frequency=4.9)
    record = fi.Recorder(channels=("tip", "ball", "contact_force"), every=10)
    response = fi.integrate(small, base, method, duration=duration, record=record)
    frequencies = np.linspace(4.0, 6.0, points)
    ball = fi.frequency_sweep(small, base.amplitude, frequencies, method, cycles)
    empty = fi.frequency_sweep(fi.without_impactors(small), base.amplitude, frequencies, method, cycles)
    return Result(empty, ball, response)


if __name__ == "__main__":
    result = main()
    print("without ball:", result.empty.damping)
    print("with ball:   ", result.ball.damping)
    star = " (one start's value: the motion is not periodic)" if result.ball.peak_is_sample else ""
    print("amplitude ratio:", f"{result.empty.peak_amplitude / result.ball.peak_amplitude:.2f}{star}")
    axes = fi.figures.response_curve({"without ball": result.empty, "with ball": result.ball})
    print("wrote", fi.figures.save_figure(axes, "damped_resonance.png"))
