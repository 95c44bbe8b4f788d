"""Search coordinates: transformation, slopes, bounds and priors."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.model.parameter import Coordinates, Parameter

PARAMETERS = (
    Parameter("positive", "ohm", "a logarithm", search="log", prior_mean=0.5, prior_sd=2.0),
    Parameter("scaled", "1/K", "a multiple", scale=1e-3, prior_mean=0.004, prior_sd=3.0),
    Parameter("bounded", "N m s/rad", "not negative", scale=0.1, lower=0.0, upper=2.0),
)


@given(
    st.floats(-20.0, 20.0),
    st.floats(-50.0, 50.0),
    st.floats(0.0, 20.0),
)
def test_values_and_coordinates_are_inverse(a: float, b: float, c: float) -> None:
    """The transformation and its inverse give the original values."""
    coordinates = Coordinates(PARAMETERS)
    point = np.array([a, b, c])

    back = coordinates.of(coordinates.values(point))

    np.testing.assert_allclose(back, point, rtol=1e-12, atol=1e-12)


def test_slopes_are_derivatives_of_the_values() -> None:
    """Reference: central differences with step 1e-6, exact to 1e-9 for these transformations."""
    coordinates = Coordinates(PARAMETERS)
    point = np.array([-2.0, 3.0, 4.0])

    slopes = coordinates.slopes(point)

    step = 1e-6
    above, below = coordinates.values(point + step), coordinates.values(point - step)
    np.testing.assert_allclose(slopes, (above - below) / (2 * step), rtol=1e-8)


def test_the_prior_is_normal_in_the_coordinates() -> None:
    """Closed form: minus half the squared distance in standard deviations; flat priors add zero."""
    coordinates = Coordinates(PARAMETERS)
    values = np.array([0.5 * np.exp(2.0), 0.004 + 0.006, 1.9])

    density = coordinates.log_prior(coordinates.of(values))

    assert density == pytest.approx(-0.5 * (1.0**2 + 2.0**2))


@pytest.mark.parametrize("value", [-1e-9, 2.0 + 1e-9])
def test_a_point_out_of_bounds_is_impossible(value: float) -> None:
    """The bounds of the third parameter are 0 and 2."""
    coordinates = Coordinates(PARAMETERS)

    density = coordinates.log_prior(coordinates.of(np.array([0.5, 0.004, value])))

    assert density == -np.inf


def test_many_points_are_transformed_in_parallel() -> None:
    """Reference: one point at a time."""
    coordinates = Coordinates(PARAMETERS)
    points = np.random.default_rng(0).normal(size=(3, 5))

    values, density = coordinates.values(points), coordinates.log_prior(points)

    for k in range(5):
        np.testing.assert_array_equal(values[:, k], coordinates.values(points[:, k]))
        assert density[k] == coordinates.log_prior(points[:, k])
