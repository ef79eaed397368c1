"""Recommended numbers have the accuracy that they are for, against converged values, on uniform and graded meshes."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import femimpact as fi
from femimpact.convergence.cases import Case
from femimpact.convergence.table import agrees, number_of_case

MATERIAL = {"young_modulus": 70e9, "density": 2700.0}
ACCURACIES = (1e-2, 1e-3, 1e-4)


def beam(**section):
    """A cantilever of 0.3 m and one segment."""
    return fi.Beam((fi.Segment(0.3, **MATERIAL, width=0.02, **section),))


EVEN = beam(thickness=2e-3)
STEPPED = fi.Beam((
    fi.Segment(0.1, **MATERIAL, width=0.02, thickness=4e-3, name="thick"),
    fi.Segment(0.08, **MATERIAL, width=0.02, thickness=2e-3, name="thin"),
    fi.Segment(0.12, 210e9, 7850.0, width=0.01, thickness=1e-3, name="steel"),
))  # fmt: skip
SPRINGS = (fi.Spring("inner", 0.2, 800.0), fi.Spring("outer", "tip", 50.0))
STRUCTURES = {
    "uniform": fi.Structure(EVEN),
    "tapered in both": fi.Structure(beam(thickness=4e-3, end_thickness=1.6e-3, end_width=0.012)),
    "stepped": fi.Structure(STEPPED),
    "with box": fi.Structure(EVEN, [fi.PointMass("box", "tip", 0.03)], damping=fi.Rayleigh(0.003, modes=(1, 2))),
    # the inner spring has a node on every third mesh only
    "on springs": fi.Structure(EVEN, [fi.PointMass("collar", 0.13, 0.01)], springs=SPRINGS),
    "linear taper": fi.Structure(beam(thickness=4e-3, end_thickness=1e-3)),
    "wedge": fi.Structure(beam(thickness=4e-3, end_thickness=0.2e-3)),
    "widening": fi.Structure(beam(thickness=1.5e-3, end_thickness=3e-3)),
}
MESHES = {
    "uniform": (fi.convergence.OverMeshes.uniform, fi.uniform_mesh, ()),
    "graded": (fi.convergence.OverMeshes.graded, fi.fem.graded_mesh, (4.0,)),
}
WATCHED = (
    fi.convergence.Frequencies(3), fi.convergence.SteadyResponse(("tip", "mid")), fi.convergence.SurfaceStress("root"),
    fi.convergence.SurfaceStress("mid"),
    fi.convergence.SurfaceStress("root", 2), fi.convergence.SupportReaction(),
    fi.convergence.SupportReaction("root.force"),
)  # fmt: skip


def read(name, mesh):
    """The watched values on a mesh, below the first resonance, and their expected orders."""
    system = fi.assemble(STRUCTURES[name], mesh=mesh)
    case = Case("mesh", system, system, base_of(name))
    readings = [reading for one in WATCHED for reading in one.read(case, case)]
    return np.array([reading.value for reading in readings]), np.array([reading.order for reading in readings])


@cache
def base_of(name):
    """A base motion off the resonances."""
    return fi.Sine(0.2e-3, 0.35 * fi.assemble(STRUCTURES[name], elements=24).first_frequency)


@cache
def converged(name):
    """The watched values of 480 elements, which every body and spring has nodes of, with Richardson's term."""
    (coarse, order), (fine, _) = (read(name, fi.uniform_mesh(STRUCTURES[name], n)) for n in (240, 480))
    return fine + (fine - coarse) / (2.0**order - 1.0)


