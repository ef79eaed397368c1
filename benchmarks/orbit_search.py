"""Shares of settled random runs whose periodic orbit `find_orbit` finds, and what the search takes.

    python benchmarks/orbit_search.py [--runs 500] [--first 0]

Each run has its seed: a structure of 1 to 5 modes with one or two balls or stops, rigid or Kelvin-Voigt, the base or a
force as its drive. A run counts as periodic where the places of its contacts and its balls, read once a cycle at its
end, repeat within 1e-6 of the gap after at most 8 cycles. Those that stick or chatter are counted apart. Every orbit
that is missed is printed with its seed and the reason. The first twenty that are found are run for 1,000 cycles from
their state.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter

import numpy as np

import femimpact as fi
from femimpact.orbits.orbit import state_vector

RATIOS = np.array([1.0, 6.27, 17.5, 34.4, 56.8])
CYCLES = 600


def random_case(seed: int) -> tuple[fi.System, fi.Sine | fi.PointForce, bool]:
    """A system, its drive, and whether its contacts are rigid."""
    rng = np.random.default_rng(seed)
    modes, rigid, pairs = int(rng.integers(1, 6)), bool(rng.random() < 0.5), int(rng.integers(1, 3))
    omega = 2.0 * np.pi * 5.0 * RATIOS[:modes] * rng.uniform(0.95, 1.05, modes)
    damping = np.diag(2.0 * 10.0 ** rng.uniform(-2.5, -1.3) * omega)
    force = bool(rng.random() < 0.3)
    peak = 10.0 ** rng.uniform(-3.0, -2.0)
    points, impactors, stops = {}, [], []
    for j in range(pairs):
        points[f"place {j}"] = rng.choice([-1.0, 1.0], modes) * rng.uniform(0.4, 1.0, modes) * (5.0 if j == 0 else 3.0)
        points[f"place {j}"][0] = abs(points[f"place {j}"][0])
        e, gap = rng.uniform(0.3, 0.85), peak * rng.uniform(0.3, 1.5)
        law = fi.Rigid(e) if rigid else fi.KelvinVoigt(restitution=e, contact_time=10.0 ** rng.uniform(-3.3, -2.2))
        if rng.random() < 0.6:
            mass = 10.0 ** rng.uniform(-2.0, -0.7) / points[f"place {j}"][0] ** 2
            acceleration = -9.81 * rng.uniform(0.0, 0.02) * (rng.random() < 0.2)
            impactors.append(fi.Impactor(f"ball {j}", f"place {j}", mass, gap, law, acceleration=acceleration))
        else:
            gaps = (gap, gap if rng.random() < 0.5 else np.inf)
            fixed_to = "space" if rng.random() < 0.3 and not force else "base"
            stops.append(fi.Stop(f"stop {j}", f"place {j}", gaps, law, fixed_to=fixed_to))
    system = fi.System.from_matrices(
        np.eye(modes), damping, np.diag(omega**2), points=points, base_load=rng.uniform(0.1, 0.3, modes),
        impactors=impactors, stops=stops,
    )  # fmt: skip
    frequency = omega[0] / (2.0 * np.pi) * rng.uniform(0.8, 1.25)
    # a level that moves the first place by about `peak` without contacts
    reach = abs(points["place 0"][0] / (omega[0] ** 2 - (2 * np.pi * frequency) ** 2 + 1j * damping[0, 0] * omega[0]))
    if force:
        return system, fi.PointForce("place 0", fi.Sine(peak / (reach * points["place 0"][0]), frequency)), rigid
    amplitude = peak / (reach * system.base_load[0] * (2.0 * np.pi * frequency) ** 2)
    return system, fi.Sine(min(amplitude, peak), frequency), rigid


def cycles_of(run: fi.response.Response, gap: float) -> int:
    """Cycles after which the readings once a cycle repeat, at most 8; 0 where they do not."""
    values = np.array([run.channels[name] for name in run.units])
    for cycles in range(1, 9):
        if np.all(np.abs(values[:, -12:] - values[:, -12 - cycles : -cycles]) < 1e-6 * gap):
            return cycles
    return 0


def drift(orbit: fi.orbits.PeriodicOrbit) -> float:
    """By how much, in gaps and gaps times omega, a run of some 1,000 cycles from the orbit's state misses it."""
    record = fi.Recorder(channels=(), ledger=False, impacts=0)
    cycles = orbit.cycles * round(1000 / orbit.cycles)
    end = fi.integrate(
        orbit.system, orbit.excitation, fi.EventDriven(), cycles / orbit.excitation.frequency, record, orbit.state
    ).final_state
    moved = state_vector(end) - state_vector(orbit.state)
    unit = np.repeat([orbit.length, orbit.length * 2 * np.pi * orbit.excitation.frequency], moved.size // 2)
    return float(np.max(np.abs(moved) / unit))


def one_run(seed: int, drifts: list[float]) -> tuple[str, bool, str, float, float]:
    """What the run was, whether it is rigid, the fault of the search, and CPU times (s) of search and run."""
    system, drive, rigid = random_case(seed)
    names = [pair.name for pair in system.balls] + list(system.points)
    record = fi.Recorder(channels=names, every=64, start=(CYCLES - 24) / drive.frequency, ledger=False, events=100_000)
    begun = time.process_time()
    run = fi.integrate(system, drive, fi.EventDriven(), CYCLES / drive.frequency, record)
    spent = time.process_time() - begun
    late = run.events.time > (CYCLES - 24) / drive.frequency
    sticks = set(run.events.kind[late].tolist()) & {"capture", "let go"}
    cycles = cycles_of(run, min(pair.gaps[0] for pair in system.contacts))
    if sticks or np.count_nonzero(late) > 24 * 100:
        return "sticks or chatters", rigid, "", 0.0, spent
    if set(range(len(system.balls))) - set(run.events.pair[late].tolist()):
        return "a ball touches nothing", rigid, "", 0.0, spent
    if not cycles:
        return "not periodic", rigid, "", 0.0, spent
    begun, fault = time.process_time(), ""
    try:
        orbit = fi.find_orbit(system, drive, cycles, guess=run)
        if not orbit.is_stable:
            fault = f"unstable, {abs(orbit.multipliers[0]):.9g}"
    except fi.FemimpactError as error:
        fault = str(error)
    searched = time.process_time() - begun
    if not fault and len(drifts) < 20:
        drifts.append(drift(orbit))
    return "periodic", rigid, fault, searched, spent


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=500)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    kinds, found, searches, runs, drifts = Counter(), Counter(), [], [], []
    for seed in range(given.first, given.first + given.runs):
        kind, rigid, fault, search, spent = one_run(seed, drifts)
        law = "rigid" if rigid else "Kelvin-Voigt"
        kinds[law, kind] += 1
        runs.append(spent)
        if kind == "periodic":
            found[law] += not fault
            searches.append(search)
        if fault:
            print(f"seed {seed}, {law}: {fault}")
    for (law, kind), count in sorted(kinds.items()):
        print(f"{law}, {kind}: {count}")
    for law, count in found.items():
        print(f"{law}: {count} of {kinds[law, 'periodic']} orbits found, {count / kinds[law, 'periodic']:.1%}")
    print(f"search: median {1e3 * np.median(searches):.3g} ms, largest {1e3 * max(searches):.3g} ms of CPU")
    print(f"largest drift of {len(drifts)} stable orbits in 1,000 cycles: {max(drifts):.2g} gaps")
    print(f"runs of {CYCLES} cycles: median {1e3 * np.median(runs):.3g} ms of CPU")


if __name__ == "__main__":
    main()
