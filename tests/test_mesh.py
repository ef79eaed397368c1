"""Meshes: nodes where things are attached, and files of another program read without loss."""

from pathlib import Path

import meshio
import numpy as np
import pytest
from builders import stepped_structure

import femimpact as fi

DATA = Path(__file__).parent / "data"


@pytest.mark.parametrize("elements", [5, 6, 7, 40, 101])
def test_uniform_mesh_has_exactly_n_elements_and_a_node_at_every_joint_and_attachment(elements):
    places = [0.03, 0.1, 0.2]
    law = fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
    structure = stepped_structure(
        masses=[fi.PointMass("a", 0.03, 0.01)],
        impactors=[fi.Impactor("b", 0.2, 0.001, 1e-3, law)],
        supports=[fi.Support("clamped", "root"), fi.Support("pinned", 0.1)],
    )
    mesh = fi.uniform_mesh(structure, elements)
    assert mesh.elements == elements == mesh.nodes.size - 1
    for place in (0.0, *places, 0.15, 0.25):
        # a place is the same number, up to the rounding of adding segment lengths
        assert np.min(np.abs(mesh.nodes - place)) < 1e-15
    # every element belongs to the segment that it lies in, and to one only
    middles = 0.5 * (mesh.nodes[1:] + mesh.nodes[:-1])
    np.testing.assert_array_equal(mesh.regions["thick"], np.flatnonzero(middles < 0.15))
    np.testing.assert_array_equal(mesh.regions["thin"], np.flatnonzero(middles > 0.15))


def test_uniform_mesh_of_a_uniform_cantilever_has_equal_elements(reference):
    lengths = np.diff(fi.uniform_mesh(reference, 40).nodes)
    # differences of positions near 0.2 m are good to 1e-16 m
    np.testing.assert_allclose(lengths, 0.23026615 / 40, rtol=1e-13)


def test_elements_are_shared_out_so_that_the_longest_is_as_short_as_can_be():
    lengths = np.diff(fi.uniform_mesh(stepped_structure(), 10).nodes)
    # 0.15 and 0.10 m in 10 elements: all 0.025 m
    np.testing.assert_allclose(lengths, 0.025, rtol=1e-13)


def test_two_attachments_at_one_place_share_a_node():
    masses = [fi.PointMass("a", 0.25, 0.01), fi.PointMass("b", "tip", 0.01), fi.PointMass("c", 0.25 * (1 - 1e-12), 0.1)]
    mesh = fi.uniform_mesh(stepped_structure(masses=masses), 2)
    np.testing.assert_array_equal(mesh.nodes, [0.0, 0.15, 0.25])


def test_fewer_elements_than_stretches_are_refused():
    with pytest.raises(fi.InputError, match=r"mesh\.elements = 1: must be >= 2"):
        fi.uniform_mesh(stepped_structure(), 1)


@pytest.mark.parametrize("elements", [0, -3, 2.5, True, "10"])
def test_elements_must_be_a_whole_number(elements):
    with pytest.raises(fi.InputError, match=r"mesh\.elements"):
        fi.uniform_mesh(stepped_structure(), elements)


@pytest.mark.parametrize("nodes", [[0.0], [0.0, 0.0, 1.0], [1.0, 0.0], [[0.0, 1.0]]])
def test_nodes_must_increase(nodes):
    with pytest.raises(fi.InputError, match=r"mesh\.nodes"):
        fi.fem.Mesh(np.array(nodes))


def test_nodes_are_read_only():
    with pytest.raises(ValueError, match="read-only"):
        fi.fem.Mesh(np.array([0.0, 1.0])).nodes[0] = 2.0


def test_a_gmsh_file_gives_sorted_nodes_names_and_regions():
    mesh = fi.read_mesh(DATA / "stepped.msh")
    # gmsh writes transfinite nodes to 13 digits; the file numbers the tip first and runs one line backwards
    np.testing.assert_allclose(mesh.nodes, np.linspace(0.0, 0.25, 11), rtol=0, atol=1e-12)
    assert mesh.points["sensor"] == pytest.approx(0.10, abs=1e-12)
    assert mesh.points["box"] == mesh.points["tip"] == 0.25
    assert mesh.points["root"] == 0.0
    assert mesh.points["mid"] == 0.125
    assert set(mesh.regions) == {"thick", "thin"}
    np.testing.assert_array_equal(mesh.regions["thick"], np.arange(6))
    np.testing.assert_array_equal(mesh.regions["thin"], np.arange(6, 10))


def test_a_gmsh_file_is_read_as_meshio_reads_it():
    raw = meshio.gmsh.read(str(DATA / "stepped.msh"))
    mesh = fi.read_mesh(DATA / "stepped.msh")
    np.testing.assert_array_equal(np.sort(raw.points[:, 0]), mesh.nodes)
    lines = np.concatenate([block.data for block in raw.cells if block.type == "line"])
    ours = {(mesh.nodes[i], mesh.nodes[i + 1]) for i in range(mesh.elements)}
    assert {tuple(sorted(raw.points[line, 0])) for line in lines} == ours


