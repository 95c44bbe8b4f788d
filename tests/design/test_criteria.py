"""Expected information against closed forms and against integration of the densities."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from identification.design.criteria import information_bits, narrowed, separation
from identification.design.profiles import slew_limited
from identification.design.response import Response


def known(mean: list[float]) -> Response:
    """Readings of a model without unknown parameters."""
    size = len(mean)
    return Response(np.array(mean), np.zeros((size, 1)), np.eye(1), 1)


def test_covariance_after_a_run_is_the_inverse_of_the_sum_of_both_precisions() -> None:
    """The posterior of a linear Gaussian model, computed by direct inversion."""
    rng = np.random.default_rng(1)
    half, slopes = rng.standard_normal((4, 4)), rng.standard_normal((30, 4))
    before, information = half @ half.T, slopes.T @ slopes

    after = narrowed(before, information)

    assert after == pytest.approx(np.linalg.inv(np.linalg.inv(before) + information))


def test_information_is_the_fall_of_the_entropy_of_the_parameters() -> None:
    """The entropy of a normal distribution is half the logarithm of det(2 pi e C)."""
    rng = np.random.default_rng(2)
    half, slopes = rng.standard_normal((3, 3)), rng.standard_normal((9, 3))
    before, information = half @ half.T, slopes.T @ slopes

    bits = information_bits(before, information)

    after = narrowed(before, information)
    ratio = np.linalg.slogdet(before)[1] - np.linalg.slogdet(after)[1]
    assert bits == pytest.approx(0.5 * ratio / np.log(2.0))


@pytest.mark.parametrize("distance", [0.1, 1.0, 3.0])
def test_bounds_enclose_information_and_error_of_two_known_models(distance: float) -> None:
    """Numerical integration of two unit normal densities; the better choice errs in sf(d / 2)."""

    def lost(y: float) -> float:
        first, second = norm.pdf(y), norm.pdf(y - distance)
        mixed = 0.5 * (first + second)
        return float(0.5 * (first * np.log2(first / mixed) + second * np.log2(second / mixed)))

    information = quad(lost, -8.0, distance + 8.0)[0]

    found = separation([known([0.0, 0.0]), known([distance, 0.0])], [0.5, 0.5])

    assert found.least_bits <= information <= found.most_bits
    assert norm.sf(distance / 2) <= found.wrong <= 0.5


def test_a_parameter_that_imitates_the_difference_leaves_nothing_to_separate() -> None:
    """Normal densities at a distance d with the variance 1 + s^2, s from the parameter."""
    slope = np.array([[1.0], [0.0]])
    spread = 100.0

    def free(mean: float) -> Response:
        return Response(np.array([mean, 0.0]), slope, np.array([[spread**2]]), 1)

    found = separation([free(0.0), free(3.0)], [0.5, 0.5])

    assert found.log_odds[0, 1] == pytest.approx(0.5 * 9.0 / (1.0 + spread**2))


def test_slew_limited_voltage_changes_by_the_limit_at_most_and_returns_to_zero() -> None:
    """The definition of a slew rate, for a signal that jumps between both limits."""
    wanted = 10.0 * np.sign(np.sin(np.arange(200) / 7.0))

    voltage = slew_limited(wanted, 0.8)

    assert np.abs(np.diff(voltage)).max() <= 0.8 + 1e-12
    assert voltage[0] == voltage[-1] == 0.0
    assert np.abs(voltage).max() > 5.0
