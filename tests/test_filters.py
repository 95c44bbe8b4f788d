"""Linear filters against those of scipy.signal."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from identification.filters import moving_average, recursive

TAPS = np.array([1.0, -1.2, 0.5, 0.1])


@pytest.mark.parametrize("rows", [1, 2, 3, 500])
@pytest.mark.parametrize("columns", [(), (4,)])
@pytest.mark.parametrize("order", [0, 3])
def test_filters_equal_those_of_scipy(rows: int, columns: tuple[int, ...], order: int) -> None:
    """Series shorter than the filter included."""
    taps, series = TAPS[: order + 1], np.random.default_rng(rows).standard_normal((rows, *columns))
    np.testing.assert_allclose(moving_average(taps, series), lfilter(taps, [1.0], series, axis=0))
    np.testing.assert_allclose(recursive(taps, series), lfilter([1.0], taps, series, axis=0))


@pytest.mark.parametrize("block", [1, 2, 7, 100])
def test_a_recursion_continues_from_block_to_block(block: int) -> None:
    """Blocks give the series that one call gives."""
    series = np.random.default_rng(0).standard_normal((100, 2))
    last = np.zeros((3, 2))
    pieces = []
    for start in range(0, 100, block):
        pieces.append(recursive(TAPS, series[start : start + block], last))
        last = np.concatenate([last, pieces[-1]])[-3:]
    np.testing.assert_allclose(np.concatenate(pieces), recursive(TAPS, series), atol=1e-12)


def test_a_recursion_inverts_the_moving_average() -> None:
    """A whitening filter and the noise process that it whitens."""
    series = np.random.default_rng(1).standard_normal(50)
    np.testing.assert_allclose(recursive(TAPS, moving_average(TAPS, series)), series)
