"""Study files with texts that have units: the same study, the same key and the same results as with numbers in SI."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from builders import (
    load_study,
    paper_study_text,
    plain_study,
    read_study,
    same_study,
    study_key,
    study_schema,
    study_text,
    write_parameter_study,
)
from command import femimpact

import femimpact as fi
from femimpact.app.study.study_file import unit_lines
from femimpact.app.tasks.study_command import definition_of

IN_UNITS = [
    ("0.23026615 ", '"230.26615 mm" '),
    ("70e9 ", '"70 GPa" '),
    ("2700 ", '"2.7 g/cm^3" '),
    ("0.02290976 ", '"22.90976 g" '),
    ("gap = 0.004 ", 'gap = "4 mm" '),
    ("acceleration = 0.0 ", 'acceleration = "0 g" '),
    ("2e-3 }", '"2 ms" }'),
    ("0.0029", '"0.29 %"'),
    ("0.2037e-3 ", '"203.7 um" '),
    ("duration = 120.0 ", 'duration = "2 min" '),
    ("start = 4.0 ", 'start = "0.004 kHz" '),
]
AXES = """
[study]
measures = ["peak"]
cycles = 6
[study.axes]
"impactor.ball.gap" = [{0}, [{0}, {1}]]
impactor.ball.mass = {{ from = {2}, to = {3}, points = 2 }}
"""


def read(text: str) -> fi.app.Study:
    return read_study(text, Path("study.toml"))


def pair(more: str = "", others: str = "") -> tuple[fi.app.Study, fi.app.Study]:
    """The paper's study in numbers, and with units."""
    plain = paper_study_text().replace('name = "newmark"', 'name = "event-driven"')
    text = plain
    for find, put in IN_UNITS:
        assert find in text, find
        text = text.replace(find, put, 1)
    return read(plain + more), read(text + (others or more))


def test_study_with_units_is_the_study_in_si() -> None:
    plain, units = pair()
    assert same_study(plain, units)
    assert len(unit_lines(units)) == len(IN_UNITS)
    assert "impactor.ball.gap = 4 mm: 0.004 m" in unit_lines(units)
    assert "damping.ratio = 0.29 %: 0.0029" in unit_lines(units)


def test_saved_study_has_numbers_in_si_and_its_comments() -> None:
    plain, units = pair()
    text = study_text(units)
    assert unit_lines(read(text)) == []
    assert same_study(read(text), plain)
    assert "# aluminium; reproduces 5.30 Hz" in text
    assert study_text(plain) == plain.text


def test_text_that_stands_for_two_numbers_is_written_as_two() -> None:
    text = (
        paper_study_text()
        .replace("mass = 0.00343 ", 'mass = "10 g" ')
        .replace("acceleration = 0.0 ", 'acceleration = "10 g" ')
    )
    study = read(text)
    ball = study.structure.impactors[0]
    assert (ball.mass, ball.acceleration) == (0.01, 98.0665)
    again = read(study_text(study))
    assert unit_lines(again) == []
    assert same_study(again, study)


def test_title_that_looks_like_a_quantity_stays() -> None:
    study = read(
        paper_study_text()
        .replace("movie = true", 'movie = true\ntitle = "4 mm"')
        .replace("gap = 0.004 ", 'gap = "4 mm" ')
    )
    again = read(study_text(study))
    assert again.output.title == "4 mm"
    assert again.structure.impactors[0].gap == 0.004
    assert same_study(again, study)


def test_keys_of_studies_are_equal_and_resume_each_other(tmp_path: Path) -> None:
    plain, units = pair(AXES.format(0.004, 0.005, 0.003, 0.004), AXES.format('"4 mm"', '"0.5 cm"', '"3 g"', '"4 g"'))
    keys = [study_key(plain_study(definition_of(study))) for study in (plain, units)]
    assert keys[0] == keys[1]
    first = write_parameter_study(plain, tmp_path / "s")
    cases = list[int]()
    again = write_parameter_study(units, tmp_path / "s", progress=lambda state: cases.append(state.found))
    assert max(cases) == 4
    np.testing.assert_array_equal(first["peak"], again["peak"])
    text = (tmp_path / "s" / "study.toml").read_text()
    assert 'gap = "4 mm"' not in text
    # a comment stays what it was
    assert 'as "4 mm"' in text


