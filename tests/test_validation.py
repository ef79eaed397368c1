"""The reference cases: every case passes, and one that does not is an exit status."""

import importlib
import importlib.util
import math
import sys
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from pkgutil import iter_modules

import numpy as np
import pytest
from builders import read_csv

from femimpact import (
    EventDriven,
    KelvinVoigt,
    Newmark,
    PointForce,
    Recorder,
    Sine,
    State,
    Stop,
    System,
    cli,
    find_orbit,
    integrate,
    validation,
)
from femimpact.errors import InputError
from femimpact.validation import REFERENCE_CASES, Case, case_columns, markdown_table, other_programs, run_validation

pytestmark = pytest.mark.impacts

TESTS = Path(__file__).parent
BENCHMARKS = TESTS.parent / "benchmarks"
PAPER = Path(__file__).parents[1] / "docs" / "paper"
GOOD = Case("good", "derived here", "speed", "m/s", 2.0, 2.0, 1e-9, "rounding")
BAD = replace(GOOD, name="a|b", computed=2.1)


@pytest.fixture(scope="module")
def cases():
    shares = []
    found = run_validation(lambda what, share: shares.append((what, share)))
    assert shares[-1] == ("validation", 1.0)
    return found


@pytest.fixture(scope="module")
def programs():
    """The numbers of other programs, by name."""
    found = run_validation(with_programs=True)
    assert len({case.name for case in found}) == len(found)
    return {case.name: case for case in found}


def _check(cases):
    assert [f"{case.name}: {case.computed!r} for {case.reference!r}" for case in cases if not case.passes] == []
    assert [case.name for case in cases if not all((case.source, case.quantity, case.unit, case.reason))] == []


def test_every_case_is_within_its_bound(cases):
    _check(cases)
    # a bound that passes anything bounds nothing
    assert all(0 < case.bound < 0.01 for case in cases)


def _half_digit(number):
    """Half a unit of the last digit of a number, relative to it."""
    digits = Decimal(repr(number).removesuffix(".0"))
    return float(Decimal(10) ** digits.as_tuple().exponent / 2 / abs(digits))


def test_a_bound_of_another_program_is_no_wider_than_what_explains_the_difference(programs):
    _check(programs.values())
    for case in programs.values():
        digits = case.reference != 0 and case.bound < 1.05 * _half_digit(case.reference)
        rounding = case.bound <= 1e-10 or (case.unit == "1" and case.reference in (0.0, 1.0, 2.0))
        assert case.bound < 1.5 * case.error or digits or rounding, case.name


def test_with_their_step_their_digits_are_met(programs):
    pairs = [(name, name.partition(", with their")[0]) for name in programs if ", with their" in name]
    assert len(pairs) == 12
    for stepped, exact in pairs:
        assert 20 * programs[stepped].error < programs[exact].error, exact


@pytest.mark.parametrize("step", [1e-4, 1e-6])
def test_the_beam_of_another_program_tends_to_ours_as_their_step_falls(programs, monkeypatch, step):
    name = "SDNL104, beam between springs: kinetic energy at 0.16 s"
    monkeypatch.setattr(other_programs, "Newmark", lambda _: Newmark(step))
    *_, (_about, _unit, _theirs, energy, *_why) = other_programs.aster_beam()
    off = abs(energy / programs[name].computed - 1)
    assert off == pytest.approx(6.2e-4, rel=0.02) if step == 1e-4 else off < 1e-5


def _orbit_at_a_spring(omega, displacement, velocity):
    """The motion of the oscillator of another program near a state, one cycle long, exact."""
    stop = Stop("wall", "tip", (0.1, math.inf), KelvinVoigt(stiffness=100.0, damping=0.0))
    system = System.from_matrices([[1.0]], [[0.05]], [[1.0]], points={"tip": [1.0]}, stops=[stop])
    push = PointForce("tip", Sine(0.02, omega / math.tau, math.pi / 2))
    run = integrate(system, push, EventDriven(), 1 / push.frequency, initial=State([displacement], [velocity]))
    return find_orbit(system, push, guess=run)


