"""Random structures for the methods with steps: every method, law, kind of matrix, excitation and start."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

import femimpact as fi

LAWS = ("kelvin-voigt", "hertz", "power", "switching", "custom")


def stiffening(depth: float, rate: float, approach_speed: float) -> float:
    """Force (N) of a law that a user writes: a spring that stiffens, with a loss that grows with depth."""
    return 2e4 * depth * (1.0 + 1e3 * depth) * (1.0 + 0.3 * rate / approach_speed)


@dataclass(frozen=True, eq=False)
class SteppedCase:
    """One run by a method with steps, and what it is to record."""

    system: fi.System
    excitation: Any
    method: Any
    duration: float
    initial: fi.State
    recorder: fi.Recorder


def law_of(rng: np.random.Generator, rigid: bool, stop: bool) -> Any:
    """A law for one pair."""
    if rigid:
        return fi.Rigid(float(rng.uniform(0.0, 1.0)))
    kind = LAWS[int(rng.integers(len(LAWS)))]
    if kind == "hertz":
        return fi.Hertz(float(10.0 ** rng.uniform(5.0, 7.0)))
    if kind == "power":
        return fi.HuntCrossley(float(10.0 ** rng.uniform(5.0, 7.0)), restitution=float(rng.uniform(0.3, 0.9)))
    if kind == "switching" and not stop:
        return fi.contact.SwitchingSpring(float(rng.uniform(0.0, 2.0)), float(rng.uniform(100.0, 2000.0)))
    if kind == "custom":
        return fi.CustomLaw(stiffening)
    return fi.KelvinVoigt(restitution=float(rng.uniform(0.2, 1.0)), contact_time=float(rng.uniform(1e-3, 4e-3)))


def gaps(rng: np.random.Generator) -> Any:
    """A gap (m), or one of each side."""
    low = float(rng.uniform(2e-4, 3e-3))
    return low if rng.random() < 0.5 else (low, float(rng.uniform(2e-4, 3e-3)))


def method_of(rng: np.random.Generator, rigid: bool, dt: float) -> Any:
    """A method with a step (s)."""
    if rigid:
        return fi.MoreauJean(dt, theta=float(rng.choice([0.5, 0.6])), allow_coarse_step=True)
    refine = int(rng.choice([1, 1, 2, 5]))
    kind = int(rng.integers(5))
    if kind == 0:
        return fi.HHT(dt, refine=refine, allow_coarse_step=True)
    if kind == 1:
        return fi.WBZ(dt, refine=refine, allow_coarse_step=True)
    if kind == 2:
        return fi.GeneralizedAlpha(dt, refine=refine, allow_coarse_step=True)
    contact = "energy-consistent" if kind == 3 else "end"
    return fi.Newmark(dt, contact=contact, refine=refine, allow_coarse_step=True)


def system_of(rng: np.random.Generator, rigid: bool) -> fi.System:
    """A cantilever on its modes, in its own dofs of four bands, or behind a full matrix."""
    beam = fi.Beam.uniform(
        length=float(rng.uniform(0.15, 0.3)), width=0.02, thickness=float(rng.uniform(8e-4, 2e-3)),
        young_modulus=70e9, density=2700.0,
    )  # fmt: skip
    balls = [
        fi.Impactor(
            f"ball{i}", ("tip", "mid")[int(rng.integers(2))], float(rng.uniform(1e-3, 8e-3)), gaps(rng),
            law_of(rng, rigid, False), free_stiffness=float(rng.choice([0.0, 3.0])),
            acceleration=float(rng.choice([0.0, -9.81])),
        )
        for i in range(int(rng.integers(0, 4)))
    ]  # fmt: skip
    stops = [
        fi.Stop(
            f"stop{i}", ("tip", "mid")[int(rng.integers(2))], gaps(rng), law_of(rng, rigid, True),
            fixed_to=str(rng.choice(["base", "space"])),
        )
        for i in range(int(rng.integers(0, 3)))
    ]  # fmt: skip
    structure = fi.Structure(
        beam, [fi.PointMass("box", "tip", float(rng.uniform(0.005, 0.03)))], balls,
        fi.Rayleigh(float(rng.uniform(0.002, 0.03)), modes=(1, 2)), stops=stops, gravity=float(rng.choice([0.0, 9.81])),
    )  # fmt: skip
    whole = fi.assemble(structure, elements=int(rng.integers(2, 13)))
    kind = int(rng.integers(3))
    if kind == 0:
        return fi.reduce(whole, modes=int(rng.integers(1, 5)))
    if kind == 1:
        return whole
    return mixed(whole, balls, stops)


def mixed(whole: fi.System, balls: list[fi.Impactor], stops: list[fi.Stop]) -> fi.System:
    """The same structure in other coordinates: its matrices have more than four bands."""
    n = whole.dofs
    turn = np.eye(n) + 0.1 * np.tri(n, k=-1)
    M, C, K = (turn.T @ matrix.toarray() @ turn for matrix in (whole.M, whole.C, whole.K))
    points = {name: turn.T @ whole.point_row(name) for name in ("tip", "mid")}
    M, C, K = (0.5 * (matrix + matrix.T) for matrix in (M, C, K))
    return fi.System.from_matrices(
        M, C, K, points=points, base_load=turn.T @ whole.base_load, impactors=balls, stops=stops,
        constant_load=turn.T @ np.asarray(whole.constant_load),
    )  # fmt: skip


def excitation_of(rng: np.random.Generator, system: fi.System) -> Any:
    """A sine of the base, a force, or a record."""
    frequency, kind = system.first_frequency * float(rng.uniform(0.7, 1.3)), rng.random()
    if kind < 0.5:
        return fi.Sine(float(rng.uniform(1e-4, 1e-3)), frequency, phase=float(rng.uniform(0.0, 6.0)))
    if kind < 0.75:
        return fi.PointForce("tip", fi.Sine(float(rng.uniform(0.05, 0.3)), frequency))
    return fi.RecordedBase(rng.normal(scale=3.0, size=400), interval=1.0 / (20.0 * frequency))


def start_of(rng: np.random.Generator, system: fi.System) -> fi.State:
    """At rest in the base or in space, or the static state where the laws have one."""
    kind = rng.random()
    if kind < 0.3 and all(pair.law.name not in ("custom", "switching-spring") for pair in system.contacts):
        return fi.State(equilibrium=True)
    return fi.State(frame="space") if kind > 0.8 else fi.State()


def stepped_case(seed: int) -> SteppedCase:
    """The case of a seed: some 10 cycles, most with contact."""
    rng = np.random.default_rng([seed, 4711])
    rigid = rng.random() < 0.3
    system = system_of(rng, rigid)
    excitation = excitation_of(rng, system)
    dt = 1.0 / (system.first_frequency * float(rng.uniform(150.0, 800.0)))
    method = method_of(rng, rigid, dt)
    duration = float(rng.uniform(3.0, 12.0)) / system.first_frequency
    initial = start_of(rng, system)
    recorder = fi.Recorder(
        every=int(rng.integers(1, 6)), snapshots=int(rng.choice([0, 7])), start=float(rng.choice([0.0, 0.2 * duration]))
    )
    return SteppedCase(system, excitation, method, duration, initial, recorder)
