"""Samples that are taken at other times than logged are found, and widen the intervals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.fit.declared import fit_declared
from identification.fit.solve import Fit
from identification.ingest.run import Run
from identification.model.excitation import records_of
from identification.selection.omitted import consider_variances
from identification.selection.sample_times import sample_time_errors, time_deviations
from tests.motors import campaign, motor_named, noiseless

SERVO = motor_named("servo 100 W")
SEEDS = range(4)


def sampled(seed: int, early: float, *, correlated: bool = False) -> list[Run]:
    """Runs whose samples are taken up to `early` intervals before or after their logged times.

    The samples between are those of a straight line, as the time errors are below an interval.  If
    the errors are `correlated`, they last for 20 samples.
    """
    rng = np.random.default_rng(seed)
    made = []
    for run in noiseless(SERVO, seed=seed, rows=1000):
        errors = rng.uniform(-early, early, run.rows)
        late = np.repeat(errors[::20], 20)[: run.rows] if correlated else errors
        at = run.time + late * np.median(np.diff(run.time))
        noise = rng.standard_normal((run.rows, 2)) * [0.1, 0.3]
        current = np.interp(at, run.time, run.current) + noise[:, 0]
        speed = np.interp(at, run.time, run.speed) + noise[:, 1]
        made.append(replace(run, current=current, speed=speed))
    return made


def fitted(runs: list[Run]) -> Fit:
    """Fit of the nominal model."""
    return fit_declared(records_of(runs), "zoh")


def squares(fit: Fit, added: NDArray[np.float64]) -> NDArray[np.float64]:
    """(7,) squares of the errors of the search coordinates in standard deviations."""
    variance = np.diag(fit.equations.covariance()) + added
    return np.asarray((fit.position - fit.coordinates.of(SERVO.vector)) ** 2 / variance)


@pytest.mark.parametrize("seed", SEEDS)
def test_noise_alone_shows_no_time_errors(seed: int) -> None:
    """The measured campaign has samples at the logged times."""
    fit = fitted(campaign(SERVO, seed=seed))

    assert not time_deviations(fit, 1.0).any()
    assert sample_time_errors(fit, 1.0) == ()


@pytest.mark.parametrize("seed", SEEDS)
def test_the_deviation_of_the_sample_times_is_found(seed: int) -> None:
    """A uniform error of up to 0.4 intervals has a standard deviation of 0.4 / sqrt(3)."""
    runs = sampled(seed, 0.4)
    interval = float(np.median(np.diff(runs[0].time)))
    found = time_deviations(fitted(runs), 1.0) / interval

    np.testing.assert_allclose(found, 0.4 / np.sqrt(3.0), rtol=0.15)


def test_uncertain_sample_times_widen_the_interval_of_the_inductance() -> None:
    """Late samples after a step show its response, so that the mean response leads."""
    plain, ours = [], []
    for seed in SEEDS:
        fit = fitted(sampled(seed, 0.4))
        added = consider_variances(fit, sample_time_errors(fit, 1.0))
        plain.append(squares(fit, np.zeros(7)))
        ours.append(squares(fit, added))

    assert np.mean(plain, axis=0)[-1] > 16.0
    assert np.mean(ours, axis=0)[-1] < 4.0


@pytest.mark.parametrize("seed", range(6))
def test_noise_with_spikes_shows_no_time_errors(seed: int) -> None:
    """Single large residuals raise the likelihood of any law of the variance by chance."""
    rng = np.random.default_rng(seed)
    runs = []
    for run in noiseless(SERVO, seed=seed, rows=1000):
        spikes = np.where(rng.random((run.rows, 2)) < 0.01, 30.0, 1.0)
        noise = rng.standard_normal((run.rows, 2)) * spikes * [0.1, 0.3]
        runs.append(replace(run, current=run.current + noise[:, 0], speed=run.speed + noise[:, 1]))

    assert not time_deviations(fitted(runs), 1.0).any()


def test_errors_that_last_are_no_errors_of_the_sample_times() -> None:
    """A law that the model lacks leaves a residual that is correlated from sample to sample."""
    assert not time_deviations(fitted(sampled(1, 0.4, correlated=True)), 1.0).any()
