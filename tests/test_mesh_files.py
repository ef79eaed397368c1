"""Mesh files of several formats, damaged ones, and meshes made, refined, graded and random."""

from __future__ import annotations

import runpy
from itertools import pairwise
from pathlib import Path

import meshio
import numpy as np
import pytest

import femimpact as fi

SHIPPED = Path(__file__).parents[1] / "meshes" / "stepped_cantilever.msh"
SEGMENTS = (
    fi.Segment(0.10, 70e9, 2700, 0.02, 2e-3, name="thick"),
    fi.Segment(0.15, 70e9, 2700, 0.02, 1e-3, name="thin"),
)
STEPPED = fi.Structure(fi.Beam(SEGMENTS), [fi.PointMass("box", "tip", 0.02)])
NODES = np.array([0.0, 0.02, 0.05, 0.1, 0.18, 0.25])


# ---- meshes made ----------------------------------------------------------------------------------


def meshes():
    return [
        fi.uniform_mesh(STEPPED, 7), fi.fem.graded_mesh(STEPPED, 7, 5.0), fi.fem.random_mesh(STEPPED, 7, 3),
        fi.fem.Mesh([0.0, 0.1, 0.25], {"joint": 0.1}, {"thick": [0], "thin": [1]}),
    ]  # fmt: skip


@pytest.mark.parametrize("mesh", meshes())
def test_a_refined_mesh_halves_every_element_and_keeps_its_names(mesh):
    fine = mesh.refined()
    np.testing.assert_array_equal(fine.nodes[::2], mesh.nodes)
    np.testing.assert_allclose(np.diff(fine.nodes), np.repeat(np.diff(mesh.nodes) / 2, 2), rtol=1e-12)
    assert fine.points == mesh.points
    for name, members in mesh.regions.items():
        # the same stretch of the beam
        assert np.diff(fine.nodes)[fine.regions[name]].sum() == pytest.approx(np.diff(mesh.nodes)[members].sum())
        assert fine.nodes[fine.regions[name]].min() == mesh.nodes[members].min()
    again = mesh.refined(2)
    np.testing.assert_array_equal(again.nodes, fine.refined().nodes)
    assert again.largest == pytest.approx(mesh.largest / 4, rel=1e-12)


def test_a_mesh_is_not_refined_without_end():
    with pytest.raises(fi.InputError, match=r"times = 17: gives 262144 elements; must give <= 100000"):
        fi.fem.Mesh([0.0, 0.1, 0.2]).refined(17)


@pytest.mark.parametrize("ratio", [0.1, 4.0, 30.0])
def test_element_lengths_of_a_graded_mesh_grow_in_proportion_to_the_stated_line(ratio):
    beam = fi.Structure(fi.Beam.uniform(length=0.2, width=0.02, thickness=1e-3, young_modulus=7e10, density=2700))
    nodes = fi.fem.graded_mesh(beam, 400, ratio).nodes
    lengths, middles = np.diff(nodes), 0.5 * (nodes[1:] + nodes[:-1])
    line = 1.0 + (ratio - 1.0) * middles / 0.2
    # the length of an element against the line at its middle: the next term is (ln r/400)^2/24
    np.testing.assert_allclose(lengths / line, (lengths / line)[0], rtol=1e-4)
    np.testing.assert_array_equal(fi.fem.graded_mesh(beam, 10, 1.0).nodes, fi.uniform_mesh(beam, 10).nodes)


@pytest.mark.parametrize(
    "make", [lambda n: fi.fem.graded_mesh(STEPPED, n, 6.0), lambda n: fi.fem.random_mesh(STEPPED, n, 1)]
)
def test_meshes_made_have_the_joint_and_the_elements_asked_for(make):
    for count in (2, 3, 17):
        mesh = make(count)
        assert mesh.elements == count
        assert 0.10 in mesh.nodes
        covered = np.concatenate([mesh.regions["thick"], mesh.regions["thin"]])
        np.testing.assert_array_equal(covered, np.arange(count))
        assert np.diff(mesh.nodes)[mesh.regions["thick"]].sum() == pytest.approx(0.1, rel=1e-12)
    with pytest.raises(fi.InputError, match=r"mesh\.elements = 1: must be >= 2"):
        make(1)


def test_neighbours_of_a_random_mesh_differ_by_a_factor_of_three_at_most_and_a_seed_is_a_mesh():
    structure = fi.Structure(fi.Beam.uniform(length=0.2, width=0.02, thickness=1e-3, young_modulus=7e10, density=2700))
    lengths = np.diff(fi.fem.random_mesh(structure, 500, 4).nodes)
    assert lengths.max() < 3.0 * lengths.min() * (1 + 1e-9)
    # drawn evenly from 0.5 to 1.5: the spread is 1/sqrt(12) of the mean, here of 500 numbers
    assert np.std(lengths) / np.mean(lengths) == pytest.approx(12**-0.5, rel=0.1)
    np.testing.assert_array_equal(fi.fem.random_mesh(structure, 9, 4).nodes, fi.fem.random_mesh(structure, 9, 4).nodes)
    assert not np.array_equal(fi.fem.random_mesh(structure, 9, 4).nodes, fi.fem.random_mesh(structure, 9, 5).nodes)


