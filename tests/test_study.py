"""The study file: what it means, and what it says when it is wrong."""

from __future__ import annotations

import dataclasses
import tomllib

import numpy as np
import pytest
from builders import TABLES, build, load_study, paper_study, paper_study_text

import femimpact as fi
from femimpact.app.study.study_file import LAWS

TEXT = paper_study_text()


def write(tmp_path, text):
    path = tmp_path / "study.toml"
    path.write_text(text, encoding="utf-8")
    return path


def faults_of(tmp_path, text):
    with pytest.raises(fi.InputError) as caught:
        load_study(write(tmp_path, text))
    return str(caught.value).splitlines()


def test_paper_study_is_the_reference_of_the_physics_page():
    # 5.30 and 4.98 Hz to four digits: Table 1's theory column
    full, small, method = build(paper_study())
    assert fi.solve_modes(full, 1).natural_frequency[0] == pytest.approx(5.30, abs=5e-4)
    glued = fi.assemble(fi.structure.glue_impactors(paper_study().structure), elements=40)
    assert fi.solve_modes(glued, 1).natural_frequency[0] == pytest.approx(4.98, abs=5e-4)
    assert small.dofs == 8
    assert method.dt == fi.recommended_step(small)


def test_study_means_the_same_as_the_script(reference):
    study = paper_study().structure
    assert study.beam == reference.beam
    assert study.masses == reference.masses
    assert study.damping == reference.damping


@pytest.mark.parametrize(
    ("find", "put", "words"),
    [
        ("length = 0.23026615 ", "lenght = 0.23026615 ", ["beam.lenght: unknown; did you mean 'length'?"]),
        ("length = 0.23026615 ", "length = -0.2 ", ["beam.length = -0.2 m: must be a finite number > 0 m"]),
        ("length = 0.23026615 ", "length = '20 kg' ", ["beam.length = '20 kg': must have a unit that fits: m, cm"]),
        ("length = 0.23026615 ", "length = true ", ["beam.length = True m"]),
        ("length = 0.23026615 ", "length = nan ", ["beam.length = nan m"]),
        ("length = 0.23026615 ", "", ["beam.length: is missing; must be a finite number > 0 m"]),
        ("elements = 40 ", "elements = 0 ", ["mesh.elements = 0: must be a whole number >= 1"]),
        ("elements = 40 ", "elements = 1.5 ", ["mesh.elements = 1.5: must be a whole number"]),
        ("length = 0.23026615 ", "length = [0.2] ", ["beam.length = [0.2] m: must be a finite number > 0 m"]),
        ("mass = 0.02290976 ", "mass = [1, 2] ", ["mass.box.mass = [1, 2] kg: must be a finite number >= 0 and <="]),
        ("modes = 8 ", "modes = [8] ", ["reduction.modes = [8]: must be a whole number >= 1"]),
        ("elements = 40 ", "elements = 40\nfile = 'a.msh' ", ["mesh.elements = 40: give either"]),
        ("mass = 0.02290976 ", "mass = -1 ", ["mass.box.mass = -1 kg: must be a finite number >= 0 and <="]),
        ('at = "tip"  ', 'at = "tipp"  ', ["mass.box.at = 'tipp': must be one of root, tip, mid"]),
        ('at = "tip"  ', "at = 0.5  ", ["mass.box.at = 0.5 m: must be within the beam, 0 to 0.230266 m"]),
        ("gap = 0.004 ", "gap = [0.004, -0.001] ", ["impactor.ball.gap = [0.004, -0.001] m: must be"]),
        ("gap = 0.004 ", "gap = [1e-3, 1e-3, 1e-3] ", ["impactor.ball.gap", "one number or two"]),
        ("restitution = 0.78", "restitution = 1.2", ["impactor.ball.contact.restitution = 1.2", "> 0 and <= 1"]),
        (", contact_time = 2e-3", "", ["impactor.ball.contact", "give exactly one pair"]),
        ('law = "kelvin-voigt"', 'law = "hertzz"', ["impactor.ball.contact.law = 'hertzz'", "'switching-spring'"]),
        ("modes = [1, 2] ", "modes = [1, 1] ", ["damping.modes = (1, 1): must be two different values"]),
        ("modes = [1, 2] ", "modes = [0, 2] ", ["damping.modes = [0, 2]: must be a whole number >= 1"]),
        ("modes = 8 ", "modes = 0 ", ["reduction.modes = 0: must be a whole number >= 1"]),
        ("frequency = 4.9 ", "frequency = 0 ", ["base.frequency = 0 Hz: must be a finite number > 0 Hz"]),
        ('start = "base"', 'start = "moon"', ["base.start = 'moon': must be 'base' or 'space'"]),
        ('name = "newmark"', 'name = "euler"', ["method.name = 'euler': must be one of 'newmark', 'hht'"]),
        ('name = "newmark"', "dt = 0", ["method.dt = 0 s: must be a finite number > 0 s"]),
        ("stop = 6.0 ", "stop = 3.0 ", ["sweep.stop = 3.0 Hz: must be > start, 4 Hz"]),
        ("cycles = 600 ", "cycles = 2 ", ["sweep.cycles = 2: must be a whole number >= 24"]),
        ("movie = true", "movie = 1", ["output.movie = 1: must be True or False"]),
        ("movie = true", 'vtkhdf = "yes"', ["output.vtkhdf = 'yes': must be True or False"]),
        ("frames = 120", "frames = 0\nvtkhdf = true", ["output.vtkhdf = True: must be false where frames = 0"]),
        ("[sweep]", "[sweeep]", ["sweeep: unknown; did you mean 'sweep'?"]),
        # as like as "mass", which comes later in the alphabet
        ("[base]", "[basis]", ["basis: unknown; did you mean 'base'?"]),
        ("[mesh]", "[[mesh]]", ["mesh", "must be a table, [mesh]"]),
        ("[[mass]]", "[mass]", ["mass: must be a list of tables, [[mass]]"]),
        ("[beam]", "[beam", ["must be readable TOML"]),
    ],
)  # fmt: skip
def test_bad_input_is_one_line_with_path_value_unit_and_range(tmp_path, find, put, words):
    assert find in TEXT
    lines = faults_of(tmp_path, TEXT.replace(find, put, 1))
    assert any(all(word in line for word in words) for line in lines), lines


