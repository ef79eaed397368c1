"""Small bugs put into a copy of the package on purpose: which validation case finds which.

Run by hand: `python benchmarks/mutations.py`, or `python benchmarks/mutations.py rms_factor base_load` for some of
them. Each takes seconds, or as long as the kernels take to compile where it changes one of their sources. Exit
status 1 if one survives.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

__all__ = ["MUTATIONS", "Mutation", "findings", "mutate", "place_of", "print_findings"]

PACKAGE = Path(__file__).parents[1] / "femimpact"

LIMIT = 600.0
"""Longest run of all cases, s: a bug that hangs is found."""

CHILD = """
import json, sys
from femimpact.validation import REFERENCE_CASES
found = {}
for run in REFERENCE_CASES:
    try:
        found |= {case.name: f"{case.error:.1e}" for case in run() if not case.passes}
    except Exception as error:
        subject = getattr(run, "func", run).__name__
        found[", ".join([subject, *(part.name for part in getattr(run, "args", ()))])] = type(error).__name__
print(json.dumps(found))
"""


@dataclass(frozen=True)
class Mutation:
    """One bug: a text that stands in exactly one place of the package, and what takes its place.

    Parameters
    ----------
    name : str
    old, new : str
    """

    name: str
    old: str
    new: str


MUTATIONS = (
    # structure, mesh and modes
    Mutation("shear_of_a_beam", "/ (1.0 + 12.0 * ratio**2)", "/ (1.0 + 12.1 * ratio**2)"),
    Mutation("inertia_of_turning", "np.where(squared > 0.0, grid.rotary_inertia, 0.0)", "0.0 * squared"),
    Mutation("flexibility_in_shear", "third[shears > 0.0]], format", "third[shears > 1.0]], format"),
    Mutation("hermite_stiffness", "12 * s - 6, 6 * s - 4, 6 - 12 * s", "12 * s - 6, 6 * s - 4.01, 6 - 12 * s"),
    Mutation("consistent_mass", "w.mass_per_length * u * v", "1.001 * w.mass_per_length * u * v"),
    Mutation(
        "second_section",
        "bending, modulus = segment.bending_stiffness",
        "bending, modulus = beam.segments[0].bending_stiffness",
    ),
    Mutation("second_moment_of_tube", "(self.diameter**2 + inner**2) / 16.0", "(self.diameter**2 - inner**2) / 16.0"),
    Mutation(
        "surface_of_its_rectangle", "modulus, segment.half_height or math.nan", "modulus, 0.5 * segment.rectangle[1]"
    ),
    Mutation("gauss_points_of_taper", "np.ones(a.size), a + 3.0 * b", "np.ones(a.size), a + 2.9 * b"),
    Mutation("pinned_is_clamped", '"pinned": ("w",)', '"pinned": ("w", "slope")'),
    Mutation("rotary_inertia", "(inertia * turn)[:, :, None]", "(0.5 * inertia * turn)[:, :, None]"),
    Mutation(
        "body_offset", "centre = shape.data.reshape(-1, 4) + offset", "centre = shape.data.reshape(-1, 4) - offset"
    ),
    Mutation("base_load", "momentum = M.times(rigid)", "momentum = beam_matrices(grid)[1].times(rigid)"),
    Mutation(
        "glued_place",
        "PointMass(ball.name, ball.at, ball.mass) for ball",
        "PointMass(ball.name, ball.at, 0.9 * ball.mass) for ball",
    ),
    Mutation("rayleigh_alpha", "alpha = 2.0 * w1", "alpha = 2.1 * w1"),
    Mutation("rayleigh_beta", "beta = 2.0 * (z2", "beta = 2.1 * (z2"),
    Mutation(
        "realised_damping",
        "np.asarray(0.5 * (alpha / omega + beta * omega))",
        "np.asarray(0.51 * (alpha / omega + beta * omega))",
    ),
    Mutation("effective_mass", "own(self.participation_factor**2)", "own(np.abs(self.participation_factor))"),
    Mutation("contact_mass", "inverse = self.first_mode**2 +", "inverse = self.first_mode +"),
    Mutation("flexibility", 'np.einsum("ji,ij->j", rows, solved))', 'np.einsum("ji,ij->j", rows, solved)) * 1.01'),
    Mutation("static_correction", "if static_correction and system.contacts:", "if False and system.contacts:"),
    Mutation("attachment_vector", "psi @ mix / np.sqrt(inverse_square)", "psi @ mix / inverse_square"),
    Mutation("damping_of_attachment", "np.append(ratio, damping_ratios(", "np.append(ratio, 0.5 * damping_ratios("),
    # excitation
    Mutation(
        "base_speed_sign",
        "scale * np.cos(self.omega * times(time)",
        "-scale * np.cos(self.omega * times(time)",
    ),
    Mutation("recorded_base", "BrokenLine(self.samples, self", "BrokenLine(1.1 * self.samples, self"),
    Mutation("recorded_displacement", "h * h * (2.0 * a[:-1] + a[1:]) / 6.0", "h * h * (a[:-1] + 2.0 * a[1:]) / 6.0"),
    Mutation(
        "force_phase", "Harmonic(self.amplitude, self.omega, self.phase)", "Harmonic(self.amplitude, self.omega, 0.0)"
    ),
    Mutation("split_of_a_continued_run", "if not held.motion or first == end:", "if True:"),
    Mutation(
        "phase_of_forces_at_one_place",
        "if wave is None or len(waves) == 1 else wave.phase",
        "if wave is None or len(waves) > 0 else wave.phase",
    ),
    Mutation("rest_in_space", "y, y_rate = y - offset, y_rate - speed", "y, y_rate = y - offset, y_rate + speed"),
    Mutation(
        "absolute_displacement",
        "np.asarray(values + moved_by[channel.unit](self.time))",
        "np.asarray(values - moved_by[channel.unit](self.time))",
    ),
    # contact
    Mutation("restitution_of_ratio", "math.exp(-2.0 * z * linear_angle", "math.exp(-2.02 * z * linear_angle"),
    Mutation(
        "ratio_of_restitution",
        "lambda z: -2.0 * z * linear_angle(z) - target",
        "lambda z: -2.02 * z * linear_angle(z) - target",
    ),
    Mutation(
        "linear_contact_time",
        "(2.0 * math.sqrt(stiffness * effective_mass))) / omega",
        "(2.0 * math.sqrt(stiffness * effective_mass))) / omega * 1.02",
    ),
    Mutation("hertz_stiffness", "return 4.0 / 3.0 / compliance", "return 4.1 / 3.0 / compliance"),
    Mutation("hertz_exponent", "exponent == 1.5 ? depth * __builtin_sqrt(depth)", "exponent == 1.5 ? depth * depth"),
    Mutation("hertz_potential", "return 0.4 * stiffness * depth * depth", "return 0.39 * stiffness * depth * depth"),
    Mutation("power_exponent", ": __builtin_pow(depth, exponent);", ": __builtin_pow(depth, 1.5);"),
    Mutation(
        "gap_sides",
        "gaps=item.gaps,",
        "gaps=item.gaps[::-1],",
    ),
    Mutation("switching_wall", "0.5 * stiffness * (x * x - wall * wall)", "0.5 * stiffness * (x - wall) * (x - wall)"),
    # stepped
    Mutation(
        "drive_one_step_late",
        "    phase = phase + omega * origin\n",
        "    phase = phase + omega * (origin - dt)\n",
    ),
    Mutation(
        "samples_one_step_late",
        "* method.refine + 1) * (method.dt / method.refine)",
        "* method.refine + 1) * (method.dt / method.refine) - method.dt",
    ),
    Mutation(
        "alpha_coefficient", "(2.0 * r - 1.0) / (r + 1.0), r / (r + 1.0)", "(2.0 * r - 1.0) / (r + 1.0), r / (r + 1.1)"
    ),
    Mutation(
        "ball_without_base",
        "constants[core.steps.SHARE, j] = 0.0 if pair.is_stop",
        "constants[core.steps.SHARE, j] = 0.0 if True",
    ),
    Mutation(
        "step_compliance",
        "compliance_v=np.ascontiguousarray(table @ v.T)",
        "compliance_v=np.ascontiguousarray(0.9 * table @ v.T)",
    ),
    Mutation("mean_rate", "mass_response_v=h,", "mass_response_v=1.1 * h,"),
    Mutation(
        "jean_restitution",
        "(free.rate + law.restitution * free.rate_before) / free.compliance_v",
        "(free.rate + 1.02 * law.restitution * free.rate_before) / free.compliance_v",
    ),
    Mutation("stepped_contact_loss", "m.ledger(CONTACT_LOSS, c) += loss", "m.ledger(CONTACT_LOSS, c) += 0.0"),
    Mutation("stepped_ball_work", "MASS, j), c) * acting * increment", "MASS, j), c) * 0.0 * increment"),
    # periodic orbits
    Mutation("saltation", "np.asarray(self.jump + after[:, :, None]", "np.asarray(self.jump - after[:, :, None]"),
    Mutation(
        "release_of_an_orbit",
        "self.contact_damping[j] / self.contact_stiffness[j] if name",
        "0.9 * self.contact_damping[j] / self.contact_stiffness[j] if name",
    ),
    Mutation(
        "doubling_and_breaking",
        '"symmetry-breaking" if self.curve.is_symmetric else "period-doubling"',
        '"period-doubling" if self.curve.is_symmetric else "symmetry-breaking"',
    ),
    Mutation(
        "one_cycle_of_two",
        "steady_motion(CycleStatistics(*table), np.full",
        "steady_motion(CycleStatistics(*table[:, -1:]), np.full",
    ),
    Mutation("two_bifurcations_in_a_step", "beyond = _beyond(left, right)", "beyond = None"),
    Mutation("crest_of_a_stop_in_space", "+ base @ of_base", "+ 0.9 * base @ of_base"),
    Mutation(
        "multipliers_of_a_stop_in_space",
        "speed_by_phase=-hybrid.omega * of_base",
        "speed_by_phase=hybrid.omega * of_base",
    ),
    # event-driven
    Mutation(
        "event_driven_ball_without_base",
        "        load[0, n + j] = -pair.mass * drive.share\n",
        "        load[0, n + j] = 0.0\n",
    ),
    Mutation(
        "impulse_mobility", "pairs.mobility(x.pair(i), x.pair(j));", "1.02 * pairs.mobility(x.pair(i), x.pair(j));"
    ),
    Mutation(
        "first_in_the_list_gets_the_blow",
        "        closes = closes || approach > rest;\n        n++;",
        "        n += !closes || approach <= rest;\n        closes = closes || approach > rest;",
    ),
    Mutation(
        "what_rests_is_left_out",
        "search.at_wall(r) == 0.0 || approach < -rest",
        "search.at_wall(r) == 0.0 || approach <= rest",
    ),
    Mutation(
        "contact_stiffness",
        "np.where(rigid, 0.0, inputs.stiffness)",
        "np.where(rigid, 0.0, 1.05 * inputs.stiffness)",
    ),
    Mutation(
        "sticking_impulse",
        "touch(PUSHED, j) += impulse;",
        "touch(PUSHED, j) += 0.0 * impulse;",
    ),
    Mutation("impact_loss", "0.5 * push * (1.0 - e) * approach", "0.5 * push * approach"),
    Mutation("contact_loss", "double loss = c.damping(j) * square_of_rate", "double loss = 0.0 * square_of_rate"),
    Mutation("ball_work", "0.5 * (after * after - before * before)", "0.4 * (after * after - before * before)"),
    Mutation(
        "energy_to_modes",
        "middle(i) = velocity(i) + 0.5 * momentum / b.mass(i);",
        "middle(i) = velocity(i);",
    ),
    Mutation("centring_spring", "K += pair.free_stiffness * np.outer(", "K += 0.9 * pair.free_stiffness * np.outer("),
    Mutation("centring_energy", "base), b.free_stiffness(j))", "base), 0.5 * b.free_stiffness(j))"),
    Mutation(
        "stiffness_of_a_wall", "gap_on(side, j, c), 0.0), c.stiffness(j))", "gap_on(side, j, c), 0.0), c.stiffness(0))"
    ),
    Mutation("slow_modes", "SLOW = 0.9\n", "SLOW = 1e-9\n"),
    Mutation("load_on_slow_modes", "k < forms.slow(f) && w <", "k + 1 < forms.slow(f) && w <"),
    Mutation(
        "left_by_its_wall", "larger(press, 0.0) * pairs.closure)", "larger(press, 0.0) * pairs.closure && speed < 0.0)"
    ),
    # what is read
    Mutation(
        "cut_at_the_window",
        "opened = smaller(larger(c.window(0), start), until);",
        "opened = c.window(0) < until ? start : until;",
    ),
    Mutation("ledger_dissipation", "+ (dissipated - dissipated[0])", "+ 0.0 * (dissipated - dissipated[0])"),
    Mutation("rms_factor", "rms = np.sqrt(_total(square) / total)", "rms = np.sqrt(2.0 * _total(square) / total)"),
    Mutation("first_harmonic", "2.0 * _total(sine) / total, 2.0", "_total(sine) / total, 2.0"),
    Mutation("harmonic_phase", "np.arctan2(in_quadrature, in_phase)", "np.arctan2(in_phase, in_quadrature)"),
    Mutation(
        "steady_peak",
        "np.abs(np.maximum(maximum, -minimum).max(axis=0))",
        "np.abs(np.maximum(maximum, -minimum).mean(axis=0))",
    ),
    Mutation("mean_impulse", '"mean_impulse": totals[3].sum(axis=0) * share', '"mean_impulse": totals[3].sum(axis=0)'),
    Mutation("cycle_mean_force", "totals[5].sum(axis=0) / duration", "totals[5].sum(axis=0) / duration * frequency"),
    Mutation(
        "one_pole_fit",
        "ratio, natural_frequency, squares = _power(pole[2])",
        "ratio, natural_frequency, squares = 1.05 * _power(pole[2])",
    ),
    Mutation("half_power", "(low / f[top]) ** 2) / 4.0", "(low / f[top]) ** 2) / 4.2"),
    Mutation(
        "amplitude_ratio", "reference.ratio * drop, reference.frequency", "reference.ratio / drop, reference.frequency"
    ),
    Mutation(
        "mesh_order",
        "fitted = fitted_order(h, e, 3.0 * bottom)",
        "fitted = fitted_order(h**2, e, 3.0 * bottom)",
    ),
    Mutation(
        "laser_offset",
        "low, high = self.offset - 0.5 * self.range, self.offset",
        "low, high = -self.offset - 0.5 * self.range, -self.offset",
    ),
    # parameter studies
    Mutation("start_in_a_gap", "displacement = -minus + (plus + minus)", "displacement = -plus + (plus + minus)"),
    Mutation("rank_of_the_median", "return k - 1, starts - k", "return k, starts - 1 - k"),
    Mutation(
        "scatter_of_another_case",
        '(_text(data[f"{measure}{end}"].to_numpy()[at], attributes)',
        '(_text(data[f"{measure}{end}"].to_numpy().flat[-1], attributes)',
    ),
    Mutation("spread_of_a_median", "1.0 + 0.5 * math.pi / starts", "1.0 + math.pi / starts"),
    # damping of a free decay
    Mutation(
        "one_sided_interval_of_a_mode",
        "stdtrit(max(fit.time.size - 4 * count - 2, 1), 0.5 + 0.5 * level)",
        "stdtrit(max(fit.time.size - 4 * count - 2, 1), level)",
    ),
)


def place_of(mutation: Mutation, package: Path) -> Path:
    """The source that holds the text of a mutation.

    Raises
    ------
    SystemExit
        Unless it stands in the package exactly once, the validation cases left out.
    """
    held_in = sorted([*package.rglob("*.py"), *package.rglob("*.hpp"), *package.rglob("*.cpp")])
    sources = [path for path in held_in if "validation" not in path.parts]
    counts = {path: path.read_text(encoding="utf-8").count(mutation.old) for path in sources}
    held = [path for path, count in counts.items() if count]
    if sum(counts.values()) != 1:
        where = ", ".join(str(path.relative_to(package)) for path in held) or "nowhere"
        sys.exit(f"{mutation.name}: the text must stand in the package exactly once, and stands in: {where}")
    return held[0]


def mutate(mutation: Mutation, package: Path) -> None:
    """Put the bug into a copy of the package, and build the core anew where it is in its sources."""
    source = place_of(mutation, package)
    source.write_text(source.read_text(encoding="utf-8").replace(mutation.old, mutation.new), encoding="utf-8")
    if source.suffix != ".py":
        words = [sys.executable, "-m", "femimpact.core.compilation"]
        subprocess.run(words, cwd=package.parent, check=True, capture_output=True)


def findings(mutation: Mutation | None) -> dict[str, str]:
    """Cases that do not pass with a mutation, or with none, and their error.

    What is compiled already is copied too: it is taken where the mutation changes none of its sources.
    """
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "femimpact"
        shutil.copytree(PACKAGE, copy)
        if mutation is not None:
            mutate(mutation, copy)
        environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
        environment["PYTHONPATH"] = folder
        try:
            done = subprocess.run(
                [sys.executable, "-c", CHILD], cwd=folder, env=environment, capture_output=True, text=True,
                timeout=LIMIT, check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return {"every case": f"not done within {LIMIT:g} s"}
    if done.returncode:
        return {"every case": (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]}
    return dict(json.loads(done.stdout.splitlines()[-1]))


def print_findings(
    names: Sequence[str], mutations: Sequence[Mutation], found_by: Callable[[Mutation], dict[str, str]]
) -> int:
    """Print one row for each mutation of some names, or for all, and what finds it; 1 if one survives."""
    known = {mutation.name: mutation for mutation in mutations}
    if unknown := [name for name in names if name not in known]:
        sys.exit(f"unknown: {', '.join(unknown)}; known: {', '.join(known)}")
    chosen = [known[name] for name in names] or list(mutations)
    places = [place_of(mutation, PACKAGE).relative_to(PACKAGE) for mutation in chosen]
    print("| mutation | in | found by | first of them (error) | s |\n| --- | --- | --- | --- | --- |", flush=True)
    survivors = []
    for mutation, place in zip(chosen, places, strict=True):
        start = time.perf_counter()
        found = found_by(mutation)
        first = "; ".join(f"{name} ({error})" for name, error in list(found.items())[:3])
        seconds = time.perf_counter() - start
        print(f"| {mutation.name} | {place} | {len(found)} | {first} | {seconds:.0f} |", flush=True)
        if not found:
            survivors.append(mutation.name)
    print(f"\n{len(chosen) - len(survivors)} of {len(chosen)} found; survivors: {', '.join(survivors) or 'none'}")
    return 1 if survivors else 0


def main(names: list[str]) -> int:
    """Print which case finds which mutation; 1 if one survives."""
    if clean := findings(None):
        sys.exit(f"without a mutation these do not pass: {clean}")
    return print_findings(names, MUTATIONS, findings)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