# ---- formats --------------------------------------------------------------------------------------


def raw_beam():
    """Six nodes, the tip first, tagged points and lines, in meshio's own terms."""
    x = NODES[::-1]
    lines = np.array([[5, 4], [4, 3], [2, 3], [2, 1], [1, 0]])
    cells = [("vertex", np.array([[2], [0]])), ("line", lines)]
    points = np.column_stack([x, np.zeros((6, 2))])
    return points, cells


def assert_is_the_beam(mesh, regions=("thick", "thin"), names=("joint", "end")):
    # ASCII files carry 16 digits, others the very numbers
    np.testing.assert_allclose(mesh.nodes, NODES, rtol=1e-14, atol=1e-17)
    np.testing.assert_array_equal(mesh.regions[regions[0]], [0, 1, 2])
    np.testing.assert_array_equal(mesh.regions[regions[1]], [3, 4])
    assert mesh.points[names[0]] == pytest.approx(0.1, rel=1e-14)
    assert mesh.points[names[1]] == mesh.points["tip"]


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("version", ["gmsh22", "gmsh"])
def test_gmsh_2_and_4_keep_their_named_points_and_lines(tmp_path, version, binary):
    points, cells = raw_beam()
    if version == "gmsh22":
        # numbers of points and of lines are apart: both have a 1 and a 2
        tags = [np.array([1, 2]), np.array([1, 1, 1, 2, 2])]
        fields = {"joint": [1, 0], "end": [2, 0], "thick": [1, 1], "thin": [2, 1]}
        data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
        raw = meshio.Mesh(points, cells, cell_data=data, field_data={k: np.array(v) for k, v in fields.items()})
        meshio.write(tmp_path / "beam.msh", raw, file_format=version, binary=binary)
        assert_is_the_beam(fi.read_mesh(tmp_path / "beam.msh"))
    else:
        # meshio writes no names of Gmsh 4.1: gmsh's own file has them
        mesh = fi.read_mesh(SHIPPED)
        assert {"thick", "thin"} == set(mesh.regions)
        assert mesh.points["joint"] == pytest.approx(0.1, abs=1e-12)


def test_a_line_that_gmsh_2_repeats_for_its_second_group_is_one_line(tmp_path):
    lines = ["1 1 2 1 1 1 2", "2 1 2 1 2 2 3", "3 1 2 2 2 2 3"]
    path = tmp_path / "two.msh"
    names = '$PhysicalNames\n2\n1 1 "all"\n1 2 "outer"\n$EndPhysicalNames'
    nodes = "$Nodes\n3\n1 0 0 0\n2 0.1 0 0\n3 0.2 0 0\n$EndNodes"
    head = f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n{names}\n{nodes}\n$Elements\n"
    path.write_text(f"{head}3\n" + "\n".join(lines) + "\n$EndElements\n")
    mesh = fi.read_mesh(path)
    np.testing.assert_array_equal(mesh.regions["all"], [0, 1])
    np.testing.assert_array_equal(mesh.regions["outer"], [1])
    # twice in one group it lies on itself
    path.write_text(f"{head}3\n" + "\n".join([*lines[:2], "3 1 2 1 2 2 3"]) + "\n$EndElements\n")
    with pytest.raises(fi.InputError, match=r"2 lines on one another from x = 0\.1 to 0\.2 m"):
        fi.read_mesh(path)


@pytest.mark.parametrize("suffix", [".vtu", ".vtk", ".xdmf"])
def test_formats_without_names_take_arrays_of_whole_numbers_for_names(tmp_path, suffix):
    points, cells = raw_beam()
    lines = [("line", cells[1][1])]
    joint = np.array([0, 0, 1, 0, 0, 0])
    end = np.array([1, 0, 0, 0, 0, 0])
    raw = meshio.Mesh(
        points, lines, point_data={"joint": joint, "end": end}, cell_data={"section": [np.array([4, 4, 4, 7, 7])]}
    )
    meshio.write(tmp_path / f"beam{suffix}", raw)
    assert_is_the_beam(fi.read_mesh(tmp_path / f"beam{suffix}"), ("section 4", "section 7"))