def test_limits_of_measures_have_their_units() -> None:
    text = AXES.format(0.004, 0.005, 0.003, 0.004).replace('"peak"]', '"peak", "peak_force", "root.surface_stress"]')
    best = (
        '[study.best]\nmeasure = "peak"\n[study.best.limits]\npeak_force = "0.05 kN"\nroot.surface_stress = "60 MPa"\n'
    )
    study = read(paper_study_text() + text + best)
    assert study.plan is not None
    assert study.plan.best is not None
    assert study.plan.best.limits == {"peak_force": 50.0, "root.surface_stress": 60e6}
    assert same_study(read(study_text(study)), study)
    with pytest.raises(
        fi.InputError, match=r"study\.best\.limits\.peak_force = '5 mm': must have a unit that fits: N, mN"
    ):
        read(paper_study_text() + text + best.replace("0.05 kN", "5 mm"))


def test_names_stay_names() -> None:
    study = read(
        paper_study_text() + '[study]\nmeasures = ["peak"]\n[study.axes]\n"impactor.ball.at" = ["tip", "mid"]\n'
    )
    assert study.plan is not None
    assert study.plan.axes["impactor.ball.at"].values == ("tip", "mid")  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("find", "put", "words"),
    [
        ("mass = 0.02290976 ", 'mass = "22 mm" ', "mass.box.mass = '22 mm': must have a unit that fits: kg, g, mg"),
        ("gap = 0.004 ", 'gap = ["4 mm", "4 g"] ', "impactor.ball.gap = '4 g': must have a unit that fits: m, cm"),
        ("2e-3 }", '"2 m" }', "impactor.ball.contact.contact_time = '2 m': must have a unit that fits: s, ms"),
        ("frequency = 4.9 ", 'frequency = "-5 Hz" ', "base.frequency = -5.0 Hz: must be a finite number > 0"),
        ("modes = 8 ", 'modes = "8 mm" ', "reduction.modes = '8 mm': must be a whole number >= 1"),
    ],
)
def test_unit_that_does_not_fit_is_one_line(find: str, put: str, words: str) -> None:
    text = paper_study_text()
    assert find in text
    with pytest.raises(fi.InputError) as error:
        read(text.replace(find, put, 1))
    assert str(error.value).startswith(words)
    assert "\n" not in str(error.value)


def random_base(rows: str) -> str:
    text = re.sub(
        r"\[base\].*?(?=\n\[)",
        f'[base]\nkind = "random"\npsd = {rows}\nduration = 0.5\n',
        paper_study_text(),
        flags=re.DOTALL,
    )
    return re.sub(r"\[sweep\].*?(?=\n\[)", "", text, flags=re.DOTALL)


