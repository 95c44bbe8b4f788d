"""Roots of polynomials over many decades."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from identification.speed_loop.roots import monic_roots

SIZES = st.floats(-6, 6).map(lambda exponent: 10.0**exponent)


@settings(deadline=None, max_examples=100)
@given(st.lists(SIZES, min_size=1, max_size=6))
def test_real_roots_twelve_decades_apart_are_found(sizes: list[float]) -> None:
    """Reference: the roots that form the polynomial, to the accuracy that their distance permits.

    A relative rounding error e of a coefficient shifts the roots of a cluster of k by e^(1/k).
    """
    wanted = -np.sort(sizes)
    gaps = np.abs(np.subtract.outer(wanted, wanted)) / np.maximum.outer(-wanted, -wanted)
    apart = np.min(gaps[np.triu_indices(len(sizes), 1)], initial=1.0)

    found = np.sort(monic_roots(np.real(np.poly(wanted))[None]).real[0])[::-1]

    assert found == pytest.approx(wanted, rel=1e-13 / max(apart, 1e-8) ** (len(sizes) - 1) + 1e-12)


@settings(deadline=None, max_examples=100)
@given(SIZES, SIZES, st.floats(-2, 4))
def test_complex_pair_and_real_root_are_found(real: float, decay: float, ratio: float) -> None:
    """The coefficients recomputed from the roots equal the given ones, relative to their terms."""
    pair = decay * np.array([-1 + 1j * 10**ratio, -1 - 1j * 10**ratio])
    coefficients = np.real(np.poly([-real, *pair]))

    found = monic_roots(coefficients[None])[0]

    assert found[0].imag == 0
    assert found[1] == np.conj(found[2])
    assert np.real(np.poly(found)) == pytest.approx(coefficients, rel=1e-9)
    assert abs(found[1]) == pytest.approx(abs(pair[0]), rel=1e-6)


@pytest.mark.parametrize("apart", [0.0, 1e-9, 1e-4, -1e-9, -1e-4])
@pytest.mark.parametrize("others", [[-1e4], [-3.0, -1e9], [-0.5 + 7j, -0.5 - 7j]])
def test_near_double_root_keeps_its_sum_and_its_product(
    apart: float, others: list[complex]
) -> None:
    """s^2 + 2 s + 1 + apart: a step response depends on these two, not on each root."""
    coefficients = np.real(np.convolve([1, 2, 1 + apart], np.poly(others)))

    found = monic_roots(coefficients[None])[0]

    pair = found[np.argsort(np.abs(found + 1))[:2]]
    assert pair.sum() == pytest.approx(-2, rel=1e-13)
    assert pair.prod() == pytest.approx(1 + apart, rel=1e-13)


@pytest.mark.parametrize(
    ("coefficients", "expected"),
    [
        ([1, 4, 4], [-2, -2]),
        ([1, 0, 0], [0, 0]),
        ([1, 0, 4], [2j, -2j]),
        ([1, 5], [-5]),
        ([1, 3, 0], [-3, 0]),
        ([1, 0, 0, 0], [0, 0, 0]),
        ([1, 2, 0, 0], [-2, 0, 0]),
        ([1, 6, 11, 6], [-3, -2, -1]),
        ([1, 0, -1, 0], [-1, 0, 1]),
        ([1, 0, -5, 0, 4], [-2, -1, 1, 2]),
        ([1, 7, 21, 37, 30], [-3, -2, -1 + 2j, -1 - 2j]),
        ([1, 13, 67, 185, 300, 250], [-5, -1 + 2j, -1 - 2j, -3 + 1j, -3 - 1j]),
    ],
)
def test_roots_at_zero_and_double_roots_are_exact(
    coefficients: list[float], expected: list[complex]
) -> None:
    """Polynomials with small integer roots, in the documented order of a pair."""
    found = monic_roots(np.array([coefficients], dtype=float))[0]

    assert found == pytest.approx(np.array(expected, dtype=complex), abs=1e-9)