def test_abaqus_sets_are_regions_and_points(tmp_path):
    points, cells = raw_beam()
    sets = {"thick": [np.array([0, 1, 2])], "thin": [np.array([3, 4])]}
    raw = meshio.Mesh(points, [cells[1]], cell_sets=sets, point_sets={"joint": np.array([2]), "end": np.array([0])})
    meshio.write(tmp_path / "beam.inp", raw)
    assert_is_the_beam(fi.read_mesh(tmp_path / "beam.inp"))


@pytest.mark.parametrize("family", ["uniform", "graded", "stepped"])
def test_the_shipped_families_fall_alike_in_all_their_elements(family):
    axis = fi.convergence.OverMeshes.files(sorted(SHIPPED.parent.glob(f"{family}_[0-9]*.msh")))
    assert axis.is_family
    for coarse, fine in pairwise(axis.meshes):
        assert fine.elements == 2 * coarse.elements
        assert fine.points == pytest.approx(coarse.points, rel=1e-9)
        for name, members in coarse.regions.items():
            assert fine.regions[name].size == 2 * members.size


def test_gmsh_makes_the_shipped_meshes_again(tmp_path):
    pytest.importorskip("gmsh")
    script = runpy.run_path(str(SHIPPED.parent / "make_meshes.py"))
    for path in script["main"](tmp_path):
        made, shipped = fi.read_mesh(path), fi.read_mesh(SHIPPED.parent / path.name)
        # the mesher of another version rounds its nodes anew, to its tolerance of 1e-13 or so of the length
        np.testing.assert_allclose(made.nodes, shipped.nodes, rtol=0, atol=1e-11)
        assert made.points == pytest.approx(shipped.points, abs=1e-11)
        assert {name: list(members) for name, members in made.regions.items()} == {
            name: list(members) for name, members in shipped.regions.items()
        }


def test_frequencies_on_a_mesh_are_those_of_every_format(tmp_path):
    points, cells = raw_beam()
    flags = {"thick": [np.array([1, 1, 1, 0, 0])], "thin": [np.array([0, 0, 0, 1, 1])]}
    meshio.write(tmp_path / "beam.vtu", meshio.Mesh(points, [cells[1]], cell_data=flags))
    read = fi.assemble(STEPPED, mesh=fi.read_mesh(tmp_path / "beam.vtu"))
    made = fi.assemble(STEPPED, mesh=fi.fem.Mesh(NODES, {}, {"thick": [0, 1, 2], "thin": [3, 4]}))
    # the file holds the coordinates in base 64, bit by bit
    np.testing.assert_array_equal(fi.solve_modes(read, 4).natural_frequency, fi.solve_modes(made, 4).natural_frequency)


# ---- faults ---------------------------------------------------------------------------------------


def vtk_file(folder, x, lines, y=None):
    points = np.column_stack([x, np.zeros(len(x)) if y is None else y, np.zeros(len(x))])
    meshio.write(folder / "beam.vtk", meshio.Mesh(points, [("line", np.array(lines))]))
    return folder / "beam.vtk"


@pytest.mark.parametrize(
    ("x", "lines", "words"),
    [
        ([0, 1, 2, 3], [[0, 1], [2, 3]], "a gap from x = 1 to 2 m"),
        ([0, 1, 1, 2], [[0, 1], [2, 3]], "a gap at x = 1 m: two nodes there that no line joins"),
        ([0, 1, 1, 2], [[0, 1], [1, 2], [2, 3]], "a line of no length at x = 1 m"),
        ([0, 1, 2, 3], [[0, 1], [1, 2], [2, 3], [0, 1]], "2 lines on one another from x = 0 to 1 m"),
        ([0, 1, 2, 3], [[0, 2], [1, 2], [1, 3]], "3 lines on one another from x = 1 to 2 m"),
        ([0, 1, 2, 3], [[0, 1], [1, 2], [1, 3]], "a branch at (1, 0, 0) m, where 3 lines meet"),
        ([0.5, 1, 2, 3], [[0, 1], [2, 3]], "a gap from x = 1 to 2 m"),
    ],
)
def test_gaps_branches_and_overlaps_are_named_with_their_place(tmp_path, x, lines, words):
    with pytest.raises(fi.InputError) as refused:
        fi.read_mesh(vtk_file(tmp_path, x, lines))
    assert words in str(refused.value)
    assert "beam.vtk (vtk)" in str(refused.value)


def test_a_geometry_in_place_of_its_mesh_is_told_how_to_make_one(tmp_path):
    path = tmp_path / "beam.geo"
    path.write_text("Point(1) = {0, 0, 0};", encoding="utf-8")
    with pytest.raises(fi.InputError, match=r"geometry of gmsh.*: gmsh -1 beam.geo -o beam.msh$"):
        fi.read_mesh(path)