@pytest.mark.parametrize("family", MESHES)
@pytest.mark.parametrize("name", STRUCTURES)
def test_the_mesh_of_a_recommended_number_has_the_accuracy(name, family):
    over, make, more = MESHES[family]
    known = {}
    for counts in ([4, 8, 16, 32], [5, 10, 20]):
        meshes, given = over(STRUCTURES[name], counts, *more), 0
        for accuracy in ACCURACIES:
            table = fi.convergence_study(STRUCTURES[name], meshes, WATCHED, base_of(name), accuracy=accuracy)["mesh"]
            for j, wanted in enumerate(table.recommended):
                if math.isnan(wanted):
                    (note,) = [text for text in table.notes if text.startswith("no number is recommended for ")]
                    assert str(table.name[j]) in note
                    continue
                given += 1
                if wanted not in known:
                    known[wanted] = read(name, make(STRUCTURES[name], int(wanted), *more))[0]
                # a fifth: the references' own errors, and orders that agree within 0.3
                assert abs(known[wanted][j] / converged(name)[j] - 1.0) <= 1.2 * accuracy, (accuracy, table.name[j])
        # most are recommended: of 10 quantities with 3 accuracies
        assert given >= 20


def test_an_order_that_is_not_the_expected_one_leaves_bounds_or_nothing_and_says_why():
    # the middle is no node of these meshes
    meshes = fi.convergence.OverMeshes.graded(STRUCTURES["linear taper"], [5, 10, 20], 4.0)
    for accuracy in ACCURACIES:
        table = fi.convergence_study(
            STRUCTURES["linear taper"], meshes, WATCHED, base_of("linear taper"), accuracy=accuracy
        )["mesh"]
        j = table.index("stress mid")
        assert not agrees(table.fitted_order[j], table.expected_order[j])
        wanted = table.recommended[j]
        assert math.isnan(wanted) or (wanted in table.number and table.recommended_is_bound[j])
        (note,) = [text for text in table.notes if text.startswith("orders off by more than 0.3")]
        assert f"stress mid ({table.fitted_order[j]:.2f})" in note
        said = [text for text in table.notes if text.startswith("no number is recommended for ")]
        assert any("stress mid" in text for text in said) is math.isnan(wanted)


@pytest.mark.parametrize("name", ["with box", "wedge"])
def test_steps_and_modes_of_a_recommended_number_have_the_accuracy(name):
    structure, base = STRUCTURES[name], base_of(name)
    mesh = fi.uniform_mesh(structure, 20)
    full = fi.assemble(structure, mesh=mesh)
    first = fi.solve_modes(full, 1).natural_frequency[0]
    coarse = fi.Newmark(1.0 / (20.0 * base.frequency), allow_coarse_step=True)
    for axis in (fi.convergence.OverSteps(mesh, coarse, 4), fi.convergence.OverModes(mesh, (1, 2, 4, 8, 16, 32))):
        watched = WATCHED[1:4]
        exact = Case(axis.name, full, full, base)
        truth = np.array([reading.value for one in watched for reading in one.read(exact, exact)])
        for accuracy in ACCURACIES:
            table = fi.convergence_study(structure, axis, watched, base, accuracy=accuracy)[axis.name]
            for j, wanted in enumerate(table.recommended):
                if math.isnan(wanted):
                    continue
                if axis.name == "step":
                    case = replace(exact, step=replace(coarse, dt=1.0 / (wanted * first)))
                else:
                    small = fi.reduce(full, int(wanted))
                    case = replace(exact, system=small, integrated=small)
                found = [reading.value for one in watched for reading in one.read(case, exact)]
                assert abs(found[j] / truth[j] - 1.0) <= 1.2 * accuracy


def test_a_number_of_a_case_counts_the_doubt_of_its_reference_and_all_finer_cases():
    number, error = np.array([2.0, 4.0, 8.0, 16.0]), np.array([1e-4, 3e-3, 4e-4, 1e-4])
    # the coarsest is met by chance: a finer one misses
    assert number_of_case(number, error, 0.0, 1e-3) == 8.0
    assert number_of_case(number, error, 7e-4, 1e-3) == 16.0
    assert math.isnan(number_of_case(number, error, 1e-3, 1e-3))
    assert number_of_case(number, error, 0.0, 1e-2) == 2.0