def test_reading_a_mesh_prints_nothing(capfd):
    fi.read_mesh(DATA / "stepped.msh")
    assert capfd.readouterr() == ("", "")


def test_a_stepped_beam_from_a_file_has_the_frequencies_of_the_built_in_mesh():
    structure = stepped_structure(masses=[fi.PointMass("box", "tip", 0.02)])
    from_file = fi.assemble(structure, mesh=fi.read_mesh(DATA / "stepped.msh"))
    built_in = fi.assemble(structure, elements=10)
    np.testing.assert_allclose(
        fi.solve_modes(from_file, 8).natural_frequency,
        fi.solve_modes(built_in, 8).natural_frequency,
        # the file's nodes differ by 1e-13 m of 0.025 m, and the frequency goes with length^-2
        rtol=1e-10,
    )


def test_a_named_point_of_the_file_is_a_place_for_masses_and_channels():
    structure = stepped_structure(masses=[fi.PointMass("lump", "sensor", 0.02)])
    from_file = fi.assemble(structure, mesh=fi.read_mesh(DATA / "stepped.msh"))
    by_number = fi.assemble(stepped_structure(masses=[fi.PointMass("lump", 0.10, 0.02)]), elements=10)
    np.testing.assert_allclose(
        fi.solve_modes(from_file, 4).natural_frequency,
        fi.solve_modes(by_number, 4).natural_frequency,
        rtol=1e-10,  # as above
    )
    row = from_file.point_row("sensor")
    assert row[6] == 1.0  # node 4 of the row, its first free dof is node 1's
    assert np.count_nonzero(row) == 1


def test_a_mesh_given_in_the_place_of_the_elements_is_told_its_keyword():
    beam = fi.Structure(fi.Beam.uniform(length=0.25, width=0.02, thickness=1e-3, young_modulus=7e10, density=2700))
    with pytest.raises(fi.InputError, match=r"^elements = 'Mesh': must be a whole number; pass a mesh as mesh=$"):
        fi.assemble(beam, fi.uniform_mesh(beam, 3))


def test_a_mesh_of_another_length_or_region_is_refused():
    mesh = fi.read_mesh(DATA / "stepped.msh")
    longer = fi.Structure(fi.Beam.uniform(length=0.26, width=0.02, thickness=1e-3, young_modulus=7e10, density=2700))
    with pytest.raises(fi.InputError, match=r"beam\.length = 0\.26 m: must be the mesh's length, 0\.25 m"):
        fi.assemble(longer, mesh=mesh)
    segments = [
        fi.Segment(0.1, 7e10, 2700, 0.02, 2e-3, name="thick"),
        fi.Segment(0.15, 7e10, 2700, 0.02, 1e-3, name="thin"),
    ]
    with pytest.raises(fi.InputError, match=r"beam\.thick\.length = 0\.1 m: must be the length of the mesh's region"):
        fi.assemble(fi.Structure(fi.Beam(segments)), mesh=mesh)
    # the length of the whole beam is wrong too: the segment that makes it so is named
    segments = [
        fi.Segment(0.15, 7e10, 2700, 0.02, 2e-3, name="thick"),
        fi.Segment(100.0, 7e10, 2700, 0.02, 1e-3, name="thin"),
    ]
    with pytest.raises(fi.InputError, match=r"^beam\.thin\.length = 100\.0 m: must be .* region, 0\.1 m$"):
        fi.assemble(fi.Structure(fi.Beam(segments)), mesh=mesh)
    # in another unit both are: no one segment is to blame
    segments = [
        fi.Segment(150.0, 7e10, 2700, 0.02, 2e-3, name="thick"),
        fi.Segment(100.0, 7e10, 2700, 0.02, 1e-3, name="thin"),
    ]
    with pytest.raises(fi.InputError, match=r"^beam\.length = 250\.0 m: must be the mesh's length, 0\.25 m$"):
        fi.assemble(fi.Structure(fi.Beam(segments)), mesh=mesh)
    segments = [
        fi.Segment(0.15, 7e10, 2700, 0.02, 2e-3, name="thik"),
        fi.Segment(0.1, 7e10, 2700, 0.02, 1e-3, name="thin"),
    ]
    with pytest.raises(fi.InputError, match=r"mesh\.regions = 'thik': unknown; did you mean 'thick'\?"):
        fi.assemble(fi.Structure(fi.Beam(segments)), mesh=mesh)


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("along_y.msh", "must lie along the x axis; its extent is x 0, y 0.25, z 0 m"),
        ("broken.msh", "must be one unbroken row of line elements"),
        ("triangles.msh", "found ['triangle']: only beams are meshed; of a solid or a plate mesh the mid-line"),
        ("quadratic.msh", "must hold two-node lines only, found ['line3']"),
        ("missing.msh", "must be an existing mesh file"),
    ],
)
def test_a_file_that_is_no_beam_is_refused_in_one_line(file, words):
    with pytest.raises(fi.InputError) as caught:
        fi.read_mesh(DATA / file)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith("mesh.file = ")
    assert file in message
    assert words in message


