"""Convergence studies: exact solutions met at the derived orders, failures as rows, numbers that keep their promise."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders import done

import femimpact as fi
from femimpact.app.tasks import convergence
from femimpact.app.tasks.convergence import stresses_at_jumps, task_of_convergence
from femimpact.convergence.cases import newmark_frequency, steady_amplitude
from femimpact.convergence.runs import run_statistics
from femimpact.convergence.table import (
    extrapolated,
    fitted_order,
    local_orders,
    number_for,
    observed_order,
    rounding_floor,
)
from femimpact.convergence.table import usable_rows as usable
from femimpact.files import read_csv, write_csv

MESHES = Path(__file__).parents[1] / "meshes"
BEAM = fi.Beam.uniform(length=0.23, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700)
BARE = fi.Structure(BEAM)
BOXED = fi.Structure(BEAM, [fi.PointMass("box", "tip", 0.023)], damping=fi.Rayleigh(0.003, modes=(1, 2)))
BASE = fi.Sine(0.2e-3, 11.0)
EI, RHO_A = BEAM.segments[0].bending_stiffness, BEAM.segments[0].mass_per_length


def shaken_cantilever():
    """Tip relative to the base (m), root moment (N m) and root force (N) of the bare undamped beam: exact."""
    omega, length = 2 * math.pi * BASE.frequency, BEAM.length
    k = (RHO_A * omega**2 / EI) ** 0.25
    c, s, ch, sh = math.cos(k * length), math.sin(k * length), math.cosh(k * length), math.sinh(k * length)
    # the absolute w = U cos + a (cosh - cos) + b (sinh - sin), k its wave number; w''(L) = w'''(L) = 0
    rows = np.array([[ch + c, sh + s], [sh - s, ch + c]])
    a, b = np.linalg.solve(rows, BASE.amplitude * np.array([c, -s]))
    tip = BASE.amplitude * c + a * (ch - c) + b * (sh - s) - BASE.amplitude
    moment = EI * k**2 * (2 * a - BASE.amplitude)
    return abs(tip), abs(moment), abs(EI * k**3 * 2 * b)


# ---- over the mesh --------------------------------------------------------------------------------


WATCHED = [
    fi.convergence.Frequencies(3), fi.convergence.ModeShapes(2), fi.convergence.SteadyResponse("tip"),
    fi.convergence.BendingMoment(), fi.convergence.BendingMoment("root", 2),
    fi.convergence.SurfaceStress(), fi.convergence.SupportReaction(), fi.convergence.SupportReaction("root.force"),
]  # fmt: skip
FAMILIES = {
    "uniform": lambda s: fi.convergence.OverMeshes.uniform(s, [4, 8, 16, 32]),
    "graded": lambda s: fi.convergence.OverMeshes.graded(s, [8, 16, 32, 64], 5.0),
    "refined random": lambda s: fi.convergence.OverMeshes.refinements(fi.fem.random_mesh(s, 6, 2), 3),
}


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("structure", [BARE, BOXED], ids=["bare", "boxed"])
def test_every_quantity_converges_with_the_order_derived_for_it(structure, family):
    table = fi.convergence_study(structure, FAMILIES[family](structure), WATCHED, BASE)["mesh"]
    # the next term of the coarsest mesh that is fitted: under a tenth of an order where meshes halve; a graded one
    # keeps its ratio only in the limit
    np.testing.assert_allclose(table.fitted_order, table.expected_order, atol=0.35)
    # so does the finest pair, whose order the reference does not force; it has none where 1e-10 is met
    last = table.order[-1] - table.expected_order
    assert np.count_nonzero(np.isfinite(last)) >= last.size - 2
    assert np.nanmax(np.abs(last)) < 0.3


@pytest.mark.parametrize("family", [*FAMILIES, "random"])
def test_values_and_errors_are_those_of_the_exact_solutions(family):
    make = FAMILIES.get(family, lambda s: fi.convergence.OverMeshes.random(s, [8, 16, 32], 5))
    watched = [
        fi.convergence.Frequencies(1),
        fi.convergence.SteadyResponse("tip"),
        fi.convergence.SupportReaction(),
        fi.convergence.SupportReaction("root.force"),
    ]
    table = fi.convergence_study(BARE, make(BARE), watched, BASE)["mesh"]
    tip, moment, force = shaken_cantilever()
    first = 1.8751040687119611**2 / (2 * math.pi * BEAM.length**2) * math.sqrt(EI / RHO_A)
    exact = np.array([first, tip, moment, force])
    # Richardson takes the leading term off: what is left is of the next, (h/L)^2 of an error of 1e-6
    np.testing.assert_allclose(table.reference, exact, rtol=3e-8)
    true = np.abs(table.value / exact - 1.0)
    # the table's errors are the true ones, to the error of the reference
    np.testing.assert_allclose(table.error, true, rtol=0.05, atol=6e-8)


def test_the_moment_at_a_clamped_root_misses_a_twelfth_of_h_squared_times_the_inertia_of_the_base():
    table = fi.convergence_study(
        BARE, fi.convergence.OverMeshes.uniform(BARE, [8, 16, 32]), fi.convergence.BendingMoment(), BASE
    )["mesh"]
    moment = shaken_cantilever()[1]
    load = RHO_A * (2 * math.pi * BASE.frequency) ** 2 * BASE.amplitude
    # h^2 EI w''''/12 with EI w'''' = rho A omega^2 ub; the part of order 4 is (h/L)^2 of it
    np.testing.assert_allclose(np.abs(table.value[:, 0] - moment), table.size**2 * load / 12, rtol=0.05)


def test_the_energy_distance_of_a_shape_is_the_root_of_twice_its_frequencys_error():
    watched = [fi.convergence.Frequencies(2), fi.convergence.ModeShapes(2)]
    table = fi.convergence_study(BARE, fi.convergence.OverMeshes.uniform(BARE, [8, 16, 32, 64]), watched)["mesh"]
    for i in (1, 2):
        f, shape = (table.error[:, table.index(f"{name} {i}")] for name in ("frequency", "shape"))
        # |u_h - u|_E^2 = lambda |u_h - u|_M^2 + lambda_h - lambda, whose first part is of order 8
        np.testing.assert_allclose(shape**2, 2 * f, rtol=0.02)


def test_a_recommended_number_gives_the_accuracy_and_not_much_more():
    accuracy = 1e-5
    axis = fi.convergence.OverMeshes.uniform(BARE, [2, 4, 16, 64])
    table = fi.convergence_study(
        BARE, axis, [fi.convergence.Frequencies(3), fi.convergence.SurfaceStress()], BASE, accuracy=accuracy
    )["mesh"]
    for i, number in enumerate(table.recommended):
        counts = [int(number), 128, 256]
        watched = fi.convergence.Frequencies(3) if i < 3 else fi.convergence.SurfaceStress()
        found = fi.convergence_study(BARE, fi.convergence.OverMeshes.uniform(BARE, counts), watched, BASE)["mesh"]
        error = found.error[0, i if i < 3 else 0]
        # rounding up to a whole element, and an order fitted to meshes that are coarse
        assert 0.3 * accuracy < error < 1.1 * accuracy
    assert table.number_for_all == table.recommended.max()


def test_a_case_that_fails_is_a_row_with_its_reason():
    structure = replace(BARE, masses=(fi.PointMass("collar", 0.1, 0.01),))
    axis = fi.convergence.OverMeshes.uniform(structure, [1, 4, 8])
    table = fi.convergence_study(structure, axis, fi.convergence.Frequencies(1))["mesh"]
    assert table.failure.tolist() == [
        "mesh.elements = 1: must be >= 2: one for each stretch between joints and attachments", "", ""
    ]  # fmt: skip
    np.testing.assert_array_equal(np.isfinite(table.value[:, 0]), [False, True, True])


def test_a_family_of_files_is_sorted_and_a_bad_file_is_a_row(tmp_path):
    structure = fi.load_study(MESHES / "stepped_cantilever.toml").structure
    bad = tmp_path / "bad.msh"
    bad.write_text("no mesh")
    files = [MESHES / f"graded_{n}.msh" for n in (24, 6, 12, 48)]
    axis = fi.convergence.OverMeshes.files([*files, bad])
    table = fi.convergence_study(structure, axis, [fi.convergence.Frequencies(2), fi.convergence.ModeShapes(2)])["mesh"]
    assert table.label.tolist() == ["bad.msh", *(f"graded_{n}.msh" for n in (6, 12, 24, 48))]
    assert "bad.msh': must be a mesh that meshio can read as gmsh: it is not in this format" in table.failure[0]
    # gmsh's geometric lengths keep their ratio only as they get many
    np.testing.assert_allclose(table.fitted_order, table.expected_order, atol=0.35)


def test_meshes_that_keep_their_longest_element_have_errors_and_no_order():
    # the half at the root is refined, the other one is one element
    half = BEAM.length / 2
    local = [fi.fem.Mesh(np.append(np.linspace(0, half, n + 1), BEAM.length)) for n in (2, 4, 8)]
    table = fi.convergence_study(
        BARE, fi.convergence.OverMeshes(tuple(local)), [fi.convergence.Frequencies(2), fi.convergence.ModeShapes(1)]
    )["mesh"]
    assert np.all(np.isnan(table.order))
    assert np.all(np.isnan(table.fitted_order))
    said = "no order is fitted: the longest element of 5 elements, 0.115 m, is no smaller than that of 3 elements; "
    assert [note.startswith(said) for note in table.notes] == [True, *[False] * (len(table.notes) - 1)]
    # the errors are those from the exact frequency, to the h^6 that halving each element once leaves of 1e-3
    exact = 1.8751040687119611**2 / (2 * math.pi * BEAM.length**2) * math.sqrt(EI / RHO_A)
    np.testing.assert_allclose(table.error[:, 0], table.value[:, 0] / exact - 1.0, rtol=0.05)
    # they stall at that of the element which stays
    assert 0.5 < table.error[2, 0] / table.error[1, 0] < 1.0
    # the number of a case, or none: nothing is extrapolated
    for wanted, error in zip(table.recommended, table.error.T, strict=True):
        met = table.number[error <= 1e-3]
        assert (wanted == met[0]) if met.size else math.isnan(wanted)


def test_an_order_is_of_sizes_that_fall():
    h, error = np.array([0.4, 0.2, 0.2, 0.1]), np.array([16.0, 4.0, 3.0, 1.0])
    assert math.isnan(fitted_order(h, error, 0.0))
    np.testing.assert_allclose(local_orders(h, error, 0.0), [np.nan, 2.0, np.nan, math.log2(3.0)])
    assert fitted_order(h[[0, 1, 3]], error[[0, 1, 3]], 0.0) == pytest.approx(2.0)


def test_a_place_that_does_not_move_has_no_relative_error():
    pinned = replace(BARE, supports=(fi.Support("pinned", "root"), fi.Support("pinned", "tip")))
    axis = fi.convergence.OverMeshes.uniform(pinned, [2, 4, 8])
    table = fi.convergence_study(pinned, axis, fi.convergence.SteadyResponse(("tip", "mid")), BASE)["mesh"]
    np.testing.assert_array_equal(table.value[:, 0], 0.0)
    assert np.all(np.isnan(table.error[:, 0]))
    assert np.all(np.isnan([table.floor[0], table.recommended[0]]))
    assert table.fitted_order[1] == pytest.approx(4.0, abs=0.2)


# ---- over the step and the modes ------------------------------------------------------------------


def test_over_steps_every_quantity_is_of_order_two_against_the_one_exact_in_time():
    mesh = fi.uniform_mesh(BOXED, 16)
    axis = fi.convergence.OverSteps(mesh, fi.Newmark(1e-3), 3)
    watched = [
        fi.convergence.Frequencies(1),
        fi.convergence.SteadyResponse(("tip", "mid")),
        fi.convergence.BendingMoment(),
        fi.convergence.SupportReaction(),
    ]
    table = fi.convergence_study(BOXED, axis, watched, BASE)["step"]
    # the next term: (omega dt)^2/10 below 1e-3
    np.testing.assert_allclose(table.fitted_order, 2.0, atol=0.02)
    f = fi.solve_modes(fi.assemble(BOXED, mesh=mesh), 1).natural_frequency[0]
    assert table.reference[0] == f
    np.testing.assert_allclose(table.number, 1.0 / (f * table.size))


def test_the_frequency_of_average_acceleration_is_the_arc_tangents():
    f, dt = np.array([1.0, 20.0, 300.0]), 1e-3
    exact = np.arctan(math.pi * f * dt) / (math.pi * dt)
    np.testing.assert_allclose(newmark_frequency(f, fi.Newmark(dt)), exact, rtol=1e-12)


@pytest.mark.parametrize("method", [fi.Newmark(5e-3), fi.Newmark(5e-3, beta=0.3, gamma=0.6)])
def test_the_steady_amplitude_of_steps_is_that_of_a_run(method):
    damped = replace(BOXED, damping=fi.Rayleigh(0.1, modes=(1, 2)))
    system, base = fi.reduce(fi.assemble(damped, elements=4), 2), fi.Sine(1e-4, 5.0)
    run = fi.integrate(system, base, method, 12.0, fi.Recorder(("tip",), start=8.0, ledger=False))
    # 40 steps a period, whole periods: the first harmonic of the samples is the amplitude
    samples = run["tip"][1:801]
    amplitude = abs(2.0 * np.mean(samples * np.exp(-2j * math.pi * np.arange(800) / 40)))
    exact = abs(complex(system.point_row("tip") @ steady_amplitude(system, base, method)))
    # e^(-0.1 * 33 rad/s * 8 s) of the transient is left
    assert amplitude == pytest.approx(exact, rel=1e-10)


def test_over_the_modes_a_root_moment_is_of_order_two_a_force_of_one_and_a_tip_of_five():
    axis = fi.convergence.OverModes(fi.uniform_mesh(BARE, 120), (4, 6, 8, 12, 16))
    watched = [
        fi.convergence.SteadyResponse("tip"),
        fi.convergence.BendingMoment(),
        fi.convergence.SupportReaction(),
        fi.convergence.SupportReaction("root.force"),
    ]
    table = fi.convergence_study(BARE, axis, watched, BASE)["modes"]
    np.testing.assert_array_equal(table.expected_order, [5, 2, 2, 1])
    # n stands for n + 1/2 or so: at n = 6 that is worth a few per cent of the order
    np.testing.assert_allclose(table.fitted_order, table.expected_order, rtol=0.15)
    full = fi.assemble(BARE, elements=120)
    assert table.reference[0] == abs(complex(full.point_row("tip") @ steady_amplitude(full, BASE)))


# ---- with contacts --------------------------------------------------------------------------------

BALL = fi.Impactor("ball", "tip", 3.4e-3, 4e-3, fi.KelvinVoigt(restitution=0.6, contact_time=2e-3))
RATTLING = replace(BOXED, impactors=(BALL,))


@pytest.mark.impacts
def test_statistics_of_runs_have_a_scatter_and_equal_meshes_no_difference():
    mesh = fi.uniform_mesh(RATTLING, 4)
    watched = fi.convergence.ContactStatistics(starts=3, cycles=48)
    axis = fi.convergence.OverMeshes((mesh, fi.fem.Mesh(mesh.nodes, mesh.points, mesh.regions)))
    table = fi.convergence_study(RATTLING, axis, watched, fi.Sine(2e-4, 5.0), modes=2)["mesh"]
    assert np.all(table.scatter > 0.0)
    np.testing.assert_array_equal(table.error, 0.0)
    assert not np.any(table.meaningful)
    assert np.all(np.isnan(table.expected_order))
    assert math.isnan(table.number_for_all)


def test_a_difference_means_something_beyond_three_standard_errors_of_both():
    value, scatter = np.array([[1.5], [1.27], [1.0]]), np.array([[0.08], [0.08], [0.06]])
    table = fi.convergence.ConvergenceTable(
        axis="mesh", label=np.array(["a", "b", "c"]), number=[1.0, 2.0, 4.0], size=[4.0, 2.0, 1.0],
        failure=np.array(["", "", ""]), name=np.array(["rms"]), unit=np.array(["m"]), value=value,
        error=np.abs(value - 1.0), order=np.full((3, 1), np.nan), scatter=scatter, fitted_order=[np.nan],
        expected_order=[np.nan], reference=[1.0], floor=[np.nan], recommended=[2.0], accuracy=1e-3,
    )  # fmt: skip
    # hypot(0.08, 0.06) = 0.1: 0.27 is beyond three of the one error, and within three of both
    assert table.meaningful[:, 0].tolist() == [True, False, False]


@pytest.mark.impacts
@pytest.mark.parametrize("at", ["tip", "mid"])
def test_the_peak_of_a_run_is_the_exact_one_of_its_cycles(at):
    system, base = fi.reduce(fi.assemble(RATTLING, elements=4), 2), fi.Sine(2e-4, 5.0)
    found, _ = run_statistics(system, base, fi.EventDriven(), 48 / 5.0, at, 16)
    dense = fi.EventDriven(samples_per_cycle=2000)
    run = fi.integrate(system, base, dense, 48 / 5.0, fi.Recorder((at,)))
    sampled = np.abs(run[at][run.time > 32 / 5.0]).max()
    # 2000 samples a cycle of both modes miss a crest by (omega dt)^2/8 at most, seen once in the whole window
    assert sampled <= found["peak"] * (1 + 1e-9)
    assert found["peak"] == pytest.approx(sampled, rel=1e-3)


# ---- orders ---------------------------------------------------------------------------------------


def test_power_laws_are_found_again():
    h = np.array([1.0, 0.5, 0.2, 0.1])
    for p in (1.0, 2.0, 3.7):
        value = 5.0 + 0.3 * h**p
        assert observed_order(h, value) == pytest.approx(p, rel=1e-9)
        assert extrapolated(value[2], value[3], 2.0, p) == pytest.approx(5.0, rel=1e-12)
        assert fitted_order(h, 0.3 * h**p, 0.0) == pytest.approx(p, rel=1e-12)
        # 0.3 h^p = 0.01 at h = (1/30)^(1/p), and the number is 1/h
        assert number_for(1 / h, 0.3 * h**p, p, 0.01, 0.0) == min(
            math.ceil(30 ** (1 / p) * (1 - 1e-12)), next((n for n in 1 / h if 0.3 * n**-p <= 0.01), math.inf)
        )
    assert math.isnan(number_for(1 / h, 0.3 * h**2, 2.0, 1e-9, 1e-8))


def test_rounding_ends_the_rows_that_converge_and_names_its_floor():
    h = 0.5 ** np.arange(8)
    value = 1.0 + 1e-2 * h**4
    value[5:] += [3e-8, -2e-8, 4e-8]
    # the first spoiled row still falls, from 2.3e-6 by a factor of 20
    assert usable(h, value, 4.0) == 6
    assert 3e-8 < rounding_floor(value, 6) < 1e-7
    assert usable(h, 1.0 + 1e-2 * h**4, 4.0) == 8


def test_the_floor_of_the_first_frequency_is_seen_on_fine_meshes():
    table = fi.convergence_study(BARE, fi.convergence.OverMeshes.uniform(BARE, [8, 32, 128, 512, 1024, 2000]))["mesh"]
    # read from the stiffness factor: eps N^2 at most
    assert 1e-15 < table.floor[0] < 1e-9
    assert any(note.startswith("round-off floor: reached") for note in table.notes)
    # what rounding spoils does not enter the order
    assert table.fitted_order[0] == pytest.approx(4.0, abs=0.1)


# ---- tables, files and the command ----------------------------------------------------------------


@pytest.fixture(scope="module")
def small_study():
    axes = [
        fi.convergence.OverMeshes.uniform(BOXED, [2, 4, 8]),
        fi.convergence.OverModes(fi.uniform_mesh(BOXED, 8), (1, 2, 4)),
    ]
    return fi.convergence_study(BOXED, axes, [fi.convergence.Frequencies(2), fi.convergence.BendingMoment()], BASE)


def test_a_table_goes_to_csv_pandas_and_xarray_and_back(small_study, tmp_path):
    table = small_study["mesh"]
    read = read_csv(write_csv(tmp_path / "mesh.csv", *table.columns()))
    frame, data = table.to_pandas(), table.to_xarray()
    assert (tmp_path / "mesh.csv").read_text().startswith("case,number,size [m],frequency_1 [Hz],")
    for i, key in enumerate(("frequency_1", "frequency_2", "moment_EI_w2_root")):
        np.testing.assert_array_equal(read[key], table.value[:, i])
        np.testing.assert_array_equal(frame[f"{key}_error"], table.error[:, i])
        np.testing.assert_array_equal(data["order"].isel(quantity=i), table.order[:, i])
    assert frame.attrs["units"]["moment_EI_w2_root"] == "N m"
    with pytest.raises(fi.InputError, match="did you mean 'frequency 1'"):
        table.index("frequency1")
    with pytest.raises(fi.InputError, match="known: mesh, modes"):
        small_study["step"]


def test_a_printed_table_holds_every_quantity_its_problem_and_the_reasons_of_cases_without_values(tmp_path):
    bad = tmp_path / "bad.msh"
    bad.write_text("no mesh")
    structure = fi.load_study(MESHES / "stepped_cantilever.toml").structure
    files = [bad, *(MESHES / f"graded_{n}.msh" for n in (6, 12, 24))]
    watched = [
        fi.convergence.Frequencies(4),
        fi.convergence.ModeShapes(3),
        fi.convergence.SurfaceStress("joint"),
        fi.convergence.SurfaceStress("joint", side="left"),
    ]
    study = fi.convergence_study(structure, fi.convergence.OverMeshes.files(files), watched, BASE)
    table, shown = study["mesh"], repr(study)
    assert shown == repr(table)
    lines = shown.splitlines()
    assert max(map(len, lines)) <= 80
    assert lines[0] == "Linear response without contacts, base motion of 0.2 mm at 11 Hz"
    for name in table.name:
        # its errors and its orders
        assert sum(line.startswith(f"{name}  ") for line in lines) == 2
    assert any(line.startswith("bad.msh: ") for line in lines)
    assert "it is not in this format" in " ".join(shown.split())
    assert "with impacts" in shown
    assert "<pre>" in table._repr_html_()


def test_a_recommended_number_that_the_coarsest_case_has_is_a_bound_in_print_csv_and_xarray(tmp_path):
    axis = fi.convergence.OverModes(fi.uniform_mesh(BOXED, 8), (1, 2, 4))
    for accuracy in (0.5, 1e-4):
        table = fi.convergence_study(BOXED, axis, fi.convergence.BendingMoment(), BASE, accuracy=accuracy)["modes"]
        met = bool(table.error[0, 0] <= accuracy)
        assert table.recommended_is_bound.tolist() == [met]
        assert ("<= 1 " in repr(table)) is met
        path = write_csv(tmp_path / "summary.csv", *table.summary())
        assert path.read_text().splitlines()[1].endswith(str(met))
        assert bool(table.to_xarray()["recommended_is_bound"][0]) is met


def test_print_says_how_many_of_its_cases_it_shows():
    table = fi.convergence_study(
        BARE, fi.convergence.OverMeshes.uniform(BARE, range(2, 12)), fi.convergence.Frequencies(1)
    )["mesh"]
    assert repr(table).splitlines()[:2] == [
        "Free vibration of the structure without contacts", "Over the mesh: relative errors, 6 of 10 cases"
    ]  # fmt: skip


def test_a_figure_has_a_curve_a_quantity_and_a_slope_an_order(small_study, tmp_path):
    axis = fi.figures.convergence(small_study["mesh"], ax=fi.figures.OffScreen())
    dashed = [line for line in axis.lines if str(line.get_label()).startswith("reference: order")]
    assert len(dashed) == 2
    # their names are in the legend alone, and touch no curve
    assert not [text for text in axis.texts if "order" in text.get_text()]
    assert axis.get_legend().get_window_extent().x0 >= axis.get_window_extent().x1
    for line, order in zip(dashed, (2.0, 4.0), strict=True):
        x, y = np.log(line.get_xdata()), np.log(line.get_ydata())
        assert np.polyfit(x, y, 1)[0] == pytest.approx(order, rel=1e-9)
    fi.figures.save_figure(axis, tmp_path / "mesh.png")
    only = fi.figures.convergence(small_study["modes"], ["moment EI w'' root"], ax=fi.figures.OffScreen())
    said = ["moment EI w'' root", "reference", "accuracy asked for"]
    assert [text.get_text().split(":")[0] for text in only.get_legend().get_texts()] == said


HALVES = [fi.fem.Mesh(np.append(np.linspace(0, BEAM.length / 2, n + 1), BEAM.length)) for n in (2, 4, 8)]
RESPONSE = [
    fi.convergence.SteadyResponse("tip"),
    fi.convergence.BendingMoment(),
    fi.convergence.SupportReaction("root.force"),
]
DRAWN = {
    "slopes of 2, 4 and 8": (
        fi.convergence.OverMeshes.uniform(BARE, [4, 8, 16]),
        [fi.convergence.Frequencies(2), fi.convergence.ModeShapes(2)],
    ),
    "three meshes": (fi.convergence.OverMeshes.uniform(BARE, [2, 3, 4]), fi.convergence.Frequencies(1)),
    "round-off from the coarsest mesh on": (
        fi.convergence.OverMeshes.uniform(BARE, [200, 400, 800, 1600]),
        fi.convergence.Frequencies(3),
    ),
    "flat curves": (fi.convergence.OverMeshes(tuple(HALVES)), fi.convergence.Frequencies(2)),
    "steps": (fi.convergence.OverSteps(fi.uniform_mesh(BARE, 8), fi.Newmark(1e-3), 3), RESPONSE),
    "slopes of 1, 2 and 5 over modes": (fi.convergence.OverModes(fi.uniform_mesh(BARE, 60), (4, 6, 8, 12)), RESPONSE),
}


@pytest.mark.parametrize("name", DRAWN)
def test_no_word_of_a_figure_touches_a_curve(name):
    from matplotlib.legend import Legend
    from matplotlib.text import Text

    over, watched = DRAWN[name]
    study = fi.convergence_study(BARE, over, watched, BASE)
    axis = fi.figures.convergence(study[over.name], ax=fi.figures.OffScreen())
    axis.figure.draw_without_rendering()
    words = [text for text in axis.findobj(Text) if text.get_text() and text.get_visible()]
    boxes = [word.get_window_extent() for word in (*words, *axis.findobj(Legend))]
    curves = [line.get_transform().transform_path(line.get_path()) for line in axis.lines]
    assert len(curves) > 2
    assert not [box for box in boxes for curve in curves if curve.intersects_bbox(box, filled=False)]


def test_panels_hold_every_quantity_once_and_no_two_curves_of_one_look(tmp_path):
    axis = fi.convergence.OverMeshes.uniform(BOXED, [4, 8, 16])
    watched = [
        fi.convergence.Frequencies(4),
        fi.convergence.ModeShapes(4),
        fi.convergence.SteadyResponse(),
        fi.convergence.SurfaceStress(),
        fi.convergence.SupportReaction(),
    ]
    table = fi.convergence_study(BOXED, axis, watched, BASE)["mesh"]
    drawn = fi.figures.convergence_panels(table, fi.figures.OffScreen())
    assert [axis.get_title() for axis in drawn] == [
        "natural frequencies", "mode shapes", "displacements", "forces, moments and stresses"
    ]  # fmt: skip
    shown = []
    for axis in drawn:
        curves = [
            line
            for line in axis.lines
            if ": order " in line.get_label() and not line.get_label().startswith("reference")
        ]
        assert len({(line.get_color(), line.get_marker()) for line in curves}) == len(curves)
        shown += [line.get_label().split(": order")[0] for line in curves]
    assert sorted(shown) == sorted(table.name.tolist())
    fi.figures.save_figure(drawn, tmp_path / "panels.png")


def test_meshes_of_one_longest_element_are_drawn_over_their_number():
    local = [fi.fem.Mesh(np.append(np.linspace(0, BEAM.length / 2, n + 1), BEAM.length)) for n in (2, 4, 8)]
    table = fi.convergence_study(BARE, fi.convergence.OverMeshes(tuple(local)), fi.convergence.Frequencies(1))["mesh"]
    axis = fi.figures.convergence(table, ax=fi.figures.OffScreen())
    np.testing.assert_array_equal(axis.lines[0].get_xdata(), [3, 5, 9])
    assert axis.get_xlabel() == "elements"


def test_a_drawn_mesh_shows_regions_points_and_sections(tmp_path):
    mesh = fi.read_mesh(MESHES / "graded_12.msh")
    structure = fi.load_study(MESHES / "stepped_cantilever.toml").structure
    axis = fi.figures.beam_mesh(mesh, structure, ax=fi.figures.OffScreen())
    assert {text.get_text() for text in axis.get_legend().get_texts()} == {"thick: 6 elements", "thin: 6 elements"}
    assert {text.get_text() for text in axis.texts} == {"root", "joint", "mid", "tip"}
    # a side 1 mm and one 0.5 mm from the axis
    heights = {
        round(float(np.abs(path.vertices[:, 1]).max()), 9) for c in axis.collections[:3] for path in c.get_paths()
    }
    assert {1.0, 0.5} <= heights
    fi.figures.save_figure(axis, tmp_path / "mesh.png")


STEPPED = (MESHES / "stepped_cantilever.toml").read_text(encoding="utf-8")


def test_converge_studies_a_mesh_file_and_its_refinements(tmp_path):
    # without the ball nothing is run: the test is of the files and the text
    text = STEPPED[: STEPPED.index("[[impactor]]")] + STEPPED[STEPPED.index("[damping]") :]
    text = text.replace("stepped_cantilever.msh", "graded_6.msh") + '\n[method]\nname = "event-driven"\n'
    (tmp_path / "graded.toml").write_text(text, encoding="utf-8")
    (tmp_path / "graded_6.msh").write_bytes((MESHES / "graded_6.msh").read_bytes())
    study = fi.load_study(tmp_path / "graded.toml")
    task = task_of_convergence(study)
    results = done(task, tmp_path / "out")
    over_mesh = read_csv(tmp_path / "out" / "quantities_over_mesh.csv")
    assert over_mesh["number"].tolist() == [6, 12, 24, 48, 96]
    over_modes = read_csv(tmp_path / "out" / "quantities_over_modes.csv")["number"].size
    words = f"over 5 meshes of 6 to 96 elements, {over_modes} numbers of modes"
    assert task.plan().costs[0] == f"convergence: quantities of the motion without contacts {words}"
    assert not (tmp_path / "out" / "quantities_over_step.csv").exists()
    assert any("Newmark's method only" in note for note in results.summary["notes"])
    # on the thin side of the joint the same moment gives twice the stress and more
    names = read_csv(tmp_path / "out" / "convergence_summary.csv")["quantity"].tolist()
    assert names[: names.index("stress joint") + 1][-2:] == ["stress root", "stress joint"]
    names = ("quantities_over_mesh", "quantities_over_modes")
    assert {path.name for path in (tmp_path / "out" / "figures").iterdir()} == {f"{name}.png" for name in names}
    assert {f"{name}.csv" for name in names} < {path.name for path in (tmp_path / "out").iterdir()}


@pytest.mark.parametrize("shift", [0.0, 3e-8])
def test_converge_watches_the_largeststresses_at_jumps_of_the_section_only(tmp_path, shift):
    # four equal lengths, thick, thin, thin and thick: two jumps, of which the thin sides have the larger stress
    thickness = (2e-3, 1e-3, 1e-3, 2e-3)
    nodes = np.linspace(0.0, 0.24, 9)
    # single precision puts nodes beside joints
    nodes[1:-1] += shift
    mesh = fi.fem.Mesh(nodes, {"neck": nodes[2]}, {f"part {i}": [2 * i, 2 * i + 1] for i in range(4)})
    beam = fi.Beam([fi.Segment(0.06, 7e10, 2700, 0.02, b, name=f"part {i}") for i, b in enumerate(thickness)])
    study = replace(fi.load_study(MESHES / "stepped_cantilever.toml"), structure=fi.Structure(beam))
    found = stresses_at_jumps(fi.assemble(study.structure, mesh=mesh), study)
    assert found == [fi.convergence.SurfaceStress("neck"), fi.convergence.SurfaceStress(float(nodes[6]), side="left")]


def test_converge_leaves_out_stresses_whose_surface_is_not_known_with_a_note():
    known = fi.Segment(0.12, 7e10, 2700, 0.02, 2e-3, name="known")
    bare = fi.Segment(0.12, 7e10, 2700, area=2e-5, second_moment=1.7e-12, name="bare")
    study = fi.load_study(MESHES / "stepped_cantilever.toml")
    for segments, expected in (
        # the bare one is the thinner, with the larger curvature at the joint
        ((known, bare), [fi.convergence.SurfaceStress("root"), fi.convergence.SurfaceStress("mid", side="left")]),
        ((bare, known), [fi.convergence.SurfaceStress("mid")]),
    ):
        changed = replace(study, structure=fi.Structure(fi.Beam(segments)))
        watched = convergence._watched(fi.assemble(changed.structure, elements=8), changed)
        assert [one for one in watched if isinstance(one, fi.convergence.SurfaceStress)] == expected
        (note,) = convergence._without_stress(changed)
        assert "segment 'bare' are left out: each needs outer_fibre (m)" in note
