"""Noise model: white noise is unchanged, colour is whitened, heavy tails are weighted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from identification.fit.autoregression import LARGEST_ORDER, autoregression, lag_products
from identification.fit.declared import fit_declared
from identification.fit.effective_samples import effective_fraction
from identification.fit.noise import with_noise_model
from identification.fit.solve import Fit
from identification.ingest.run import Run
from identification.model.excitation import records_of
from tests.motors import campaign, motor_named, noiseless

Array = NDArray[np.float64]

SERVO = motor_named("servo 100 W")


def coloured(seed: int, size: Array, pole: float) -> list[Run]:
    """Runs with first-order autoregressive noise with innovations of `size`."""
    rng = np.random.default_rng(seed)
    made = []
    for run in noiseless(SERVO, seed=seed, rows=1000):
        noise = lfilter([1.0], [1.0, -pole], rng.standard_normal((run.rows, 2)), axis=0)
        current, speed = run.current + size[0] * noise[:, 0], run.speed + size[1] * noise[:, 1]
        made.append(replace(run, current=current, speed=speed))
    return made


def spiky(seed: int, size: Array, freedom: float) -> list[Run]:
    """Runs with Student-t noise of the given scale."""
    rng = np.random.default_rng(seed)
    return [
        replace(
            run,
            current=run.current + size[0] * rng.standard_t(freedom, run.rows),
            speed=run.speed + size[1] * rng.standard_t(freedom, run.rows),
        )
        for run in noiseless(SERVO, seed=seed, rows=1000)
    ]


def deviations(fit: Fit, share: float = 1.0) -> Array:
    """(7,) error of the search coordinates in standard deviations of the fit."""
    sd = np.sqrt(np.diag(fit.equations.covariance(share)))
    return np.asarray((fit.position - fit.coordinates.of(SERVO.vector)) / sd)


def test_white_noise_keeps_the_fit() -> None:
    """White normal noise needs no other noise model, so the same object is returned."""
    fit = fit_declared(records_of(campaign(SERVO, seed=1)), "zoh")

    assert with_noise_model(fit) is fit
    assert effective_fraction(fit) == pytest.approx(1.0, abs=0.1)


def test_coloured_noise_is_whitened_by_the_filter_that_made_it() -> None:
    """Noise with a pole at 0.9 is whitened by the filter 1 - 0.9 z^-1."""
    fit = fit_declared(records_of(coloured(2, np.array([0.05, 0.5]), 0.9)), "zoh")

    changed = with_noise_model(fit)

    for taps in changed.weighting.whitening:
        assert taps[0] == 1.0
        assert taps[1] == pytest.approx(-0.9, abs=0.06)
    np.testing.assert_allclose(changed.weighting.deviation, [0.05, 0.5], rtol=0.08)


@pytest.mark.parametrize("pole", [0.5, 0.97])
def test_under_coloured_noise_the_covariance_is_consistent(pole: float) -> None:
    """The mean square deviate is about 1 with the noise model; without it (control) above 2."""
    before, after = [], []
    for seed in range(4):
        fit = fit_declared(records_of(coloured(12 + seed, np.array([0.05, 0.5]), pole)), "zoh")
        modelled = with_noise_model(fit)
        before.append(np.mean(deviations(fit) ** 2))
        after.append(np.mean(deviations(modelled, effective_fraction(modelled)) ** 2))

    # 28 squares of mean 1 have a mean of 1 within 0.27.
    assert 0.3 < np.mean(after) < 1.8
    assert np.mean(before) > 2.0


def test_correlated_residuals_count_for_fewer_samples() -> None:
    """A pole at 0.9 multiplies the variance of slow directions by (1 + 0.9) / (1 - 0.9) = 19."""
    fit = fit_declared(records_of(coloured(2, np.array([0.05, 0.5]), 0.9)), "zoh")

    share = effective_fraction(fit)

    assert 1.0 / 19.0 < share < 0.3
    assert np.abs(deviations(fit, share)).max() < 4.0


def test_heavy_tails_are_weighted_and_not_cut() -> None:
    """Weights reduce every variance, and no sample has weight zero."""
    fit = fit_declared(records_of(spiky(3, np.array([0.1, 1.5]), 3.0)), "zoh")

    changed = with_noise_model(fit)

    assert changed.weighting.robust is not None
    assert all(np.all(weight > 0.0) for weight in changed.weighting.robust)
    assert np.all(changed.equations.covariance().diagonal() < fit.equations.covariance().diagonal())
    assert np.abs(deviations(changed)).max() < 4.0


@pytest.mark.parametrize("freedom", [3.0, 6.0])
def test_heavy_tails_reduce_the_information_of_the_weights(freedom: float) -> None:
    """A Student-t distribution has (f + 1) / (f + 3) of the information of its weights."""
    shares, squares = [], []
    for seed in range(6):
        fit = fit_declared(records_of(spiky(20 + seed, np.array([0.1, 1.5]), freedom)), "zoh")
        changed = with_noise_model(fit)
        shares.append(effective_fraction(changed))
        squares.append(np.mean(deviations(changed, shares[-1]) ** 2))

    np.testing.assert_allclose(np.mean(shares), (freedom + 1) / (freedom + 3), rtol=0.06)
    # 42 squares of mean 1 have a mean of 1 within 0.22.
    assert 0.45 < np.mean(squares) < 1.6


@pytest.mark.parametrize(("pole", "rows"), [(0.8, 200), (0.95, 800)])
def test_the_colour_of_short_records_is_accepted(pole: float, rows: int) -> None:
    """With 60 independent samples in three runs, an ordinary fit absorbs part of slow noise."""
    accepted = 0
    for seed in range(8):
        runs = []
        rng = np.random.default_rng(seed)
        for run in noiseless(SERVO, seed=seed, rows=rows):
            white = rng.standard_normal((run.rows + 200, 2))
            noise = lfilter([1.0], [1.0, -pole], white, axis=0)[200:]
            current, speed = run.current + 0.05 * noise[:, 0], run.speed + 0.5 * noise[:, 1]
            runs.append(replace(run, current=current, speed=speed))
        changed = with_noise_model(fit_declared(records_of(runs), "zoh"))
        accepted += changed.weighting.whitening[0].size > 1

    assert accepted >= 7


def test_one_spike_does_not_move_a_robust_fit() -> None:
    """One outlier of 1000 sd in heavy-tailed noise leaves the error below 4 sd."""
    runs = spiky(4, np.array([0.1, 1.5]), 3.0)
    speed = runs[0].speed.copy()
    speed[500] += 1500.0
    spoiled = [replace(runs[0], speed=speed), *runs[1:]]

    changed = with_noise_model(fit_declared(records_of(spoiled), "zoh"))

    assert np.abs(deviations(changed)).max() < 4.0


def test_clipped_samples_do_not_bias_the_fit() -> None:
    """With the mask, the true values are found; without it (negative control), they are missed."""
    runs = campaign(SERVO, seed=5, noise=0.01)
    limit = 0.7 * float(np.max([np.abs(run.current).max() for run in runs]))
    cut, masked = [], []
    for run in runs:
        over = np.abs(run.current) >= limit
        clipped = replace(run, current=np.clip(run.current, -limit, limit))
        cut.append(clipped)
        masked.append(replace(clipped, clipped={"current_A": over}))

    with_mask = fit_declared(records_of(masked), "zoh")
    without = fit_declared(records_of(cut), "zoh")

    assert np.abs(deviations(with_mask)).max() < 4.0
    assert np.abs(deviations(without)).max() > 10.0


@pytest.mark.parametrize("taps", [[], [0.8], [1.2, -0.5]])
def test_the_order_and_taps_of_an_autoregression_are_found(taps: list[float]) -> None:
    """20,000 samples of a known process determine the taps to 1 %; no tap is added."""
    rng = np.random.default_rng(6)
    noise = rng.standard_normal((2, 10_000))
    series = lfilter([1.0], np.concatenate([[1.0], -np.array(taps)]), noise, axis=1)

    found = autoregression(list(series))

    np.testing.assert_allclose(found, np.concatenate([[1.0], -np.array(taps)]), atol=0.04)


def test_a_series_of_zeros_needs_no_filter() -> None:
    """Residuals of zero have no correlation."""
    np.testing.assert_array_equal(autoregression([np.zeros(500)]), [1.0])


def test_the_noise_that_a_regression_absorbs_is_given_back_to_its_colour() -> None:
    """Weighted least squares: E[e e'] = S - A (A' S^-1 A)^-1 A'; its addition gives S."""
    rng, pole, rows = np.random.default_rng(0), 0.9, 400
    slow = np.cos(np.pi * np.outer(np.arange(rows) + 0.5, np.arange(20)) / rows)
    white = lfilter([1.0, -pole], [1.0], slow, axis=0)
    covariance = np.linalg.inv(white.T @ white)
    absorbed = lag_products(slow @ np.linalg.cholesky(covariance), LARGEST_ORDER)
    plain, corrected = [], []
    for _ in range(40):
        noise = lfilter([1.0], [1.0, -pole], rng.standard_normal(rows))
        fitted = slow @ covariance @ white.T @ lfilter([1.0, -pole], [1.0], noise)
        plain.append(autoregression([noise - fitted])[1])
        corrected.append(autoregression([noise - fitted], absorbed=absorbed)[1])

    assert np.mean(plain) > -0.83
    assert np.mean(corrected) == pytest.approx(-pole, abs=0.015)


def test_the_filter_of_a_fit_is_slower_than_its_residuals() -> None:
    """The fit absorbs slow noise, so the noise is slower than what the fit leaves of it."""
    fit = with_noise_model(fit_declared(records_of(coloured(3, np.array([0.1, 1.5]), 0.95)), "zoh"))

    for channel in range(2):
        left = autoregression([residual[:, channel] for residual in fit.residuals()])
        assert -1.0 < fit.weighting.whitening[channel][1] < left[1] < -0.9
