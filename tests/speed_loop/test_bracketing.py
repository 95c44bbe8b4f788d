"""Roots in brackets."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from identification.speed_loop.roots import root

Array = NDArray[np.float64]


def rise(time: Array, rate: Array, level: Array) -> Array:
    """Response of a first-order lag above a level."""
    return np.asarray(1.0 - np.exp(-rate * time) - level)


@settings(deadline=None, max_examples=100)
@given(
    st.lists(
        st.tuples(st.floats(-6, 6), st.floats(0.01, 0.99), st.floats(1.1, 1e6)),
        min_size=1,
        max_size=20,
    )
)
def test_a_lag_reaches_a_level_when_its_logarithm_says(
    cases: list[tuple[float, float, float]],
) -> None:
    """Closed form t = -log(1 - level) / rate, for rates over twelve decades and any bracket."""
    exponents, levels, factors = np.array(cases).T
    rates = 10.0**exponents
    expected = -np.log1p(-levels) / rates

    found = root(rise, (0.0 * expected, factors * expected), (rates, levels))

    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_a_bracket_without_a_change_of_sign_has_no_root() -> None:
    """Between 2 and 3 a lag of rate 1 stays above one half; an end that is a root is one."""
    ends = np.array([2.0, -np.log(0.5), 0.0]), np.array([3.0, 3.0, np.inf])

    found = root(rise, ends, (np.ones(3), np.full(3, 0.5)))

    assert np.isnan(found[[0, 2]]).all()
    assert np.isclose(found[1], np.log(2.0))


def test_no_brackets_have_no_roots() -> None:
    """An empty set of loops is common: no draw crosses the band."""
    assert root(rise, (np.empty(0), np.empty(0)), (np.empty(0), np.empty(0))).size == 0
