"""Correlations of residuals: false alarm rates at the nominal level, and detection."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal, stats

from identification.diagnosis.residual import autocorrelation, cross_correlation, whiteness

Array = NDArray[np.float64]


def coloured(rng: np.random.Generator, pole: float, size: int) -> Array:
    """A stationary first-order autoregression (size,) with the given pole."""
    warm_up = 400
    noise = rng.standard_normal(size + warm_up)
    return np.asarray(signal.lfilter([1.0], [1.0, -pole], noise)[warm_up:], dtype=np.float64)


def test_one_lag_in_a_hundred_of_white_noise_leaves_the_band() -> None:
    """Binomial: 400 runs of 60 lags at 1 %, within five standard deviations."""
    rng = np.random.default_rng(1)

    found = [autocorrelation([rng.standard_normal(600)]).outside for _ in range(400)]

    spread = np.sqrt(0.01 * 0.99 / (400 * 60))
    assert abs(np.mean(found) - 0.01) < 5 * spread


@pytest.mark.parametrize("pole", [0.0, 0.9])
@pytest.mark.parametrize("input_pole", [0.0, 0.95])
def test_an_unrelated_input_leaves_the_band_one_time_in_a_hundred(
    pole: float, input_pole: float
) -> None:
    """The band has level 1 %; the lags are correlated, so a factor of two is allowed."""
    rng = np.random.default_rng(2)

    outside = [
        cross_correlation(
            [coloured(rng, pole, 2000)], [np.sign(coloured(rng, input_pole, 2000))]
        ).outside
        for _ in range(200)
    ]

    assert 0.005 < np.mean(outside) < 0.02


def test_the_plain_band_gives_false_alarms_on_coloured_noise() -> None:
    """Negative control: coloured noise exceeds 2.58/sqrt(n) far more often than 1 % of the time."""
    rng = np.random.default_rng(3)
    size = 2000

    crossed = [
        np.mean(
            np.abs(
                cross_correlation([coloured(rng, 0.9, size)], [coloured(rng, 0.95, size)]).values
            )
            > 2.576 / np.sqrt(size)
        )
        for _ in range(60)
    ]

    assert np.mean(crossed) > 0.10


def test_p_values_of_white_noise_are_uniform() -> None:
    """Kolmogorov-Smirnov test against the uniform distribution, with a fixed seed."""
    rng = np.random.default_rng(4)

    values = [whiteness([rng.standard_normal(400)]) for _ in range(800)]

    assert stats.kstest(values, "uniform").pvalue > 0.01


def test_p_values_of_runs_with_different_noise_and_length_are_uniform() -> None:
    """The same test for three pooled runs, of which one has five times the noise."""
    rng = np.random.default_rng(5)

    values = [
        whiteness(
            [scale * rng.standard_normal(size) for scale, size in ((1, 300), (5, 500), (1, 90))]
        )
        for _ in range(800)
    ]

    assert stats.kstest(values, "uniform").pvalue > 0.01


def test_slightly_coloured_noise_is_found() -> None:
    """Over 2000 samples, a pole of 0.2 raises the first lag by nine standard deviations."""
    rng = np.random.default_rng(6)

    residual = coloured(rng, 0.2, 2000)

    assert whiteness([residual]) < 1e-6
    assert autocorrelation([residual]).values[0] == pytest.approx(0.2, abs=0.07)


def test_a_residual_that_is_an_offset_is_not_white() -> None:
    """Noise of variance 1 with mean 0.3 has the correlation 0.09 / 1.09 at every lag."""
    rng = np.random.default_rng(7)

    found = autocorrelation([0.3 + rng.standard_normal(20_000)])

    assert found.values == pytest.approx(np.full(60, 0.09 / 1.09), abs=0.03)
    assert found.outside == 1.0


def test_pooled_runs_detect_a_correlation_that_one_run_does_not() -> None:
    """A pole of 0.04 is insignificant in one run of 1000 samples and 9 sd in 50 runs."""
    rng = np.random.default_rng(8)
    runs = [coloured(rng, 0.04, 1000) for _ in range(50)]

    assert whiteness(runs) < 1e-4
    assert np.median([whiteness([run]) for run in runs]) > 0.05


def test_runs_are_not_concatenated() -> None:
    """Two runs, each with a pulse at the seam, share no product; concatenated, they would."""
    first, second = np.zeros(100), np.zeros(100)
    first[-1] = second[0] = 1.0

    apart = autocorrelation([first, second], max_lag=3)
    glued = autocorrelation([np.concatenate([first, second])], max_lag=3)

    assert list(apart.values) == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    assert glued.values[0] == pytest.approx(0.5)


def test_fast_correlations_equal_their_definition() -> None:
    """Reference: the definition, summed in a loop over samples."""
    rng = np.random.default_rng(9)
    residual, voltage = rng.standard_normal(57), rng.standard_normal(57)
    centred = voltage - voltage.mean()
    scale = np.sqrt(np.sum(residual**2) * np.sum(centred**2))

    found = cross_correlation([residual], [voltage], max_lag=5)

    for lag, value in zip(found.lags, found.values, strict=True):
        expected = sum(residual[t] * centred[t - lag] for t in range(57) if 0 <= t - lag < 57)
        assert value == pytest.approx(expected / scale, abs=1e-12)


def test_a_delayed_response_is_correlated_at_a_positive_lag() -> None:
    """The residual repeats the input seven samples later."""
    rng = np.random.default_rng(10)
    voltage = rng.standard_normal(3000)
    residual = np.roll(voltage, 7) + rng.standard_normal(3000)

    found = cross_correlation([residual], [voltage])

    assert found.lags[np.argmax(np.abs(found.values))] == 7


def test_a_residual_of_zero_is_white() -> None:
    """A residual of zero has zero correlation and causes no division by zero."""
    assert whiteness([np.zeros(100)]) == 1.0
    assert autocorrelation([np.zeros(100)]).outside == 0.0


def test_a_short_run_contributes_to_its_own_lags_only() -> None:
    """Lags beyond the length of the short run use the long run only."""
    rng = np.random.default_rng(11)

    found = autocorrelation([rng.standard_normal(5), rng.standard_normal(400)], max_lag=40)

    assert np.all(np.isfinite(found.values))
    assert found.half_width[-1] < found.half_width[0]


@pytest.mark.parametrize("residual", [np.array([1.0, np.nan, 2.0]), np.zeros((3, 2)), np.zeros(1)])
def test_invalid_series_are_refused(residual: Array) -> None:
    """A NaN would turn every correlation into NaN without an error."""
    with pytest.raises(ValueError, match="expected at least two finite samples"):
        autocorrelation([residual])


def test_signals_that_do_not_belong_to_the_runs_are_refused() -> None:
    """A voltage of another length cannot belong to the run."""
    with pytest.raises(ValueError, match="expected the same number in each run"):
        cross_correlation([np.ones(10)], [np.ones(9)])
