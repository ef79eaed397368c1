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
    "test_core_tables.py": (
        Mutation("length_of_an_axis", "return sum(math.prod(int(word)", "return max(math.prod(int(word)"),
        Mutation("stub_of_some_rows", "ROWS.findall(source)", "ROWS.findall(source)[:1]"),
    ),
    "test_thick_beams.py": (
        Mutation("cowpers_factor", "(20.0 + 12.0 * nu) * inner**2", "(20.0 + 11.0 * nu) * inner**2"),
        Mutation("slope_of_a_form", "slope = slope - (ratio", "slope = slope + (ratio"),
        Mutation("read_back_of_shear", "shear_lengths=shear if shear.any() else None", "shear_lengths=None"),
        Mutation("order_of_a_thick_beam", "else 0.5 * order", "else order"),
        Mutation("thin_segment_beside", "np.where(squared > 0.0, grid.rot", "np.where(squared >= 0.0, grid.rot"),
    ),
    "test_restitution_over_speed.py": (
        Mutation("speed_of_a_rebound", "restitution_of(hit, approach, c) : 0.0", "restitution_of(hit, 0.0, c) : 0.0"),
        Mutation("slope_of_a_rebound", "(1.0 + restitution + change)[:, None]", "(1.0 + restitution)[:, None]"),
        Mutation("piece_of_a_speed", "slopes, strict=False)]", "slopes[::-1], strict=False)]"),
    ),
    "test_axial_load.py": (
        Mutation("pull_of_a_body", "beyond[middle < place] += force", "beyond[middle < place] += 0.99 * force"),
        Mutation("turn_of_a_body", "force * body.offset, body.offset))", "-force * body.offset, body.offset))"),
        Mutation("spin_of_a_rotary_inertia", "axial_forces(grid, load, lag)", "axial_forces(grid, load, 0.0)"),
        Mutation("ball_on_a_tilted_floor", "free + held + tilt + tilt.T", "free + held + tilt"),
        Mutation("turns_of_a_spin", "Fraction(2.0 * math.pi) * _SYMBOLS", "Fraction(math.pi) * _SYMBOLS"),
        Mutation("node_of_a_jump", "places if np.abs(mesh.nodes - x).min() >", "() if np.abs(mesh.nodes - x).min() >"),
    ),
    "test_meetings.py": (
        Mutation("mass_of_a_meeting", "first_mode=root_mobility([contacts", "first_mode=1.1 * root_mobility([contacts"),
        Mutation("place_of_a_drawn_ball", "apart = exaggeration * meeting.gap", "apart = meeting.gap"),
        Mutation("force_between_balls", "per_force[j] = per_force[first] - ", "per_force[j] = per_force[first] + "),
        Mutation("parted_by_rounding", "np.where(met[:, None], np.abs(project), 0.0)", "0.0 * project"),
        Mutation("balls_that_have_passed", "y[first] - y[second], y_rate", "0.0 * y[second], y_rate"),
        Mutation("impulse_of_vtk", "np.array([first, second])] = 1.0, -1.0", "np.array([first, second])] = 1.0, 1.0"),
    ),
    "test_held_tip.py": (
        Mutation("place_that_is_held", "(name for name in places if np.any(self.point_row(name)))", "iter(places)"),
    ),
    "test_two_halves.py": (
        Mutation(
            "split_of_a_slower_run",
            "if not held.motion or first == end:",
            "if not held.motion or now <= held.driven:",
        ),
    ),
    "test_section_channels.py": (
        Mutation("static_value_of_the_modes", "terms.sum(axis=1), channel", "0.99 * terms.sum(axis=1), channel"),
        Mutation(
            "static_value_of_the_whole",
            '"1 m/s^2 of the base", -full.base_load',
            '"1 m/s^2 of the base", full.base_load',
        ),
        Mutation("static_value_unsaid", "NAMED = 1e-3", "NAMED = 1e-2"),
        Mutation(
            "guessed_outer_fibre",
            "return self.outer_fibre if size is None",
            "return self.outer_fibre or 0.5 * self.rectangle[1] if size is None",
        ),
        Mutation(
            "reaction_under_the_first_drive",
            "for h, load in enumerate(drive.loads):",
            "for h, load in enumerate(drive.loads[:1]):",
        ),
    ),
    "test_spectra.py": (
        Mutation(
            "transient_beside_a_sine", "    if not (dwells or whole):\n        _req", "    if False:\n        _req"
        ),
        Mutation("neighbours_of_a_line", "HANN_BANDWIDTH = 1.5", "HANN_BANDWIDTH = 1.0"),
        Mutation(
            "line_of_the_mean",
            "(self.values[0] ** 2 + 0.5 * np.sum(self.values[1:] ** 2))",
            "0.5 * np.sum(self.values**2)",
        ),
    ),
    "test_slow_modes.py": (
        Mutation(
            "rate_beside_slow_entries",
            '"static_rate": settled(forms.velocity, modes, forms.given)',
            '"static_rate": 0.0 * settled(forms.velocity, modes, forms.given)',
        ),
        Mutation("slow_beside_stops", "able[np.argmin(stiffness[able])]", "able[np.argmax(stiffness[able])]"),
        Mutation("slow_beside_fast", "ORTHOGONAL = 1e-15", "ORTHOGONAL = 1e-3"),
        Mutation("slow_pair", "near |= np.maximum(*both) <= SLOW", "near |= np.maximum(*both) <= 0.0"),
        Mutation(
            "slow_force_of_sticking", "_without_rounding(project @ apart, ", "_without_rounding(project @ constant, "
        ),
        Mutation("slow_flow", "now, -2.0 * sigma * now - kappa * before", "now, -2.0 * sigma * now"),
        Mutation("slow_braked_flow", "is_held = square > HELD * (1.0 + decay)", "is_held = square > 0.0"),
        Mutation("slow_pressed_flow", "WELL_APART = 1e3", "WELL_APART = 1e12"),
    ),
    "test_rest.py": (
        Mutation(
            "momentum_of_a_free_beam",
            "sparse.csr_array(momentum @ momentum.T)",
            "0.999 * sparse.csr_array(momentum @ momentum.T)",
        ),
        Mutation("shape_of_a_pulled_beam", "(displacement - own @ system.point_row(at))", "displacement"),
        Mutation("place_of_a_blow", "spsolve(system.M.tocsc(), row)", "row"),
    ),
    "test_taper.py": (
        Mutation("weights_of_a_taper", "first = m1 / m0", "first = 0.5 * m1 / m0"),
        Mutation("taper_of_mass", "self.mass_per_length[element] * (a * b)", "self.mass_per_length[element] * a"),
    ),
    "test_modes.py": (
        Mutation("beside_rigid_motions", "qr(motions)[0][:, rigid.shape[1] :]", "qr(motions)[0][:, : -rigid.shape[1]]"),
        Mutation("free_motions_of_matrices", "if factor.shape[0] >= system.dofs:", "if True:"),
        Mutation("units_of_dofs", "scale = _scale(matrix)", "scale = np.ones(len(matrix))"),
        Mutation("rounding_of_damping", "np.outer(diagonal, diagonal) + rounding", "np.outer(diagonal, diagonal)"),
        Mutation("coupled_damping", "rounding = 10.0 * system", "rounding = 1e9 * system"),
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
            "for text in warned:\n            _show_warning(text)",
            "for text in ():\n            _show_warning(text)",
        ),
        Mutation("init_over_a_file", 'require(force or not file.exists(), "file"', 'require(True, "file"'),
        Mutation("no_star", "one_sample=curve.peak_is_one_start", "one_sample=False"),
        Mutation(
            "frequency_left_out",
            "    if frequency is not None:\n        one = replace(",
            "    if frequency is None and to is None:\n        one = replace(",
        ),
        Mutation("memory_limit", "limit < LEAST_MEMORY and", "limit < 0.5 * LEAST_MEMORY and"),
    ),
    "test_starts_of_a_run.py": (
        Mutation("rms_of_the_end", "np.sqrt(np.mean(kept**2))", "np.sqrt(np.mean(kept[kept.size // 2 :] ** 2))"),
        Mutation(
            "peak_of_the_run_under_a_force",
            'return "of the whole run" if self.frequency is None else "over the last third"',
            'return "of the whole run"',
        ),
        Mutation(
            "peak_of_a_blow_over_the_last_third",
            "    return abs(response.largest(response.system.default_place).value)\n",
            "    return float(response.steady.peak[0])\n",
        ),
        Mutation(
            "force_of_a_rigid_contact", "    return rigid and name in response.impacts.impactor\n", "    return False\n"
        ),
        Mutation(
            "linear_motion_as_a_sample",
            '"peak_is_one_start": irregular and struck,',
            '"peak_is_one_start": irregular,',
        ),
    ),
    "test_best_case.py": (
        Mutation("designs_beyond_a_limit", "(valued.size - kept.size, valued.size)", "(kept.size, valued.size)"),
        Mutation(
            "margin_within_the_scatter",
            "np.where(self.low > self.high[row], more, np.minimum(more, 0.0))",
            "more",
        ),
    ),
    "test_absorber.py": (
        Mutation(
            "damping_of_an_absorber", '(2.0 * ratio * omega, "free_damping")', '(2.0 * ratio * omega, "acceleration")'
        ),
    ),
    "test_damper_curve.py": (
        Mutation("trace_of_the_half_map", "2.0 * e - (1.0 + e) ** 2 *", "2.0 * e - (1.0 - e) ** 2 *"),
        Mutation("walls_on_the_way", "((later >= math.pi) |", "((later >= 0.0) |"),
        Mutation("share_of_all_runs", "groups.size() / starts", "groups.size() / len(rows)"),
        Mutation("designers_point_is_the_last", "int(np.argmax(lengths)) if", "int(np.argmin(lengths)) if"),
    ),
    "test_report.py": (
        Mutation(
            "warnings_of_the_last_curve",
            '        name if name == heading else f"{heading}, {name}": curve\n',
            "        heading: curve\n",
        ),
        Mutation(
            "stress_in_mm",
            "number_conclusion(label, curve.peak_amplitude, curve.unit,",
            'number_conclusion(label, curve.peak_amplitude, "m",',
        ),
        Mutation("worst_over_left_out", "if plan else (worst_over,)", "if plan else ()"),
        Mutation(
            "page_in_a_foreign_folder",
            'return FILES["study"].name in names and any(',
            'return FILES["study"].name in names or any(',
        ),
    ),
    "test_units.py": (
        Mutation("digits_of_an_interval", "fifth if half - 1 < fifth <= half else half - 1", "half"),
        Mutation(
            "exponent_of_a_readable_number",
            '    return f"{value:.0f}"\n\n\nMINUS',
            "    return text\n\n\nMINUS",
        ),
        Mutation("prefix_of_a_square", "or _POWER_FIRST.match(unit) or", "or"),
    ),
    "test_prepared.py": (
        Mutation(
            "largest_force_of_readings",
            "max(float(np.max(size[steady])), peaks.get(name, 0.0))",
            "float(np.max(size[steady]))",
        ),
    ),
    "test_several_drives.py": (
        Mutation(
            "end_of_a_force_unsaid",
            "if is_force(drive) or part is not drive:",
            "if part is not drive and not is_force(drive):",
        ),
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
    "test_terminal_tables.py": (
        Mutation(
            "digits_of_a_cell",
            "_cell(one, digits.get(i, 5))",
            "_cell(one, digits.get(i, 4))",
        ),
    ),
    "test_study.py": (
        Mutation(
            "unknown_key",
            "(key for key in values if key not in known)",
            "(key for key in values if not key)",
        ),
        Mutation(
            "first_fault_alone",
            "for fault in error.faults]\n        return None",
            "for fault in error.faults[:1]]\n        return None",
        ),
        Mutation("name_of_a_law", '{"loss": "lankarani-nikravesh"}', '{"loss": "hunt-crossley"}'),
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
        Mutation("hole_of_a_tube", "hole = 1.0 - 2.0 * segment.wall", "hole = 1.0 - segment.wall"),
        Mutation("stress_of_an_outer_fibre", "(segment.half_height or math.nan) / (0.5 *", "1.0 or (0.5 *"),
        Mutation("energy_of_a_cell", "(1.0 - share) ** 2, 2.0 * share", "(1.0 - share) ** 2, share"),
    ),
    "test_vtk_impacts.py": (
        Mutation("reaction_on_the_ball", "-values[pair] if reaction else values[pair]", "values[pair]"),
    ),
    "test_vtkhdf.py": (
        Mutation("offsets_of_frames", "size * np.arange(count, dtype=np.int64)", "np.arange(count, dtype=np.int64)"),
    ),
    "test_movie.py": (
        Mutation("slow_motion", "(chosen.size - 1) / fps / span", "(chosen.size - 1) * fps / span"),
        Mutation("impact_between_frames", "chosen[:1], chosen[:1], chosen])[:-2]", "chosen[:1], chosen])[:-1]"),
    ),
    "test_figures.py": (
        Mutation("contacts_drawn_coarsely", "if time[1] - time[0] > wanted:", "if time[1] - time[0] > 1e3 * wanted:"),
        Mutation(
            "pieces_of_a_finer_reading",
            "_call(run, done * parts, (end - done) * parts)",
            "_call(run, done, end - done)",
        ),
        Mutation(
            "force_read_coarsely",
            "READINGS_IN_CONTACT, DRAWN_IN_CONTACT = 10, 20",
            "READINGS_IN_CONTACT, DRAWN_IN_CONTACT = 8, 20",
        ),
    ),
    "test_impact_record.py": (Mutation("degrees", "np.degrees(impacts.phase[inside])", "impacts.phase[inside]"),),
    "test_result_directory.py": (
        Mutation("mark_of_a_run_goes_first", "elif path.name != LOCK:", "else:"),
        Mutation("every_file_is_a_result", "return name in NAMES or any(", "return True or any("),
        Mutation("shared_lock", "fcntl.LOCK_EX | fcntl.LOCK_NB", "fcntl.LOCK_SH | fcntl.LOCK_NB"),
    ),
    "test_damaged_results.py": (
        Mutation("checksum_of_pictures", "return checksum(path) != expected", "return not path.exists()"),
    ),
    "test_preflight.py": (
        Mutation(
            "axis_of_a_force_unlooked_at", 'y" and place.owner in ("base", "force")', 'y" and place.owner == "base"'
        ),
        Mutation(
            "study_that_bends_unsaid", 'attributes.pop("beam_length", 0.0)', '0.0 * attributes.pop("beam_length", 0.0)'
        ),
        Mutation(
            "first_part_alone",
            "for number, part in enumerate(parts, start=1):",
            "for number, part in [*enumerate(parts, start=1)][:1]:",
        ),
        Mutation(
            "run_without_its_plan",
            "for row in rows if row.passed))",
            "for row in rows if row.passed and not row.unit))",
        ),
    ),
    "test_cost.py": (Mutation("pieces_of_drives_uncounted", "PIECE = 300.0", "PIECE = 3.0"),),
    "test_refusals.py": (
        Mutation("more_cycles_than_memory", "require(cycles <= MOST_OF_CYCLES,", "require(cycles <= 1e30,"),
    ),
    "test_parameter_study.py": (
        Mutation("argument_called_gap", ' and place.owner != "function"', ""),
        Mutation("open_side_of_a_stop", "gap if math.isfinite(side) else side", "gap"),
    ),
    "test_inputs.py": (
        Mutation("control_character_in_name", "if NO_NAME.search(", "if NO_NAME.fullmatch("),
        Mutation(
            "truth_for_a_number",
            "isinstance(value, bool) or not isinstance(value, numbers.Real)",
            "not isinstance(value, numbers.Real)",
        ),
        Mutation("masked_numbers", "if _is_endless(value) or _is_masked(value):", "if _is_endless(value):"),
    ),
    "test_record_units.py": (
        Mutation(
            "line_of_units", "if len(cells) == len(columns):\n            yield", "if not cells:\n            yield"
        ),
        Mutation("din_rate", "and not HAS_TIME.search(name)", "or HAS_TIME.search(name) is None"),
        Mutation("gal", '"Gal": (Fraction(1, 100), _ACCELERATION)', '"Gal": (Fraction(1), _ACCELERATION)'),
        Mutation("unit_in_latin_1", 'header.decode("latin-1")', 'header.decode("ascii", "ignore")'),
        Mutation("exponent_with_d", 'block.upper().replace(b"D", b"E")', "block.upper()"),
        Mutation("byte_lost", "swallowed = content[:end].endswith(line) and", "swallowed = False and"),
        Mutation("seconds_of_timedelta", 'time.to_numpy() / np.timedelta64(1, "s")', "time.to_numpy().astype(float)"),
        Mutation("names_read_back", "same = bool(name) and (name, unit) == tuple(other[:2])", "same = bool(name)"),
        Mutation("step_of_peer", 'f"{i * step!r},{sample}"', 'f"{(i + 1) * step!r},{sample}"'),
    ),
    "test_regular_files.py": (Mutation("device_replaced", "target = target_path(path)", "target = file_path(path)"),),
    "test_decay.py": (
        Mutation("unsquared_weights_of_a_slope", "_SLOPE**2 @ window.spread**2", "np.abs(_SLOPE) @ window.spread**2"),
        Mutation("maxima_of_five_cycles", "(2.0 * math.pi * (CYCLES - 1))", "(2.0 * math.pi * CYCLES)"),
        Mutation("rest_before_release", "still < max(stroke, 2)", "still < 99 * max(stroke, 2)"),
        Mutation("clipped_beginning", "begin += last + 1", "begin += last // 2"),
        Mutation("sweep_as_decay", "swept or reason)", "reason)"),
        Mutation("large_ratio", "LARGEST_RATIO = 0.95", "LARGEST_RATIO = 0.55"),
        Mutation("decay_as_sweep", "STAYS, STAYS_BEHIND_MORE = 0.95, 0.5", "STAYS, STAYS_BEHIND_MORE = 0.5, 0.5"),
        Mutation("one_file_of_identify", "as table, atomic_path(directory / IDENTIFIED[1]) as picture:", "as picture:"),
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
    "test_orbits.py": (Mutation("third_rate_of_a_gap", "self.omega * driven)", "0.9 * self.omega * driven)"),),
    "test_switching.py": (
        Mutation("dashpot_of_a_condition", "damped[:, None] * gap], axis", "-damped[:, None] * gap], axis"),
    ),
    "test_response.py": (
        Mutation("one_extreme_that_repeats", "[maximum, minimum, np.sqrt(square / samples)]", "[maximum] * 3"),
    ),
    "test_sweep_levels.py": (
        Mutation("level_of_a_peak", "(base[np.nanargmax(self.peak)] / base)", "(base / base[np.nanargmax(self.peak)])"),
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