def test_density_in_the_words_of_a_plan_rises_and_falls_by_its_slopes() -> None:
    study = read(random_base('[[20, "3 dB/oct"], ["80 Hz", "0.04 g^2/Hz"], [350, "0.04 g²/Hz"], [2000, "-3 dB/oct"]]'))
    psd = study.excitation.psd
    level = 0.04 * 9.80665**2
    # two octaves of 3 dB each; a decibel is a tenth of a power of ten
    assert psd[0] == pytest.approx((20.0, level * 10.0**-0.6), rel=1e-12)
    assert psd[1] == pytest.approx((80.0, level), rel=1e-15)
    assert psd[3] == pytest.approx((2000.0, level * 10.0 ** (-0.3 * np.log2(2000.0 / 350.0))), rel=1e-12)
    assert same_study(read(study_text(study)), study)


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ('[[20, "3 dB/oct"], [80, "3 dB/oct"]]', "must have a level beside it"),
        ('[[20, "3 dB/oct"]]', "must have a level beside it"),
        (
            '[[20, "1 g"], [80, 0.1]]',
            "[20, '1 g']: row 1: must have a unit that fits: (m/s^2)^2/Hz, m^2/s^3, g^2/Hz, or a slope",
        ),
        ('[[20, "0 g^2/Hz"], [80, 0.1]]', "[20, '0 g^2/Hz']: row 1: must have a level > 0"),
        ('[[-20, "3 dB/oct"], [80, 0.1]]', "base.psd = [-20, '3 dB/oct']: row 1: must have a frequency > 0 Hz"),
        ('[["20 Hz", 0.1], ["20 Hz", 0.2]]', "must have frequencies that rise"),
        ('[[20, "9999 dB/oct"], [1e9, 0.1]]', "row 1: must change the level by at most 3000 dB"),
        ('[[20, "6 dB"], [80, 0.1]]', "or a slope as 3 dB/oct"),
        ('"0.04 g^2/Hz"', "must be rows of a frequency and a level"),
        ('["20 Hz", 0.1]', "must be rows of a frequency and a level"),
        (
            '[[20, 0.1], [80, "0,1 g^2/Hz"]]',
            "base.psd = [80, '0,1 g^2/Hz']: row 2: must be a number, or one with a decimal",
        ),
    ],
)
def test_bad_density_is_one_line(rows: str, words: str) -> None:
    with pytest.raises(fi.InputError) as error:
        read(random_base(rows))
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_check_tells_the_numbers_in_si(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(pair()[1].text, encoding="utf-8")
    told = femimpact("check", "study.toml", "--all", cwd=tmp_path).stdout
    assert "beam.young_modulus = 70 GPa: 7e+10 Pa" in told


def chirp_base(acceleration: str) -> str:
    return random_base("[]").replace(
        'kind = "random"\npsd = []',
        f'kind = "chirp"\nstart = "10 Hz"\nstop = 150\nrate = "logarithmic"\nacceleration = {acceleration}',
    )


def levels_of(study: fi.app.Study) -> Any:
    return study.excitation.level


def test_profile_of_displacement_and_acceleration_is_one_of_accelerations() -> None:
    study = read(chirp_base('[["10 Hz", "0.075 mm"], [58.1, "1 g"], [100, "0.5 m/s"], [150, 3]]'))
    rows = levels_of(study)
    assert rows[0] == pytest.approx((10.0, 0.075e-3 * (20.0 * np.pi) ** 2), rel=1e-15)
    assert rows[1:] == ((58.1, 9.80665), (100.0, pytest.approx(0.5 * 200.0 * np.pi, rel=1e-15)), (150.0, 3.0))
    assert same_study(read(study_text(study)), study)
    assert study.excitation == fi.Chirp(10.0, 150.0, 0.5, acceleration=rows, kind="logarithmic")
    # an amplitude has slopes of 6 dB an octave for its frequency: constant velocity
    slope = levels_of(read(chirp_base('[[10, 1.0], [150, "6.020599913279624 dB/oct"]]')))
    assert slope[1] == pytest.approx((150.0, 15.0), rel=1e-12)


def test_rows_come_from_a_file_and_are_kept_in_the_study(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    (tmp_path / "levels.csv").write_text("# plan\nfrequency [Hz],level (g)\n10,0.5\n58.1,1\n150,2 m/s^2\n")
    (tmp_path / "density.csv").write_text("f;density [g²/Hz]\n0.02 kHz;0.01\n\n80;0.04\n2000;-3 dB/oct\n")
    path.write_text(chirp_base('"levels.csv"'), encoding="utf-8")
    study = load_study(path)
    assert levels_of(study) == ((10.0, 0.5 * 9.80665), (58.1, 9.80665), (150.0, 2.0))
    assert "base.acceleration = levels.csv: 3 rows m/s^2" in unit_lines(study)
    random = read_study(random_base('"density.csv"'), path)
    psd = random.excitation.psd
    assert psd[:2] == ((20.0, pytest.approx(0.01 * 9.80665**2)), (80.0, pytest.approx(0.04 * 9.80665**2)))
    (tmp_path / "2nd.csv").write_text("10 .5\n150 2\n")
    assert levels_of(read_study(chirp_base('"2nd.csv"'), path)) == ((10.0, 0.5), (150.0, 2.0))
    assert levels_of(read_study(chirp_base('".5 g"'), path)) == 0.5 * 9.80665
    # what is kept needs no file
    text = study_text(study)
    (tmp_path / "levels.csv").unlink()
    assert same_study(read_study(text, path), study)


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ('"none.csv"', "base.acceleration = 'none.csv': must be an existing file of rows"),
        ('[[10, "1 g"], [9, "1 g"], [150, 1]]', "10 Hz is followed by 9 Hz"),
        ('[[10, "1 g"], [150, "0 g"]]', "[150, '0 g']: row 2: must have a level > 0, in m/s^2"),
        ('[[-10, "1 g"], [150, "1 g"]]', "[-10, '1 g']: row 1: must have a frequency > 0 Hz"),
        ('[["1 m", "1 g"], [150, "1 g"]]', "['1 m', '1 g']: row 1: must have a unit that fits: Hz"),
        ('[[10, "1 kg"], [150, "1 g"]]', "[10, '1 kg']: row 1: must have a unit that fits: m/s^2"),
        ('""', "base.acceleration = '': must be a number, or one with a decimal point and a unit"),
        (
            '[[10, "1 mm"], ["50 Hz", "1 mm"], ["50 Hz", "1 g"], [150, "1 g"]]',
            "[['50 Hz', '1 mm'], ['50 Hz', '1 g']]: row 3: must have frequencies that rise: 50 Hz is followed by 50 "
            "Hz; an edge has a width: 50 and 50.5 Hz",
        ),
        ('[[20, "1 g"], [150, "1 g"]]', "must reach from 10 to 150 Hz"),
        ('[[10, 1, 2], [150, "1 g"]]', "[10, 1, 2]: row 1: must be a frequency and a level"),
    ],
)
def test_bad_profile_is_one_line(rows: str, words: str) -> None:
    with pytest.raises(fi.InputError) as error:
        read(chirp_base(rows))
    assert words in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (
            "f [Hz],a [kg]\n" + "".join(f"{i},1\n" for i in range(1, 99)),
            "must have a unit that fits in place of the 'kg' in",
        ),
        ("f [Hz];a [g]\n10;0,5\n20;secret\n", "line 3: must be a number"),
        ("# plan\n10,0.5,1\n150,1,1\n", "line 2: must be a frequency and a level"),
        ("f,a\n10,1\n\n9,1\n", "line 4: must have frequencies that rise: 10 Hz is followed by 9 Hz"),
        ("nothing\n", "must have rows"),
    ],
)
def test_bad_file_of_rows_is_one_line_with_its_line_and_without_its_content(
    tmp_path: Path, content: str, words: str
) -> None:
    (tmp_path / "levels.csv").write_text(content)
    with pytest.raises(fi.InputError) as error:
        read_study(chirp_base('"levels.csv"'), tmp_path / "study.toml")
    assert f"base.acceleration = 'levels.csv': {words}" in str(error.value)
    assert "\n" not in str(error.value)
    assert "secret" not in str(error.value)


