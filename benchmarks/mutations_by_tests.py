"""Small bugs in what `femimpact validate` does not reach, put into a copy of the checkout: which test finds which.

Command line, study files, pictures and files that are written, directories of results, input checks, convergence,
identification, regimes and steps along a branch. Run by hand: `python benchmarks/mutations_by_tests.py`, or with names
for some of them. Each is tried by the tests named with it, up to the first that fails: seconds, or a minute. Exit
status 1 if one survives.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from mutations import LIMIT, PACKAGE, Mutation, mutate, print_findings

__all__ = ["MUTATIONS", "findings"]

LEFT_OUT = shutil.ignore_patterns(".*", "femimpact-demo*", "benchmark-results*", "build", "dist")
"""Of the checkout: what no test reads."""

FAILED = re.compile(r"^(?:FAILED|ERROR) tests/(.+?)(?: - (.*))?$", re.MULTILINE)
"""A test that failed, and the beginning of what it says."""

MUTATIONS: Mapping[str, tuple[Mutation, ...]] = {
    "test_taper.py": (
        Mutation("gauss_points_of_taper", "first = m1 / m0", "first = 0.5 * m1 / m0"),
        Mutation("taper_of_mass", "self.mass_per_length[element] * (a * b)", "self.mass_per_length[element] * a"),
    ),
    "test_cli.py": (
        Mutation(
            "status_of_bad_input",
            "except (InputError, CoreError) as error:\n        _fail(_with_notes(str(error), error), 2)",
            "except (InputError, CoreError) as error:\n        _fail(_with_notes(str(error), error), 1)",
        ),
        Mutation(
            "status_of_interrupt", '_with_notes("interrupted", error), 130)', '_with_notes("interrupted", error), 1)'
        ),
        Mutation(
            "quiet_without_warnings",
            "if quiet:\n        _show_warnings(results)\n    else:",
            "if quiet:\n        pass\n    else:",
        ),
        Mutation("init_over_a_file", 'require(force or not file.exists(), "file"', 'require(True, "file"'),
        Mutation("no_star", '"*" if curve.get("peak_is_one_start") else ""', '""'),
        Mutation(
            "frequency_left_out",
            "    if frequency is not None:\n        study = replace(",
            "    if frequency is None and quiet is None:\n        study = replace(",
        ),
        Mutation("memory_limit", "limit < LEAST_MEMORY and", "limit < 0.5 * LEAST_MEMORY and"),
    ),
    "test_simultaneous_impacts.py": (
        Mutation("all_to_the_first_of_equals", "if (find_pushing(0.0, x, n))", "if (find_pushing(1e-9, x, n))"),
        Mutation("beside_its_wall", "constexpr double BESIDE = 64.0", "constexpr double BESIDE = 1e-3"),
        Mutation(
            "only_the_first_is_captured",
            "        if (lasting >= 0.0) {\n            hold(r);",
            "        if (lasting >= 0.0 && !caught) {\n            hold(r);",
        ),
        Mutation(
            "sticking_pair_is_not_let_go",
            "if (!sticking)\n            solve_impulses",
            "if (sticking)\n            solve_impulses",
        ),
        Mutation(
            "separating_pair_is_pushed", "if (s.rigid && count > 1 && gate(j)", "if (s.rigid && count > 9 && gate(j)"
        ),
        Mutation("few_iterations_of_impulses", "IMPULSE_ITERATIONS = 20'000", "IMPULSE_ITERATIONS = 200"),
    ),
    "test_contact_table.py": (
        Mutation(
            "least_speed_left_out",
            "directory, force, speed_min, speed_max)",
            "directory, force, 0.01, speed_max)",
        ),
    ),
    "test_terminal_tables.py": (
        Mutation(
            "digits_of_a_cell",
            'isinstance(value, str) else f"{value:.5g}"',
            'isinstance(value, str) else f"{value:.4g}"',
        ),
    ),
    "test_study.py": (
        Mutation(
            "unknown_key",
            "(name for name in values if name not in fields)",
            "(name for name in values if not name)",
        ),
        Mutation(
            "first_fault_alone",
            "for fault in error.faults]\n        return None",
            "for fault in error.faults[:1]]\n        return None",
        ),
        Mutation("name_of_a_law", '{"loss": "lankarani-nikravesh"}', '{"loss": "hunt-crossley"}'),
        Mutation(
            "phase_of_the_base",
            "return Sine(self.amplitude, self.frequency, self.phase)",
            "return Sine(self.amplitude, self.frequency)",
        ),
        Mutation(
            "gravity_of_a_study",
            "None if made is None else made.acceleration",
            "None if made is None else -made.acceleration",
        ),
    ),
    "test_study_springs.py": (
        Mutation(
            "free_root",
            "    if not structure.supports:\n        # without",
            "    if structure.supports:\n        # without",
        ),
    ),
    "test_csv_tables.py": (Mutation("digits_of_a_table", "repr(float(value)) if", 'f"{float(value):.15g}" if'),),
    "test_history.py": (
        Mutation(
            "later_pieces",
            '.resize_dimension("time", before + piece.time.size)',
            '.resize_dimension("time", piece.time.size)',
        ),
    ),
    "test_vtk.py": (
        Mutation("time_of_a_frame", 'timestep="{time!r}"', 'timestep="{k}"'),
        Mutation("velocity_of_a_mode", "-omega * math.sin(phases[k])", "omega * math.sin(phases[k])"),
        Mutation("folder_of_another", 'all(file.suffix == ".vtu" for', 'any(file.suffix == ".vtu" for'),
    ),
    "test_vtk_fields.py": (
        Mutation("sign_of_stress", "strain = -self.height * curvature", "strain = self.height * curvature"),
        Mutation("energy_of_a_cell", "(1.0 - share) ** 2, 2.0 * share", "(1.0 - share) ** 2, share"),
    ),
    "test_vtk_impacts.py": (
        Mutation("reaction_on_the_ball", "-values[pair] if reaction else values[pair]", "values[pair]"),
    ),
    "test_vtkhdf.py": (
        Mutation("offsets_of_frames", "size * np.arange(count, dtype=np.int64)", "np.arange(count, dtype=np.int64)"),
    ),
    "test_movie.py": (
        Mutation("slow_motion", "(chosen.size - 1) / fps / shown", "(chosen.size - 1) * fps / shown"),
        Mutation("impact_between_frames", "chosen[:1], chosen[:1], chosen])[:-2]", "chosen[:1], chosen])[:-1]"),
    ),
    "test_figures.py": (
        Mutation("dots_of_a_scan", 'moving = scan.steadiness != "periodic"', 'moving = scan.steadiness == "periodic"'),
    ),
    "test_impact_record.py": (Mutation("degrees", "np.degrees(impacts.phase[inside])", "impacts.phase[inside]"),),
    "test_result_directory.py": (
        Mutation("old_summary_stays", "if name == SUMMARY or name not in names)", "if name not in names)"),
        Mutation("shared_lock", "fcntl.LOCK_EX | fcntl.LOCK_NB", "fcntl.LOCK_SH | fcntl.LOCK_NB"),
    ),
    "test_damaged_results.py": (
        Mutation("checksum_of_pictures", "return checksum(path) != expected", "return not path.exists()"),
    ),
    "test_pictures.py": (Mutation("two_movies", "(movies - names if names & movies else frozenset())", "frozenset()"),),
    "test_inputs.py": (
        Mutation(
            "truth_for_a_number",
            "isinstance(value, bool) or not isinstance(value, numbers.Real)",
            "not isinstance(value, numbers.Real)",
        ),
        Mutation("masked_numbers", "if _is_endless(value) or _is_masked(value):", "if _is_endless(value):"),
    ),
    "test_recorded_base.py": (Mutation("lost_sample", "UNEVEN = 0.25", "UNEVEN = 2.5"),),
    "test_mesh_files.py": (
        Mutation("branch", 'require(degree[busy] <= 2, "mesh.file"', 'require(degree[busy] <= 3, "mesh.file"'),
    ),
    "test_convergence_study.py": (
        Mutation("bound_left_out", '("<= " if table.recommended_is_bound[j] else "")', '""'),
        Mutation("three_standard_errors", "np.hypot(self.scatter, self.scatter[self._finest])", "self.scatter"),
    ),
    "test_identification.py": (
        Mutation("half_power_crossing", "share * (f[outer] - f[i])", "0.5 * (f[outer] - f[i])"),
        Mutation("interval_of_a_fit", "quantile(freedom, 0.975)", "quantile(freedom, 0.6)"),
    ),
    "test_regimes.py": (
        Mutation("repeats", "window.cycles // (rules.repeats + 1)", "window.cycles // rules.repeats"),
        Mutation("phase_that_wraps", "    turn -= 2.0 * np.pi * np.round(turn / (2.0 * np.pi))", "    turn += 0.0"),
    ),
    "test_branches.py": (
        Mutation(
            "unexplained_change",
            "if (change > explained or (change - explained) % 2) and step > RESOLVED:",
            "if change < 0 and step > RESOLVED:",
        ),
        Mutation(
            "multiplier_that_moves_far",
            "if moved > MOST_MOVED and step > RESOLVED:",
            "if moved < 0.0 and step > RESOLVED:",
        ),
    ),
}
"""By the file of tests that finds them."""


def findings(tests: str, mutation: Mutation | None) -> dict[str, str]:
    """The first test of a file that fails with a mutation, or with none, and what it says.

    Raises
    ------
    SystemExit
        If pytest ends for another reason.
    """
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "checkout"
        shutil.copytree(PACKAGE.parent, copy, ignore=LEFT_OUT)
        if mutation is not None:
            mutate(mutation, copy / PACKAGE.name)
        words = [sys.executable, "-m", "pytest", "-x", "-p", "no:cacheprovider", f"tests/{tests}"]
        environment = {**os.environ, "PYTHONPATH": str(copy), "COLUMNS": "200"}
        try:
            done = subprocess.run(
                words, cwd=copy, env=environment, capture_output=True, text=True, timeout=LIMIT, check=False
            )
        except subprocess.TimeoutExpired:
            return {tests: f"not done within {LIMIT:g} s"}
    if done.returncode not in (0, 1):
        sys.exit(f"{shlex.join(words)} ended with status {done.returncode}:\n{done.stdout}{done.stderr}")
    if done.returncode == 0:
        return {}
    return {name: why[:60] for name, why in FAILED.findall(done.stdout)} or {tests: "fails"}


def main(names: list[str]) -> int:
    """Print which test finds which mutation; 1 if one survives."""
    files = {mutation.name: tests for tests, several in MUTATIONS.items() for mutation in several}
    for tests in dict.fromkeys(files[name] for name in names or files if name in files):
        if clean := findings(tests, None):
            sys.exit(f"without a mutation this does not pass: {clean}")
    every = [mutation for several in MUTATIONS.values() for mutation in several]
    return print_findings(names, every, lambda mutation: findings(files[mutation.name], mutation))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
