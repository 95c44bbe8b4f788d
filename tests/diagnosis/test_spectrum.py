"""The spectrum of a residual from a short autoregression."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from identification.diagnosis.spectrum import akaike_filter, spectrum


@pytest.mark.parametrize("pole", [-0.5, 0.0, 0.6, 0.95])
def test_the_spectrum_at_zero_follows_the_closed_form(pole: float) -> None:
    """The closed form of the sum of all correlations of a first order is (1 + a) / (1 - a)."""
    rng = np.random.default_rng(21)
    residual = signal.lfilter([1.0], [1.0, -pole], rng.standard_normal(60_000))

    found = spectrum(akaike_filter(residual), 4096)[0]

    assert found == pytest.approx((1 + pole) / (1 - pole), rel=0.12)


def test_coefficients_of_a_second_order_autoregression_are_recovered() -> None:
    """Standard error of a coefficient is about 1/sqrt(n) = 0.005."""
    rng = np.random.default_rng(22)
    residual = signal.lfilter([1.0], [1.0, -1.2, 0.5], rng.standard_normal(40_000))

    found = akaike_filter(residual)

    assert found[:3] == pytest.approx([1.0, -1.2, 0.5], abs=0.03)
    assert found[3:] == pytest.approx(np.zeros(found.size - 3), abs=0.03)


def test_white_noise_gets_order_zero_most_of_the_time() -> None:
    """Akaike's criterion adds a needless order in about 29 % of cases without limit of order."""
    rng = np.random.default_rng(23)

    orders = [akaike_filter(rng.standard_normal(1000)).size - 1 for _ in range(200)]

    assert np.mean(np.array(orders) == 0) > 0.6


def test_a_spectrum_has_mean_one_and_its_peak_where_the_pole_is() -> None:
    """A positive pole is slow: all its power lies at frequency zero."""
    power = spectrum(np.array([1.0, -0.9]), 512)

    assert power.mean() == pytest.approx(1.0)
    assert power[0] == power.max()


def test_a_residual_of_zero_is_white() -> None:
    """There is nothing to predict."""
    assert akaike_filter(np.zeros(100)).tolist() == [1.0]