def test_file_of_rows_has_decimal_commas_and_a_row_of_units(tmp_path: Path) -> None:
    (tmp_path / "levels.csv").write_text("Frequenz;Pegel\nHz;g\n10;0,5\n150;1;\n")
    study = read_study(chirp_base('"levels.csv"'), tmp_path / "study.toml")
    assert levels_of(study) == ((10.0, 0.5 * 9.80665), (150.0, 9.80665))


def test_slopes_of_a_decade_and_in_other_words() -> None:
    ways = ['"6 dB/oct"', '"6 dB / octave"', f'"{float(6.0 / np.log10(2.0))!r} dB/decade"']
    levels = [read(random_base(f"[[20, {way}], [80, 0.1]]")).excitation.psd[0][1] for way in ways]
    # two octaves
    assert levels == pytest.approx([0.1 * 10.0**-1.2] * 3, rel=1e-12)


def test_rows_are_echoed_one_by_one() -> None:
    lines = unit_lines(read(random_base('[["20 Hz", "3 dB/oct"], [80, 0.1], ["2 kHz", 0.1]]')))
    assert lines == [
        "base.psd, row 1 = 20 Hz, 3 dB/oct: 20 Hz, 0.0251188643 (m/s^2)^2/Hz",
        "base.psd, row 3 = 2 kHz, 0.1: 2000 Hz, 0.1 (m/s^2)^2/Hz",
    ]
    assert unit_lines(read(octaves('"1 oct/min"')))[-1] == "base.octaves_per_minute = 1 oct/min: 1 oct/min"


