"""Modal truncation: what a static correction repairs, what it says of itself, and what converges."""

import math

import numpy as np
import pytest
from builders import cantilever

import femimpact as fi

pytestmark = pytest.mark.impacts


@pytest.fixture(scope="module")
def study():
    return fi.convergence.mode_convergence(
        cantilever(), fi.Sine(0.2037e-3, 5.0), fi.EventDriven(), 24.0, [1, 2, 4, 8, 16]
    )


def both(table, name, field="value"):
    """Columns of a quantity without and with static correction."""
    return np.array([getattr(table, field)[..., table.index(name + end)] for end in ("", " corrected")]).T


def test_the_first_impact_converges_over_the_modes(study):
    for name in ("first displacement", "first loss"):
        error, order = both(study, name, "error"), both(study, name, "fitted_order")
        assert np.all(np.diff(error, axis=0) < 0.0)
        # the correction brings part of the missing flexibility, at every count
        assert np.all(error[:-1, 1] < error[:-1, 0])
        # mobility left out by n modes of a beam that ends in a body goes with 1/n
        assert np.all((order > 0.8) & (order < 1.8))


def test_the_loss_of_the_first_impact_is_newtons(study):
    # one rigid impact on the mass that n modes show: (1 - e^2) m_eff v^2/2
    full = cantilever()
    speed = 8e-3 * full.first_frequency
    for i, n in enumerate(study.number):
        row = fi.reduce(full, int(n)).contacts[0].direction
        loss = 0.5 * (1 - 0.6**2) * speed**2 / (1 / 3.43e-3 + row @ row)
        assert both(study, "first loss")[i, 0] == pytest.approx(loss, rel=1e-9)


def test_columns_of_a_study(study):
    assert "(rigid)" in study.problem
    assert "the last 40 base cycles" in study.problem
    assert np.all(both(study, "residual") < 1e-10)
    assert np.all(np.isnan(both(study, "peak force")))
    for name in ("rms", "peak", "contact loss", "structure loss", "damping", "mean impulse"):
        assert np.all(both(study, name, "scatter") > 0.0), name
        assert np.all(np.isfinite(both(study, name))), name
    data = study.to_xarray()
    assert data["value"].sel(quantity="rms corrected").shape == (5,)
    assert str(data["unit"].sel(quantity="rms").item()) == "m"


def test_equivalent_damping_is_the_modes_own_where_nothing_touches():
    full = cantilever(damping=0.02)
    f1 = full.first_frequency
    # phase: the ball starts at rest in the inertial frame, and stays
    quiet = fi.convergence.mode_convergence(full, fi.Sine(1e-5, f1, math.pi / 2), fi.EventDriven(), 150.0, [1, 2, 3])
    assert np.all(both(quiet, "contact loss") == 0.0)
    assert np.all(np.isnan(both(quiet, "mean impulse")))
    np.testing.assert_allclose(both(quiet, "damping")[0, 0], 0.02, rtol=1e-6)
    # the other modes hardly move
    np.testing.assert_allclose(both(quiet, "damping"), 0.02, rtol=1e-3)


def test_without_a_body_at_the_contact_the_loss_goes_to_the_structure():
    full = cantilever(box=0.0)
    bare = fi.convergence.mode_convergence(
        full, fi.Sine(0.2e-3, full.first_frequency), fi.EventDriven(), 2.0, [1, 4, 12]
    )
    assert both(bare, "first loss")[-1, 0] < 0.5 * both(bare, "first loss")[0, 0]
    assert both(bare, "first displacement", "error")[-1, 0] < 1e-2
    assert any("at a rigid contact without a body" in note for note in bare.notes)


def test_a_compliant_contact_has_its_peak_force_in_a_column_and_in_a_note():
    full = cantilever(fi.KelvinVoigt(stiffness=2e3, restitution=0.6), elements=10)
    result = fi.convergence.mode_convergence(
        full, fi.Sine(0.2037e-3, 5.0), fi.Newmark(fi.recommended_step(full)), 6.0, [1, 2, 4]
    )
    assert np.all(both(result, "peak force") > 0.0)
    assert any("peak force (kelvin-voigt)" in note for note in result.notes)
    assert np.all(np.diff(both(result, "first displacement", "error")[:, 0]) < 0.0)


def test_a_stop_is_met_in_the_first_mode():
    full = cantilever(places=(), stops=("tip",))
    result = fi.convergence.mode_convergence(full, fi.Sine(0.2037e-3, 5.0), fi.EventDriven(), 6.0, [1, 2, 4])
    assert np.all(both(result, "first loss") > 0.0)
    error = both(result, "first displacement", "error")
    assert error[1, 0] < error[0, 0]


def test_the_figure_has_a_panel_for_each_kind_of_quantity(study, tmp_path):
    axes = fi.figures.convergence_panels(study, fi.figures.OffScreen())
    assert {axis.get_xlabel() for axis in axes} == {"modes kept"}
    assert fi.figures.save_figure(axes, tmp_path / "modes.png").stat().st_size > 10_000