def test_every_fault_is_in_one_message(tmp_path):
    text = TEXT
    for find, put in (
        ("width = 0.020 ", "width = 0 "),
        ("ratio = 0.0029", "ratio = 2"),
        ("points = 21 ", "points = 1 "),
    ):
        text = text.replace(find, put, 1)
    lines = faults_of(tmp_path, text)
    assert [line.split(" ")[0] for line in lines] == ["beam.width", "damping.ratio", "sweep.points"]


def test_every_fault_between_tables_is_in_one_message(tmp_path):
    bodies = "".join(f'[[mass]]\nname = "far {i}"\nat = {i}.0\nmass = 1e-3\n\n' for i in (1, 2))
    lines = faults_of(tmp_path, TEXT.replace("[damping]", bodies + "[damping]", 1))
    assert [next(word for word in ("far 1", "far 2") if word in line) for line in lines] == ["far 1", "far 2"]


@pytest.mark.parametrize("name", LAWS)
def test_the_name_of_a_law_makes_that_law(tmp_path, name):
    numbers = {
        "rigid": "restitution = 0.5",
        "kelvin-voigt": "restitution = 0.5, contact_time = 2e-3",
        "switching-spring": "free_stiffness = 0.0, stiffness = 1e4",
        "hertz": "stiffness = 1e8",
    }
    begin = TEXT.index("contact = {")
    end = TEXT.index("}", begin)
    law = f'contact = {{ law = "{name}", {numbers.get(name, "stiffness = 1e8, restitution = 0.5")} '
    study = load_study(write(tmp_path, TEXT[:begin] + law + TEXT[end:]))
    assert study.structure.impactors[0].contact.name == name


def test_gravity_and_the_phase_of_the_base_are_those_of_the_file(tmp_path):
    text = TEXT.replace("[base]", "[gravity]\nacceleration = 9.81\n\n[base]\nphase = 0.5", 1)
    study = load_study(write(tmp_path, text))
    assert study.structure.gravity == 9.81
    assert study.excitation.phase == 0.5