def octaves(value: str) -> str:
    return chirp_base("1.0").replace("duration = 0.5", f"octaves_per_minute = {value}")


@pytest.mark.parametrize("value", ['"1 Hz"', '"1 rpm"', "true", '"fast"'])
def test_octaves_are_no_frequency(value: str) -> None:
    with pytest.raises(fi.InputError, match=r"base\.octaves_per_minute = .*oct/min"):
        read(octaves(value))
    with pytest.raises(fi.InputError, match=r"base\.frequency = '5 oct/s': must have a unit that fits: Hz"):
        read(paper_study_text().replace("frequency = 4.9 ", 'frequency = "5 oct/s" ', 1))


def test_octaves_alone_are_those_of_a_logarithmic_sweep() -> None:
    study = read(octaves("2").replace('rate = "logarithmic"\n', ""))
    assert study.excitation == fi.Chirp(10.0, 150.0, acceleration=1.0, kind="logarithmic", octaves_per_minute=2.0)
    assert same_study(read(study_text(study)), study)


def test_an_open_side_has_no_unit() -> None:
    with pytest.raises(fi.InputError, match=r"impactor\.ball\.gap = 'inf mm': must be inf for an open side, without"):
        read(paper_study_text().replace("gap = 0.004 ", 'gap = "inf mm" ', 1))


@pytest.mark.parametrize("value", ["nan mm", "4,5 mm", "mm", "", "0.23", "\u0664 mm"])
def test_text_that_is_no_quantity_is_told_the_form(value: str) -> None:
    with pytest.raises(fi.InputError) as error:
        read(paper_study_text().replace("gap = 0.004 ", f'gap = "{value}" ', 1))
    words = (
        f'impactor.ball.gap = {value!r}: must be a number, or one with a decimal point and a unit, as "0.5 m": m, cm'
    )
    assert str(error.value).startswith(words)
    assert "\n" not in str(error.value)


def test_place_in_millimetres_is_that_many_metres_from_the_root() -> None:
    study = read(paper_study_text().replace('at = "tip" ', 'at = "100 mm" ', 1))
    assert study.structure.masses[0].at == pytest.approx(0.1, rel=1e-15)
    assert same_study(read(study_text(study)), study)
    axes = '[study]\nmeasures = ["peak"]\n[study.axes]\n"impactor.ball.at" = ["100 mm", "tip"]\n'
    assert read(paper_study_text() + axes).plan.axes["impactor.ball.at"].values == (pytest.approx(0.1), "tip")