@pytest.mark.parametrize("content", ["", "this is no mesh\n", "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 1\n"])
@pytest.mark.parametrize("name", ["bad.msh", "bad.unknown"])
def test_an_unreadable_file_is_refused_in_one_line(tmp_path, capfd, name, content):
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(fi.InputError) as caught:
        fi.read_mesh(path)
    assert str(caught.value).startswith("mesh.file = ")
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().out == ""


def beam_file(folder, coordinates, tags):
    """A Gmsh 2.2 file of a row of lines between points, some of them tagged."""
    names = [f'0 {i} "{name}"' for i, name in enumerate(tags, 1)]
    nodes = [f"{i} {x!r} {y!r} {z!r}" for i, (x, y, z) in enumerate(coordinates, 1)]
    cells = [f"15 2 {i} {i} {node}" for i, node in enumerate(tags.values(), 1)]
    cells += [f"1 2 0 1 {i} {i + 1}" for i in range(1, len(coordinates))]
    sections = {"PhysicalNames": names, "Nodes": nodes, "Elements": [f"{i} {cell}" for i, cell in enumerate(cells, 1)]}
    parts = ["$MeshFormat\n2.2 0 8\n$EndMeshFormat"]
    parts += ["\n".join([f"${key}", str(len(rows)), *rows, f"$End{key}"]) for key, rows in sections.items()]
    path = folder / "beam.msh"
    path.write_text("\n".join(parts) + "\n")
    return path


STRAIGHT = [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.2, 0.0, 0.0), (0.4, 0.0, 0.0)]


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("node", [0, 1, 3])
def test_a_coordinate_that_is_not_a_number_is_refused(tmp_path, axis, node):
    broken = [list(point) for point in STRAIGHT]
    broken[node][axis] = float("nan")
    with pytest.raises(fi.InputError, match="must hold finite coordinates in x, y and z"):
        fi.read_mesh(beam_file(tmp_path, broken, {}))


@pytest.mark.parametrize(("name", "node", "place"), [("root", 2, 0.0), ("tip", 1, 0.4), ("mid", 2, 0.2)])
def test_a_tag_with_the_name_of_a_place_that_lies_elsewhere_is_refused(tmp_path, name, node, place):
    with pytest.raises(fi.InputError) as refused:
        fi.read_mesh(beam_file(tmp_path, STRAIGHT, {name: node}))
    line = (
        rf"mesh.points.{name} = {STRAIGHT[node - 1][0]!r} m: must lie at {place:g} m, where '{name}' is on every beam"
    )
    assert str(refused.value) == f"{line}: take another name"
    # at its own place the name says nothing new
    own = 1 + [x for x, _, _ in STRAIGHT].index(place)
    mesh = fi.read_mesh(beam_file(tmp_path, STRAIGHT, {name: own, "sensor": node}))
    assert mesh.points == {"root": 0.0, "tip": 0.4, "mid": 0.2, "sensor": STRAIGHT[node - 1][0]}


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"nodes": [0.1, 0.2]}, "mesh.nodes = 0.1 m: must begin with the root, at 0 m"),
        ({"nodes": np.ma.array([0.0, 0.1, 0.2], mask=[0, 1, 0])}, "mesh.nodes = 'masked entries' m"),
        ({"points": {"sensor": 0.3}}, "mesh.points.sensor = 0.3 m: must be a finite number >= "),
        ({"points": {"sensor": float("nan")}}, "mesh.points.sensor = nan m: must be a finite number >= "),
        ({"points": {3: 0.1}}, "mesh.points = 3: must be a text without control characters"),
        ({"regions": {"thick": [0, 2]}}, "mesh.regions.thick: must be numbers of elements, 0 to 1, each once"),
        ({"regions": {"thick": [0, 0]}}, "mesh.regions.thick: must be numbers of elements, 0 to 1, each once"),
        ({"regions": {"thick": [0.5]}}, "mesh.regions.thick: must be numbers of elements, 0 to 1, each once"),
    ],
)
def test_places_and_regions_that_no_beam_has_are_refused(given, words):
    with pytest.raises(fi.InputError) as refused:
        fi.fem.Mesh(**{"nodes": [0.0, 0.1, 0.2], **given})
    assert str(refused.value).startswith(words)