# a state on each of the four motions
STARTS = ((0.0276358, 0.2229514), (0.0739004, 0.1386287), (-0.1311283, 0.3105001), (-0.0996839, 0.0311434))


@pytest.mark.parametrize(("row", "start"), [*zip(other_programs.PEAKS, STARTS, strict=True)])
def test_a_cycle_that_is_nearly_closed_has_the_peak_of_another_program(programs, row, start):
    omega, theirs, _, open_by = row
    (name,) = (name for name in programs if f"peak, w = {omega:g}," in name)
    orbit = _orbit_at_a_spring(omega, *start)
    assert float(orbit.steady().peak[0]) == pytest.approx(programs[name].computed, rel=1e-9)
    # velocities over w: their time is the angle of the force
    scale = np.array([1.0, omega])
    closed = np.concatenate([orbit.state.displacement, orbit.state.velocity]) / scale

    def cycle(off):
        state = State(*np.split(scale * (closed + off), 2))
        kept = Recorder(("tip", "tip.velocity"), interval=orbit.period / 4000)
        run = integrate(orbit.system, orbit.excitation, EventDriven(), orbit.period, kept, state)
        end = np.array([run["tip"][-1], run["tip.velocity"][-1]]) / scale
        return np.max(np.abs(run["tip"])), end - closed - off

    peak, _ = cycle(np.zeros(2))
    changes = [cycle(1e-6 * unit) for unit in np.eye(2)]
    gap = np.array([opened for _, opened in changes]).T / 1e-6
    slope = np.linalg.solve(gap.T, [(changed - peak) / 1e-6 for changed, _ in changes])
    # the smallest gap between the ends with which the peak is theirs
    smallest = (theirs - peak) * slope / (slope @ slope)
    reached, opened = cycle(np.linalg.solve(gap, smallest))
    assert reached == pytest.approx(theirs, abs=5e-8)
    assert np.linalg.norm(opened) == pytest.approx(open_by, rel=0.03)


@pytest.mark.parametrize("steps", [512, 1024, 4096])
def test_their_rule_alone_does_not_have_the_peak_of_another_program(steps):
    orbit = _orbit_at_a_spring(1.25367, *STARTS[1])
    method = Newmark(orbit.period / steps, allow_coarse_step=True)
    run = integrate(orbit.system, orbit.excitation, method, 300 * orbit.period, initial=orbit.state)
    # theirs is 3.1e-4 below
    assert 0 < max(abs(run["tip"][-2 * steps :])) / float(orbit.steady().peak[0]) - 1 < 1e-4


def test_harmonics_and_the_stop_of_octave_explain_a_harmonic_of_another_program(programs):
    case = programs["NLvib, two masses: first harmonic, mass before the spring, w = 0.7541"]
    omega, most, samples = 0.7541, 21, 1024
    K, order = np.array([[1.0, -1.0], [-1.0, 2.0]]), np.arange(1, most + 1)
    angle = np.outer(np.arange(samples) * math.tau / samples, order)
    inverse = np.hstack([np.ones((samples, 1)), np.cos(angle), np.sin(angle)])
    transform = np.linalg.pinv(inverse)
    turn = np.zeros((2 * most + 1, 2 * most + 1))
    turn[order, most + order], turn[most + order, order] = order, -order
    linear = np.kron(K, np.eye(2 * most + 1) + 0.03 * omega * turn) + np.kron(np.eye(2), omega**2 * turn @ turn)
    first = np.s_[: 2 * most + 1]
    force = np.zeros(len(linear))
    force[2 * most + 2] = 0.1
    # one cycle of the motion on the upper branch
    stop = Stop("wall", "first", (1.0, math.inf), KelvinVoigt(stiffness=100.0, damping=0.0))
    points = {"first": [1.0, 0.0], "tip": [0.0, 1.0]}
    system = System.from_matrices(np.eye(2), 0.03 * K, K, points=points, stops=[stop])
    push = PointForce("tip", Sine(0.1, omega / math.tau, math.pi / 2))
    start = State([-0.236047, -0.638571], [0.903316, 0.754309])
    kept = Recorder(("first", "tip"), every=8)
    run = integrate(system, push, Newmark(1 / push.frequency / (8 * samples)), 1 / push.frequency, kept, start)
    found = np.concatenate([transform @ run[place][:samples] for place in points])
    for _ in range(20):
        pressed = inverse @ found[first] - 1
        residual = linear @ found - force
        residual[first] += transform @ (100 * np.maximum(pressed, 0))
        jacobian = linear.copy()
        jacobian[first, first] += transform @ (100 * (pressed > 0)[:, None] * inverse)
        found -= np.linalg.solve(jacobian, residual)
    assert np.linalg.norm(residual) < 1e-12
    cosine, sine = found[[1, most + 1]]
    harmonic = math.hypot(cosine, sine)
    assert harmonic / case.computed - 1 == pytest.approx(1.0e-3, abs=2e-5)
    # the smallest residual with which the harmonic is theirs, and the one at which fsolve stops: 1e-6 n |x|
    direction = np.zeros(len(linear))
    direction[[1, most + 1]] = np.array([cosine, sine]) / harmonic
    smallest = (case.reference - harmonic) / np.linalg.norm(np.linalg.solve(jacobian.T, direction))
    stops_at = 1e-6 * (len(found) + 1) * np.linalg.norm([*found, omega / 0.8])
    assert 0.5 * stops_at < smallest < stops_at