def test_scale_and_clip_have_the_units_of_a_plan(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("0,1\n0.1,2\n0.2,1\n")
    record = random_base("[]").replace('kind = "random"\npsd = []\nduration = 0.5', 'record = "a.csv"\nscale = "1 g"')
    assert read_study(record, tmp_path / "study.toml").source["scale"] == 9.80665
    clipped = read(random_base('[[20, 0.1], [80, 0.1]]\nclip = "3 sigma"'))
    assert clipped.excitation.clip == 3.0
    with pytest.raises(fi.InputError, match=r"base\.clip = '3 %': must have a unit that fits: sigma"):
        read(random_base('[[20, 0.1], [80, 0.1]]\nclip = "3 %"'))


def test_stiffness_of_a_power_law_has_the_unit_of_its_exponent() -> None:
    text = paper_study_text()
    law = text.partition("contact = ")[2].partition("\n")[0].partition("}")[0] + "}"
    for exponent, unit in (("", "1.5"), ("exponent = 2, ", "2")):
        written = f'{{ law = "flores", stiffness = "10 N/mm^{unit}", {exponent}restitution = 0.5 }}'
        power = text.replace(law, written, 1)
        contact: Any = read(power).structure.impactors[0].contact
        assert contact.stiffness == pytest.approx(10.0 * 1000.0 ** float(unit), rel=1e-14)
        validator = jsonschema.Draft202012Validator(study_schema())
        assert [e.message for e in validator.iter_errors(tomllib.loads(power))] == []
    half = power.replace("exponent = 2", 'exponent = "150 %"').replace("mm^2", "mm^1.5")
    assert (
        read(half).structure.impactors[0].contact == read(half.replace('"150 %"', "1.5")).structure.impactors[0].contact
    )
    with pytest.raises(fi.InputError, match=r"'10 N/mm\^2': must have a unit that fits: N/m\^1\.5"):
        read(half.replace("mm^1.5", "mm^2"))


def test_saved_text_changes_by_its_place_alone() -> None:
    text = paper_study_text().replace("mass = 0.00343 ", 'mass = "10 g" # "10 g" is a mass\n')
    text = text.replace("acceleration = 0.0 ", "acceleration = '10 g' ")
    text = text.replace("movie = true", 'movie = true\ntitle = "10 g"')
    study = read(text)
    saved = study_text(study)
    assert 'mass = 0.01 # "10 g" is a mass' in saved
    assert "acceleration = 98.0665 " in saved
    assert read(saved).output.title == "10 g"
    assert same_study(read(saved), study)


def test_frequencies_between_two_are_points_of_a_grid() -> None:
    steps = (
        'kind = "stepped-sine"\nfrequencies = { from = "4 Hz", to = 6, points = 5 }\ncycles = 10\nacceleration = "1 g"'
    )
    study = read(random_base("[]").replace('kind = "random"\npsd = []\nduration = 0.5', steps))
    assert study.excitation == fi.SteppedSine([4.0, 4.5, 5.0, 5.5, 6.0], cycles=10, acceleration=9.80665)
    assert same_study(read(study_text(study)), study)
    assert [
        e.message for e in jsonschema.Draft202012Validator(study_schema()).iter_errors(tomllib.loads(study.text))
    ] == []


def test_stepped_sine_of_a_plan() -> None:
    text = random_base("[]").replace(
        'kind = "random"\npsd = []\nduration = 0.5',
        'kind = "stepped-sine"\nfrequencies = ["10 Hz", 20, "0.03 kHz"]\nseconds = "2 s"\nfade = "100 ms"\n'
        'acceleration = [[10, "1 mm"], [16, "1 g"], [30, "1 g"]]',
    )
    study = read(text)
    levels = study.excitation.level
    expected = fi.SteppedSine([10, 20, 30], seconds=2.0, fade=0.1, acceleration=levels)
    assert study.excitation == expected
    assert same_study(read(study_text(study)), study)


@pytest.mark.parametrize(
    "levels", ['{ from = "36 Hz", to = "48 Hz", points = 3 }', '["36 Hz", "40 Hz"]', "[36.0, 40.0]"]
)
def test_the_frequency_of_a_stepped_sine_is_no_axis_and_the_way_is_named(levels: str) -> None:
    base = 'kind = "stepped-sine"\nfrequencies = [36.0, 48.0]\ncycles = 9\nacceleration = 1.0\n'
    head, _, rest = paper_study_text().partition("[base]")
    text = f"{head}[base]\n{base}\n[" + rest.partition("\n[")[2]
    text = text.partition("[sweep]")[0] + f'[study]\nmeasures = ["peak"]\n[study.axes]\n"base.frequency" = {levels}\n'
    with pytest.raises(fi.InputError) as error:
        definition_of(read(text))
    (fault,) = error.value.faults
    assert fault.key == "study.axes.base.frequency"
    assert fault.allowed.endswith("an axis of frequencies takes [base] of kind 'sine', with acceleration or amplitude")
