"""A bar of progress is drawn where one is asked for, and the result is the same."""

from __future__ import annotations

import numpy as np
import pytest

import femimpact as fi

BEAM = fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
SYSTEM = fi.reduce(fi.assemble(fi.Structure(BEAM, damping=fi.Rayleigh(0.01, modes=(1, 2))), elements=8), modes=2)
BASE = fi.Sine(1e-4, 10.0)


def test_true_draws_a_bar_on_stderr_and_changes_no_number(capsys):
    plain = fi.integrate(SYSTEM, BASE, fi.EventDriven(), 0.5)
    assert capsys.readouterr().err == ""
    drawn = fi.integrate(SYSTEM, BASE, fi.EventDriven(), 0.5, progress=True)
    out, err = capsys.readouterr()
    assert out == ""
    assert "integrate" in err
    np.testing.assert_array_equal(drawn["tip"], plain["tip"])


def test_false_draws_none(capsys):
    fi.frequency_sweep(SYSTEM, 1e-4, [9.0, 10.0, 11.0, 12.0], fi.EventDriven(), cycles=24, progress=False)
    assert capsys.readouterr().err == ""


def test_a_bar_does_not_hide_an_error(capsys):
    with pytest.raises(fi.InputError, match="duration"):
        fi.integrate(SYSTEM, BASE, fi.EventDriven(), -1.0, progress=True)
    capsys.readouterr()


def test_reprs_are_short_and_say_what_a_value_is():
    run = fi.integrate(SYSTEM, BASE, fi.EventDriven(), 2.0)
    assert repr(BEAM) == "Beam: 0.23 m, 0.01242 kg, 1 segment: beam"
    structure = fi.Structure(BEAM, [fi.PointMass("box", "tip", 0.02)], gravity=-9.81)
    assert repr(structure).splitlines()[0] == "Structure: beam of 0.23 m, 0.01242 kg"
    assert "box at tip" in repr(structure)
    assert repr(run.regime) == "Regime: no impacts"
    assert repr(run.steady).splitlines()[0] == "SteadyMotion: 1 case"
    estimate = fi.signals.DampingEstimate(0.01, 5.0, (0.009, 0.011), "half-power")
    assert repr(estimate) == "DampingEstimate: 0.0100 (0.0090 to 0.0110) at 5 Hz by half-power"


def test_versions_name_the_core_and_every_library_that_is_needed(capsys):
    fi.show_versions()
    lines = dict(line.split(None, 1) for line in capsys.readouterr().out.splitlines())
    assert lines["femimpact"] == fi.__version__
    assert {"core", "python", "platform", "numpy", "scipy", "scikit-fem", "gmsh"} <= set(lines)
