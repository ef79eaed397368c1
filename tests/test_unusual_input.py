"""Beams that are allowed, and so unusual that a warning names the number."""

import warnings

import pytest

import femimpact as fi


def beam(**changes):
    given = {"length": 0.23, "width": 0.02, "thickness": 1e-3, "young_modulus": 70e9, "density": 2700.0}
    return fi.Structure(beam=fi.Beam.uniform(**{**given, **changes}))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        # 230 mm by 20 mm by 1 mm, typed as metres
        ({"length": 230.0, "width": 20.0, "thickness": 1.0}, r"beam\.mass = 1\.242e\+07 kg: more than 1000 kg"),
        ({"thickness": 0.1}, r"beam\.length = 2\.3 times the thickness: below 5"),
        ({"young_modulus": 70.0}, r"first mode at 0\.000\d+ Hz: outside 0\.01 to 100000 Hz"),
        ({"length": 2.3e-4, "thickness": 2e-5}, r"first mode at \d+(\.\d+)?e\+05 Hz: outside"),
    ],
)
def test_an_unusual_beam_is_taken_with_a_warning_that_names_the_number(changes, words):
    with pytest.warns(fi.InputWarning, match=words):
        system = fi.assemble(beam(**changes), elements=4)
    assert system.first_frequency > 0.0


def test_a_usual_beam_is_taken_without_a_word():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fi.assemble(beam(), elements=4)
