"""A residual that is larger where some parameters act widens their intervals, and no others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.fit.declared import fit_declared
from identification.fit.effective_samples import effective_fraction, scattered_fraction
from identification.fit.solve import Fit
from identification.ingest.run import Run
from identification.model.excitation import records_of
from identification.selection.omitted import consider_variances
from identification.selection.uneven import largest_by_chance, uneven_residual
from tests.motors import campaign, motor_named, noiseless

SERVO = motor_named("servo 100 W")
SEEDS = range(10)


def sampled_at_uncertain_times(seed: int) -> list[Run]:
    """Runs whose samples are 0.3 intervals (RMS) early or late, besides little sensor noise."""
    rng = np.random.default_rng(seed)
    made = []
    for run in noiseless(SERVO, seed=seed, rows=1000):
        late = 0.3 * rng.standard_normal(run.rows)
        noise = rng.standard_normal((run.rows, 2)) * [0.1, 0.3]
        current = run.current + late * np.gradient(run.current) + noise[:, 0]
        speed = run.speed + late * np.gradient(run.speed) + noise[:, 1]
        made.append(replace(run, current=current, speed=speed))
    return made


def fraction_of(fit: Fit) -> float:
    """Effective sample fraction of the intervals."""
    return min(effective_fraction(fit), scattered_fraction(fit))


def squares(fit: Fit, added: NDArray[np.float64]) -> NDArray[np.float64]:
    """(7,) squares of the errors of the search coordinates in standard deviations."""
    variance = np.diag(fit.equations.covariance(fraction_of(fit))) + added
    return np.asarray((fit.position - fit.coordinates.of(SERVO.vector)) ** 2 / variance)


def test_noise_that_is_the_same_everywhere_widens_nothing() -> None:
    """The scatter of ten stretches for each parameter is below the limit of chance."""
    for seed in SEEDS:
        fit = fit_declared(records_of(campaign(SERVO, seed=seed)), "zoh")

        assert uneven_residual(fit, fraction_of(fit)) == ()


def test_uncertain_sample_times_widen_the_interval_of_the_inductance() -> None:
    """Only the transients of the current determine it, and their error is the largest."""
    plain, ours = [], []
    for seed in SEEDS:
        fit = fit_declared(records_of(sampled_at_uncertain_times(100 + seed)), "zoh")
        added = consider_variances(fit, uneven_residual(fit, fraction_of(fit)))
        plain.append(squares(fit, np.zeros(7)))
        ours.append(squares(fit, added))

    # Ten squares of mean 1 have a mean below 2.6 in 996 of 1,000 cases.
    assert np.mean(plain, axis=0)[-1] > 5.0
    assert np.all(np.mean(ours, axis=0) < 2.6)


def test_the_limit_of_chance_is_that_of_wishart_matrices() -> None:
    """Of 2,000 random matrices about one in a thousand exceeds it."""
    rng = np.random.default_rng(4)
    n, freedom = 8, 80
    parts = rng.standard_normal((2000, freedom, n))
    largest = np.linalg.norm(parts, 2, axis=(1, 2)) ** 2 / freedom

    assert np.count_nonzero(largest > largest_by_chance(n, freedom)) <= 6
    assert np.count_nonzero(largest > 0.9 * largest_by_chance(n, freedom)) > 6