def test_lines_without_a_group_are_named_as_a_reason_of_what_is_wrong_with_a_mesh_of_gmsh(tmp_path):
    apart = np.column_stack([NODES, np.zeros((NODES.size, 2))])
    lines = [("line", np.array([[0, 1], [2, 3], [3, 4], [4, 5]]))]
    meshio.write(tmp_path / "gap.msh", meshio.Mesh(apart, lines), file_format="gmsh22")
    with pytest.raises(fi.InputError, match=r"a gap from x = 0\.02 to 0\.05 m, or a line there has no physical group$"):
        fi.read_mesh(tmp_path / "gap.msh")
    # the second curve loses its group 5, as one that Mesh.SaveAll writes has none
    text = (SHIPPED.parent / "graded_12.msh").read_text()
    assert text.count("1 5 2 2 -3") == 1
    (tmp_path / "all.msh").write_text(text.replace("1 5 2 2 -3", "0 2 2 -3"))
    with pytest.raises(fi.InputError, match=r"in no physical group, as Mesh\.SaveAll = 1") as refused:
        fi.read_mesh(tmp_path / "all.msh")
    assert "cell blocks" not in str(refused.value)


def test_a_branch_off_the_axis_is_named_before_the_axis(tmp_path):
    path = vtk_file(tmp_path, [0, 1, 2, 1], [[0, 1], [1, 2], [1, 3]], [0, 0, 0, 0.5])
    with pytest.raises(fi.InputError, match=r"a branch at \(1, 0, 0\) m, where 3 lines meet"):
        fi.read_mesh(path)


def test_a_stepped_mesh_under_an_unstepped_beam_is_said():
    uniform = fi.Structure(fi.Beam.uniform(length=0.25, width=0.02, thickness=1e-3, young_modulus=7e10, density=2700))
    mesh = fi.uniform_mesh(STEPPED, 5)
    with pytest.warns(fi.InputWarning, match=r"mesh\.regions = thick, thin: the beam has one segment"):
        fi.assemble(uniform, mesh=mesh)
    # one region, or names that are no pieces of the beam, say nothing of steps
    for regions in ({"all": range(5)}, {"all": range(5), "sensor": [2]}, {"sensor": [2]}):
        fi.assemble(uniform, mesh=fi.fem.Mesh(mesh.nodes, {}, {k: np.array(v) for k, v in regions.items()}))


def outcome_of(path):
    """The mesh of a file, or its error."""
    try:
        return fi.read_mesh(path)
    except fi.InputError as error:
        return error


def damaged(text, generator):
    """The bytes of a file with one kind of damage at a random place."""
    kind, at = generator.integers(7), int(generator.integers(len(text)))
    width = int(generator.integers(1, 40))
    if kind == 0:
        return text[:at]
    if kind == 1:
        return text[:at] + text[at + width :]
    if kind == 2:
        return text[:at] + bytes(generator.integers(0, 256, width, dtype=np.uint8)) + text[at:]
    if kind == 3:
        return text[:at] + text[max(at - width, 0) :]
    lines = text.split(b"\n")
    row = int(generator.integers(len(lines)))
    if kind == 4:
        lines[row] = b" ".join(generator.permutation(lines[row].split()).tolist())
    elif kind == 5:
        words = lines[row].split() or [b""]
        words[int(generator.integers(len(words)))] = [b"-1", b"0", b"99999999999", b"1e300", b"nan", b"x"][at % 6]
        lines[row] = b" ".join(words)
    else:
        del lines[row]
    return b"\n".join(lines)


def test_every_damaged_file_is_a_mesh_or_an_error_in_one_line(tmp_path, capfd):
    text = SHIPPED.read_bytes()
    paths = [tmp_path / f"{number}.msh" for number in range(300)]
    for number, path in enumerate(paths):
        path.write_bytes(damaged(text, np.random.default_rng(number)))
    outcomes = [outcome_of(path) for path in paths]
    for path, outcome in zip(paths, outcomes, strict=True):
        if isinstance(outcome, fi.fem.Mesh):
            assert outcome.elements >= 1
        else:
            assert isinstance(outcome, fi.InputError)
            assert "\n" not in str(outcome)
            assert str(outcome).startswith("mesh.")
            assert path.name in str(outcome) or str(outcome).startswith("mesh.p")
    # the damage is neither harmless nor fatal throughout
    assert 20 < sum(isinstance(outcome, fi.fem.Mesh) for outcome in outcomes) < 280
    assert capfd.readouterr() == ("", "")


def test_a_file_that_asks_for_more_memory_than_there_is_is_refused(tmp_path):
    path = tmp_path / "huge.msh"
    path.write_text("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 900000000000 1 900000000000\n$EndNodes\n")
    with pytest.raises(fi.InputError, match=r"huge\.msh.*gmsh"):
        fi.read_mesh(path)
