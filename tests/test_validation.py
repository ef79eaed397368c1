"""The reference cases: every case passes, and one that does not is an exit status."""

import importlib
import importlib.util
import math
import sys
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from pkgutil import iter_modules

import pytest
from builders import read_csv

from femimpact import (
    EventDriven,
    KelvinVoigt,
    Newmark,
    PointForce,
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
    *_, energy = other_programs.aster_beam()
    off = abs(energy.computed / programs[name].computed - 1)
    assert off == pytest.approx(6.2e-4, rel=0.02) if step == 1e-4 else off < 1e-5


@pytest.mark.parametrize(("steps", "least", "most"), [(256, 2e-4, 8.5e-4), (4096, 1.5e-6, 2.5e-6)])
def test_a_trapezoidal_rule_changes_the_peaks_of_another_program_by_its_step(programs, steps, least, most):
    peak = programs["NLvib, oscillator before a spring: peak, w = 1.41001, stable"].computed
    stop = Stop("wall", "tip", (0.1, math.inf), KelvinVoigt(stiffness=100.0, damping=0.0))
    system = System.from_matrices([[1.0]], [[0.05]], [[1.0]], points={"tip": [1.0]}, stops=[stop])
    push = PointForce("tip", Sine(0.02, 1.41001 / math.tau))
    guess = integrate(system, push, EventDriven(), 60 / push.frequency, initial=State([-0.2], [0.0]))
    orbit = find_orbit(system, push, guess=guess)
    assert float(orbit.steady().peak[0]) == pytest.approx(peak, rel=1e-9)
    method = Newmark(orbit.period / steps, allow_coarse_step=True)
    run = integrate(system, push, method, 200 * orbit.period, initial=orbit.state)
    # a coarse rule has several periodic motions there
    assert least < max(abs(run["tip"][-2 * steps :])) / peak - 1 < most


def test_differences_of_the_bouncing_bar_fall_with_the_mesh(programs):
    for name in ("first contact ends", "second contact begins", "second contact ends", "displacement at 16/3 s"):
        coarse, fine = (programs[f"bouncing bar, {n} elements: {name}"].error for n in (20, 100))
        # between h^(1/2) and h^(3/2) with a fifth of the length
        assert 5**-1.5 < fine / coarse < 5**-0.5, name


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