@pytest.mark.parametrize("table", [name for name, spec in TABLES.items() if spec.required])
def test_a_missing_table_is_named(tmp_path, table):
    data = tomllib.loads(TEXT)
    assert table in data
    text = TEXT.replace(f"[{table}]", f"[[impactor]]\nname = 'x{table}'\n#", 1)
    assert any(line.startswith(f"{table}: table [{table}] is missing") for line in faults_of(tmp_path, text))


def test_stepped_beam_from_segments_has_both_sections(tmp_path):
    head, tail = TEXT.split("[mesh]", 1)
    segment = (
        "[[beam.segment]]\nname = '{}'\nlength = {}\nwidth = 0.02\nthickness = {}\n"
        "young_modulus = 70e9\ndensity = 2700\n"
    )
    text = segment.format("thick", 0.1, 0.002) + segment.format("thin", 0.13, 0.001) + "[mesh]" + tail
    beam = load_study(write(tmp_path, text)).structure.beam
    assert head.startswith("# The paper")
    assert beam.length == pytest.approx(0.23)
    # second moments of the two rectangles: a factor 8 for twice the thickness
    assert beam.segments[0].bending_stiffness == pytest.approx(8 * beam.segments[1].bending_stiffness)


def test_a_study_file_takes_a_tube_and_a_section_with_its_outer_fibre(tmp_path):
    given = TEXT.split("width = ", 1)[1].split("young_modulus", 1)[0]
    tube = TEXT.replace(f"width = {given}", 'diameter = "60.3 mm"\nwall = 3e-3\n', 1)
    study = load_study(write(tmp_path, tube))
    material = {"length": 0.23026615, "young_modulus": 70e9, "density": 2700}
    assert study.structure.beam == fi.Beam.tube(diameter=60.3e-3, wall=3e-3, **material)
    section = "area = 2e-5\nsecond_moment = 1.7e-12\nouter_fibre = 6e-4\n"
    beam = load_study(write(tmp_path, TEXT.replace(f"width = {given}", section, 1))).structure.beam
    assert beam == fi.Beam.section(area=2e-5, second_moment=1.7e-12, outer_fibre=6e-4, **material)
    words = "beam.wall = 0.04 m: must be below half the diameter, 0.03015 m: a bar without a hole has no wall"
    assert faults_of(tmp_path, tube.replace("wall = 3e-3", "wall = 0.04")) == [words]


def test_a_beam_of_no_segment_is_refused_in_words(tmp_path):
    _, tail = TEXT.split("[mesh]", 1)
    assert faults_of(tmp_path, "beam.segment = []\n[mesh]" + tail) == ["beam.segment: must hold at least one segment"]


def test_without_reduction_the_physical_dofs_are_integrated(tmp_path):
    text = TEXT.replace("[reduction]\nmodes = 8", "#\n#")
    full, small, _ = build(load_study(write(tmp_path, text)))
    assert small is full
    assert full.dofs == 80


def test_mesh_file_of_the_repository_gives_the_same_frequencies(request, tmp_path):
    folder = request.config.rootpath / "meshes"
    study = load_study(folder / "stepped_cantilever.toml")
    full, _, _ = build(study)
    by_file = fi.solve_modes(full, 4).natural_frequency
    # the name "joint" belongs to the mesh file; a mesh made here knows the place in metres only
    masses = [dataclasses.replace(body, at=0.1 if body.at == "joint" else body.at) for body in study.structure.masses]
    structure = dataclasses.replace(study.structure, masses=masses)
    built = fi.solve_modes(fi.assemble(structure, elements=full.nodes.size - 1), 4).natural_frequency
    # the same element length on both: only rounding of the positions in the file differs
    np.testing.assert_allclose(by_file, built, rtol=1e-6)


def test_a_whole_number_may_be_written_as_one_with_a_point(tmp_path):
    study = load_study(
        write(tmp_path, TEXT.replace("modes = 8 ", "modes = 8.0 ").replace("cycles = 600 ", "cycles = 600.0 "))
    )
    assert (study.reduction.modes, study.sweep.cycles) == (8, 600)
    assert all(isinstance(number, int) for number in (study.reduction.modes, study.sweep.cycles))
