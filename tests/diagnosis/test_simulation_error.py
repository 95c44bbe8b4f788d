"""RMSE, NRMSE and fit percentage of simulations."""

from __future__ import annotations

import numpy as np
import pytest

from identification.diagnosis.residual import Errors, pooled_errors


def test_the_mean_of_a_record_as_simulation_has_a_fit_of_zero() -> None:
    """A simulation equal to the mean of the record has a NRMSE of 1 by definition."""
    measured = np.array([1.0, 4.0, 2.0, 9.0])

    assert pooled_errors([measured - measured.mean()], [measured]).nrmse == pytest.approx(1.0)
    assert pooled_errors([np.zeros(4)], [measured]) == Errors(0.0, 0.0)


def test_rmse_of_a_constant_error_is_that_error() -> None:
    """sqrt(mean 3^2) = 3."""
    assert pooled_errors([np.full(7, -3.0)], [np.arange(7.0)]).rmse == pytest.approx(3.0)


def test_nrmse_does_not_depend_on_the_unit() -> None:
    """Numerator and denominator scale with the unit."""
    rng = np.random.default_rng(31)
    measured, residual = rng.standard_normal((2, 50))

    scaled = pooled_errors([60 * residual], [60 * measured])
    assert scaled.nrmse == pytest.approx(pooled_errors([residual], [measured]).nrmse)


def test_pooling_a_run_with_itself_changes_nothing() -> None:
    """The sum of squares and the number of samples double together."""
    rng = np.random.default_rng(32)
    measured, residual = rng.standard_normal((2, 80))

    single = pooled_errors([residual], [measured])
    double = pooled_errors([residual, residual], [measured, measured])

    assert double.rmse == pytest.approx(single.rmse)
    assert double.nrmse == pytest.approx(single.nrmse)


def test_two_steady_speeds_do_not_pass_for_a_good_fit() -> None:
    """Each run is compared with its own mean, so a model of the means alone has a NRMSE of 1."""
    rng = np.random.default_rng(33)
    slow, fast = 10 + rng.standard_normal(100), 300 + rng.standard_normal(100)

    errors = pooled_errors([slow - slow.mean(), fast - fast.mean()], [slow, fast])

    assert errors.nrmse == pytest.approx(1.0)


def test_an_error_on_a_channel_that_never_moves_has_no_finite_nrmse() -> None:
    """The standard deviation of a constant channel is zero."""
    assert pooled_errors([np.ones(5)], [np.zeros(5)]).nrmse == np.inf
    assert pooled_errors([np.zeros(5)], [np.zeros(5)]).nrmse == 0.0


def test_no_samples_are_refused() -> None:
    """A mean over no samples is not a number."""
    with pytest.raises(ValueError, match="expected at least one run with one row"):
        pooled_errors([], [])
