"""Modal sums in Newton's form, compared with the matrix exponential and closed forms."""

from __future__ import annotations

from math import factorial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.linalg import expm

from identification.speed_loop.modes import Modes, bound_at, time_below

TIMES = np.array([0.0, 1e-6, 0.01, 0.3, 1.0, 4.0])
RATES = st.floats(0.2, 8.0)


def check_against_realisation(poles: list[complex], numerator: NDArray[np.float64]) -> None:
    """Compare a modal sum with the output of its companion realisation at several times."""
    order = len(poles)
    companion = np.eye(order, k=-1)
    companion[0] = -np.real(np.poly(poles))[1:]
    start = np.eye(order)[0]
    expected = [numerator @ state @ start for state in expm(companion * TIMES[:, None, None])]

    modes = Modes.of(numerator[None], np.array([poles], dtype=complex))

    found = modes.at(TIMES, np.zeros(TIMES.size, dtype=int))
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-9)


@settings(deadline=None, max_examples=60)
@given(RATES, st.floats(0, 1e-2), st.floats(0, 1e-2), st.permutations(range(3)))
def test_three_poles_that_nearly_meet_sum_like_the_matrix_exponential(
    rate: float, near: float, nearer: float, order: list[int]
) -> None:
    """For gaps down to zero, in any order, where partial fractions would lose all digits."""
    poles = np.array([-rate, -rate - near, -rate - near - nearer])[order]

    check_against_realisation(list(poles), np.array([0.3, -1.0, 2.0]))


@settings(deadline=None, max_examples=60)
@given(RATES, RATES, st.floats(0, 20.0))
def test_complex_pair_and_real_pole_sum_like_the_matrix_exponential(
    real: float, decay: float, swing: float
) -> None:
    """From a double real pole (no oscillation) to a fast oscillation."""
    poles = [-real, -decay + 1j * swing, -decay - 1j * swing]

    check_against_realisation(poles, np.array([1.0, 0.5, -3.0]))


@settings(deadline=None, max_examples=60)
@given(RATES, st.floats(0, 1e-2), RATES, st.floats(0, 20.0), st.floats(0, 1e-2))
def test_six_poles_sum_like_the_matrix_exponential(
    real: float, near: float, decay: float, swing: float, nearer: float
) -> None:
    """Two real poles and two pairs, each of which may nearly meet the other of its kind."""
    pairs = [-decay + 1j * swing, -decay - nearer + 1j * (swing + nearer)]
    poles = [-real, -real - near, *(q for p in pairs for q in (p, p.conjugate()))]

    check_against_realisation(poles, np.array([0.5, 1.0, 0.5, -3.0, 2.0, 1.0]))


@settings(deadline=None, max_examples=60)
@given(RATES, RATES)
def test_two_poles_sum_like_the_matrix_exponential(first: float, second: float) -> None:
    """Two real poles, also equal ones."""
    check_against_realisation([-first, -second], np.array([-0.7, 2.0]))


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5])
def test_repeated_pole_gives_the_power_of_time_of_the_table_of_transforms(order: int) -> None:
    """1 / (s + 2)^n is the transform of t^(n-1) exp(-2 t) / (n-1)!."""
    numerator = np.eye(order)[-1:]
    expected = TIMES ** (order - 1) * np.exp(-2 * TIMES) / factorial(order - 1)

    modes = Modes.of(numerator, np.full((1, order), -2 + 0j))

    np.testing.assert_allclose(modes.at(TIMES, np.zeros(6, dtype=int)), expected, rtol=1e-14)


def test_residues_are_the_partial_fractions() -> None:
    """(s + 3) / ((s + 1)(s + 2)) = 2 / (s + 1) - 1 / (s + 2)."""
    modes = Modes.of(np.array([[1.0, 3.0]]), np.array([[-1 + 0j, -2 + 0j]]))

    np.testing.assert_allclose(modes.residues, [[2, -1]], rtol=1e-14)


@settings(deadline=None, max_examples=60)
@given(RATES, RATES, st.floats(0, 30.0), st.floats(-2, 2), st.sampled_from([0.02, 1e-9]))
def test_no_later_instant_leaves_the_level(
    real: float, decay: float, swing: float, middle: float, level: float
) -> None:
    """Response and bound are checked at two thousand instants after the returned time."""
    poles = np.array([[-real, -2 * real, -decay + 1j * swing, -decay - 1j * swing]])
    modes = Modes.of(np.array([[1.0, middle, 0.4, -middle]]), poles)
    zeros = np.zeros(2000, dtype=int)

    begin = time_below(modes, level)[0]

    later = begin + np.linspace(0, 20 / min(real, decay), 2000)
    values = np.abs(modes.at(later, zeros))
    assert (values <= level).all()
    assert (values <= bound_at(modes, later, zeros) * (1 + 1e-9) + 1e-15).all()


def test_time_below_a_level_is_not_far_too_late() -> None:
    """For exp(-t), the time is log(1 / level); for a double pole, it solves t exp(-t) = level."""
    single = Modes.of(np.array([[1.0, 5.0]]), np.array([[-1 + 0j, -5 + 0j]]))
    double = Modes.of(np.array([[0.0, 1.0]]), np.array([[-1 + 0j, -1 + 0j]]))

    assert time_below(single, 0.02)[0] == pytest.approx(np.log(50), rel=1e-5)
    late = time_below(double, 0.02)[0]
    assert late * np.exp(-late) == pytest.approx(0.02, rel=1e-3)
