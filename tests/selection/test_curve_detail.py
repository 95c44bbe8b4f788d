"""Detail that the spline of a curve cannot represent, and the parameters that absorb it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from bench import Campaign, EffectRequest, make_campaign
from identification.fit.declared import fit_declared
from identification.fit.effective_samples import effective_fraction
from identification.fit.noise import with_noise_model
from identification.fit.solve import Fit
from identification.selection.curve_detail import DETAIL_RATIO, bumps, curve_details
from identification.selection.omitted import consider_variances
from tests.effects.hidden import records_of_bench
from tests.selection.curved import with_curve

Array = NDArray[np.float64]


def curved_fit(measured: Campaign) -> Fit:
    """Nominal model and a curve over the voltage, fitted to the training runs."""
    declared = fit_declared(records_of_bench(measured).training, "zoh")
    return with_noise_model(with_curve(declared, "voltage", "", "electrical"))


def errors_of(fit: Fit, truth: Mapping[str, float], name: str) -> tuple[float, float]:
    """Error of a parameter in standard deviations, without and with the detail of the curve."""
    fraction = effective_fraction(fit)
    k = fit.coordinates.names.index(name)
    error = (fit.by_name[name] - truth[name]) / fit.coordinates.slopes(fit.position)[k]
    variance = fit.equations.covariance(fraction)[k, k]
    added = consider_variances(fit, curve_details(fit, fraction))[k]
    return abs(error) / np.sqrt(variance), abs(error) / np.sqrt(variance + added)


def test_intervals_include_the_kink_of_a_dead_zone_that_a_spline_rounds_off() -> None:
    """Errors of a temperature coefficient, which no curve over the voltage can form."""
    found = []
    for seed in range(1, 5):
        effects = [EffectRequest("dead_zone", 0.05, "hard")]
        measured = make_campaign("servo_150w", effects, seed, rows=1500)
        found.append(errors_of(curved_fit(measured), measured.truth["parameters"], "alpha_Ra"))

    narrow, honest = np.sqrt(np.mean(np.square(found), axis=0))

    # Four standard normal numbers have a root mean square below 1.82 in 99 of 100 cases.
    assert narrow > 1.82 > honest


def test_a_curve_without_a_law_behind_it_widens_nothing() -> None:
    """The voltage curve of a clean motor is noise."""
    fit = curved_fit(make_campaign("servo_150w", [], seed=1, rows=1500))
    fraction = effective_fraction(fit)

    added = consider_variances(fit, curve_details(fit, fraction))

    rows = [fit.coordinates.names.index(name) for name in ("alpha_Ra", "alpha_Kt")]
    variances = np.diag(fit.equations.covariance(fraction))
    assert np.all(added[rows] < 0.1 * variances[rows])


def test_a_model_without_a_curve_has_no_detail() -> None:
    """Only a curve has knots."""
    measured = make_campaign("servo_150w", [], seed=1, rows=600)
    assert curve_details(fit_declared(records_of_bench(measured).training, "zoh"), 1.0) == ()


def test_bumps_leave_value_and_slope_at_the_knots() -> None:
    """Near a knot they are of second order."""
    knots = np.linspace(0.0, 6.0, 7)
    near = 1e-4

    for side in (-near, near):
        assert np.all(np.abs(bumps(knots + side)) < 20 * near**2)
    np.testing.assert_allclose(bumps(np.linspace(0.5, 5.5, 6)), np.eye(6))


def test_integrated_wiener_process_has_the_assumed_detail() -> None:
    """Brownian motion integrated twice by small steps, seen at knots of distance one."""
    rng = np.random.default_rng(0)
    fine, spans, laws = 64, 12, 2000
    slopes = np.cumsum(rng.standard_normal((laws, spans * fine)), axis=1) / np.sqrt(fine)
    values = np.cumsum(slopes, axis=1) / fine
    at_knots = values[:, fine - 1 :: fine]
    bends = CubicSpline(np.arange(spans), at_knots, axis=1)(np.arange(spans), 2)[:, 4:-4]
    # Hermite interpolation from values and slopes at both ends of a span, at its middle.
    left, right = slice(fine - 1, -fine, fine), slice(2 * fine - 1, None, fine)
    middle = values[:, fine - 1 + fine // 2 :: fine][:, : spans - 1]
    hermite = 0.5 * (values[:, left] + values[:, right])
    hermite += 0.125 * (slopes[:, left] - slopes[:, right])

    found = np.mean((middle - hermite) ** 2) / np.mean(bends**2)

    assert found == pytest.approx(DETAIL_RATIO, rel=0.1)