def test_displacements_of_the_bouncing_bar_fall_with_the_mesh_and_with_a_better_mass_matrix(programs):
    def off(what, elements, lumped):
        return programs[f"bouncing bar: {what}, {elements} elements, {lumped} % lumped"].error

    for name in ("first contact ends", "second contact begins", "second contact ends", "displacement at 16/3 s"):
        # between h^(1/2) and h^(3/2) with a fifth of the length
        assert 5**-1.5 < off(name, 100, 50) / off(name, 20, 50) < 5**-0.5, name
    displacement = "displacement at 16/3 s"
    coarse, fine, finest = (off(displacement, elements, 100) for elements in (20, 100, 300))
    assert 5**-0.8 < fine / coarse < 5**-0.7
    assert 3**-0.8 < finest / fine < 3**-0.6
    for elements in (20, 100):
        mean, lumped, consistent = (off(displacement, elements, share) for share in (50, 100, 0))
        assert 1.9 * mean < lumped < 0.9 * consistent
    page = (PAPER / "other_programs.md").read_text(encoding="utf-8")
    stated = [case.computed for name, case in programs.items() if f"bar: {displacement}" in name]
    assert [value for value in stated if f"| {value:.3f} m |" not in page] == []


@pytest.mark.parametrize("page", ["validation", "other_programs"])
def test_names_are_distinct_and_on_the_page(request, page):
    cases = request.getfixturevalue("cases" if page == "validation" else "programs")
    cases = list(cases.values()) if isinstance(cases, dict) else cases
    assert len({case.name for case in cases}) == len(cases)
    table = (PAPER / f"{page}.md").read_text(encoding="utf-8").partition(f"<!-- table {page} -->")[2]
    rows = table.partition("<!-- end of table -->")[0].splitlines()
    for case in cases:
        unit = "" if case.unit == "1" else f" ({case.unit})"
        begin = f"{case.name} | {case.source}" if page == "validation" else f"{case.name}{unit}"
        assert any(row.startswith(f"| {begin} |") for row in rows), case.name
    assert sum(row.startswith("| ") for row in rows) == len(cases) + 2


def test_every_list_of_cases_is_in_the_table():
    modules = [
        importlib.import_module(f"femimpact.validation.{item.name}") for item in iter_modules(validation.__path__)
    ]
    lists = [item for module in modules for name, item in vars(module).items() if name.endswith("CASES")]
    listed = [case for item in lists if item is not REFERENCE_CASES for case in item]
    assert len(lists) > 2
    assert sorted(map(id, listed)) == sorted(map(id, REFERENCE_CASES))


