"""Maximisation by a quasi-Newton method that evaluates points in parallel lanes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.diagnosis.maximise import maximise

Array = NDArray[np.float64]

WIDE = (np.full(3, -50.0), np.full(3, 50.0))


def hill(points: Array) -> Array:
    """Curved function with maximum 7 at (1, 2, 3); its curvatures differ by four decades."""
    x, y, z = points
    return np.asarray(
        7.0 - 500.0 * (x - 1) ** 2 - 5.0 * (y - 2 - (x - 1)) ** 2 - 0.05 * (z - 3) ** 2
    )


def test_the_maximum_is_found() -> None:
    """The maximum in closed form is reached within the tolerance of 0.01 of the optimiser."""
    point, value = maximise(hill, np.array([-4.0, 9.0, 0.0]), WIDE)

    assert value == pytest.approx(7.0, abs=0.02)
    np.testing.assert_allclose(point[:2], [1.0, 2.0], atol=0.1)


def test_an_active_bound_leaves_the_other_coordinates_free() -> None:
    """With x held at 3 by a bound, the best y is 2 + (3 - 1) = 4."""
    bounds = (np.array([3.0, -50.0, 3.0]), np.array([50.0, 50.0, 3.0]))

    point, _ = maximise(hill, np.array([5.0, -1.0, 3.0]), bounds)

    assert point[0] == 3.0
    assert point[1] == pytest.approx(4.0, abs=0.1)
    assert point[2] == 3.0


def test_a_point_without_a_value_is_avoided() -> None:
    """The logarithm of a negative number is undefined; x - log x has its minimum at 1."""

    def valued(points: Array) -> Array:
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(-20.0 * (points[0] - np.log(points[0])))

    point, _ = maximise(valued, np.array([4.0]), (np.array([-9.0]), np.array([9.0])))

    assert point[0] == pytest.approx(1.0, abs=0.05)


def test_a_search_that_cannot_reach_its_rival_stops_early() -> None:
    """The maximum is 7, so a search against a rival value of 1e6 may stop before convergence."""
    calls = []

    def counted(points: Array) -> Array:
        calls.append(points.shape[1])
        return hill(points)

    maximise(counted, np.array([-40.0, 49.0, -40.0]), WIDE, rival=1e6)
    abandon_cost = len(calls)
    calls.clear()
    maximise(counted, np.array([-40.0, 49.0, -40.0]), WIDE)

    assert abandon_cost <= len(calls)
