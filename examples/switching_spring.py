r"""What do the printed equations do? The paper's switching spring at the paper's step, with its energy audit.

The paper couples the ball by a spring on the full relative displacement x, k_I0 inside the gap and k_I
outside, chosen by the state before the step, with dt = 1/(20 f1), which is 9.4 ms:

    F = k x,   k = k_I if x > d1 or x < -d2 one step earlier, else k_I0.

The force jumps at the wall from k_I0 d to k_I d. The law itself is a function of x and has a potential,

    V(x) = k_I0 x^2/2 inside,   V(x) = k_I0 d^2/2 + k_I (x^2 - d^2)/2 outside,

so everything by which kinetic, strain and contact energy and the losses fail to balance the work of
the base is energy that the late decision and the coarse step create or destroy. The audit shows it
beside the same law at a step that resolves its contact, and a Kelvin-Voigt contact of the same
stiffness.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import femimpact as fi
from femimpact.study.demo import paper_study


@dataclass(frozen=True)
class Row:
    """One run: law, k_I (N/m), step (s), largest |w| of the tip (m), energy residual (1) and its sign at the end."""

    law: str
    stiffness: float
    dt: float
    peak: float
    residual: float
    created: float


def _run(structure: fi.Structure, law: str, stiffness: float, dt: float | None, duration: float) -> Row:
    contact = (
        fi.SwitchingSpring(free_stiffness=0.0, stiffness=stiffness)
        if law == "switching spring"
        else fi.KelvinVoigt(stiffness=stiffness, restitution=0.8)
    )
    ball = dataclasses.replace(structure.impactors[0], contact=contact)
    system = fi.reduce(fi.assemble(dataclasses.replace(structure, impactors=(ball,)), elements=40), modes=8)
    step = dt or fi.recommended_step(system)
    method = fi.Newmark(dt=step, allow_coarse_step=True, divergence_limit=1e9)
    base = fi.Sine(amplitude=0.2037e-3, frequency=5.3)
    try:
        response = fi.integrate(system, base, method, duration, fi.Recorder(channels=("tip",)))
    except fi.DivergenceError:
        return Row(law, stiffness, step, math.inf, math.inf, math.inf)
    if response.energy is None:
        raise fi.FemimpactError("the ledger was switched off")
    peak = float(abs(response["tip"]).max())
    return Row(law, stiffness, step, peak, response.energy.residual, float(response.energy.residual_history[-1]))


def main(stiffnesses: tuple[float, ...] = (10.0, 1e3, 1e5), duration: float = 60.0) -> list[Row]:
    """Run every stiffness at the paper's step and at one that resolves the contact."""
    structure = paper_study().structure
    paper_step = 1.0 / (20.0 * 5.30)
    rows = []
    for stiffness in stiffnesses:
        rows.append(_run(structure, "switching spring", stiffness, paper_step, duration))
        rows.append(_run(structure, "switching spring", stiffness, None, duration))
        rows.append(_run(structure, "kelvin-voigt", stiffness, None, duration))
    return rows


if __name__ == "__main__":
    print("law                k_I (N/m)     dt (s)      largest tip (m)   energy unaccounted for / put in")
    for row in main():
        sign = "created" if row.created > 0 else "lost"
        print(
            f"{row.law:17}  {row.stiffness:9g}  {row.dt:9.2e}   {row.peak:19.4g}"
            f"   {row.residual:9.2g} ({sign} at the end)"
        )