def test_an_error_is_relative_or_absolute_where_the_reference_is_zero():
    assert BAD.error == pytest.approx(0.05)
    assert not BAD.passes
    assert replace(GOOD, reference=0.0, computed=1e-10).passes
    assert not replace(GOOD, computed=math.nan).passes
    assert not replace(GOOD, computed=math.inf).passes


def test_the_command_prints_the_table_and_writes_it(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(validation, "REFERENCE_CASES", (lambda: [GOOD],))
    cli.validate(to=cli.ToFile(tmp_path / "table.csv"))
    printed = capsys.readouterr().out
    assert "speed (m/s)" in printed
    assert printed.endswith("1 of 1 pass\n")
    assert read_csv(tmp_path / "table.csv")["computed"] == [2.0]
    with pytest.raises(InputError, match="exists already"):
        cli.validate(to=cli.ToFile(tmp_path / "table.csv"), quiet=True)
    monkeypatch.setattr(other_programs, "PROGRAMS", (lambda: [GOOD, replace(GOOD, name="of another program")],))
    cli.validate(other_programs=True)
    assert "of another program" in (printed := capsys.readouterr().out)
    assert printed.endswith("2 of 2 pass\n")


@pytest.mark.parametrize("quiet", [False, True])
def test_a_failing_case_makes_the_command_exit_with_1(monkeypatch, capsys, quiet):
    monkeypatch.setattr(validation, "REFERENCE_CASES", (lambda: [GOOD, BAD],))
    with pytest.raises(SystemExit) as ended:
        cli.validate(quiet=quiet)
    assert ended.value.code == 1
    captured = capsys.readouterr()
    assert "femimpact: a|b: error 0.05, bound 1e-09" in captured.err
    assert captured.out.endswith("" if quiet else "1 of 2 pass\n")
    assert ("NO" in captured.out) is not quiet


def test_the_markdown_table_has_one_row_a_case():
    lines = markdown_table([GOOD, BAD]).splitlines()
    assert lines[2] == "| good | derived here | speed (m/s) | 2 | 2 | 0.0e+00 | 1.0e-09 | yes | rounding |"
    assert lines[3].startswith(r"| a\|b |")
    assert case_columns([GOOD, BAD])["passes"] == [True, False]


@pytest.fixture(scope="module")
def scripts():
    """The scripts that plant bugs, by their names."""
    found = {}
    with pytest.MonkeyPatch.context() as patch:
        for name in ("mutations", "mutations_by_tests"):
            spec = importlib.util.spec_from_file_location(name, BENCHMARKS / f"{name}.py")
            found[name] = importlib.util.module_from_spec(spec)
            patch.setitem(sys.modules, name, found[name])
            spec.loader.exec_module(found[name])
        yield found


@pytest.fixture
def mutations(scripts):
    return scripts["mutations"]


def test_a_mutation_is_put_where_its_text_stands_once(mutations, tmp_path):
    (tmp_path / "validation").mkdir()
    for name, text in (("a.py", "x = 1\ny = 2\n"), ("b.py", "y = 2\n"), ("validation/c.py", "x = 1\n")):
        (tmp_path / name).write_text(text, encoding="utf-8")
    mutations.mutate(mutations.Mutation("once", "x = 1", "x = 3"), tmp_path)
    assert (tmp_path / "a.py").read_text(encoding="utf-8") == "x = 3\ny = 2\n"
    for name, text in (("twice", "y = 2"), ("never", "z = 1")):
        with pytest.raises(SystemExit, match=f"{name}: the text must stand in the package exactly once"):
            mutations.mutate(mutations.Mutation(name, text, ""), tmp_path)


def test_each_mutation_has_its_own_name_changes_something_and_names_one_place(scripts):
    by_tests = scripts["mutations_by_tests"].MUTATIONS
    assert [name for name in by_tests if not (TESTS / name).is_file()] == []
    mutations = [*scripts["mutations"].MUTATIONS, *(one for several in by_tests.values() for one in several)]
    assert len({mutation.name for mutation in mutations}) == len(mutations) >= 60
    assert all(mutation.old != mutation.new for mutation in mutations)
    package = scripts["mutations"].PACKAGE
    assert all(scripts["mutations"].place_of(mutation, package).is_file() for mutation in mutations)
