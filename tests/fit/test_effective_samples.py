"""Effective samples: independent errors count fully, errors of a model count for less."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.fit.declared import fit_declared
from identification.fit.effective_samples import effective_fraction, scattered_fraction
from identification.fit.solve import Fit
from identification.ingest.run import Run
from identification.model.excitation import records_of
from tests.motors import campaign, motor_named, noiseless

Array = NDArray[np.float64]

SERVO = motor_named("servo 100 W")


def noisier_at_high_current(seed: int) -> list[Run]:
    """Runs with independent errors that are proportional to the current."""
    rng = np.random.default_rng(seed)
    made = []
    for run in noiseless(SERVO, seed=seed, rows=1000):
        size = np.abs(run.current) / np.sqrt(np.mean(run.current**2))
        noise = size[:, None] * rng.standard_normal((run.rows, 2)) * [0.1, 1.0]
        current, speed = run.current + noise[:, 0], run.speed + noise[:, 1]
        made.append(replace(run, current=current, speed=speed))
    return made


def squares(fit: Fit, share: float) -> Array:
    """(7,) squares of the errors of the search coordinates in standard deviations."""
    variance = np.diag(fit.equations.covariance(share))
    return np.asarray((fit.position - fit.coordinates.of(SERVO.vector)) ** 2 / variance)


def test_independent_errors_count_fully() -> None:
    """The scatter itself is uncertain: by a tenth with ten stretches for each of 7 parameters."""
    shares = []
    for seed in range(8):
        fit = fit_declared(records_of(campaign(SERVO, seed=seed)), "zoh")
        shares.append(scattered_fraction(fit))

    assert min(shares) > 0.7
    assert np.mean(shares) > 0.9


def test_errors_that_are_largest_where_the_parameters_act_count_for_less() -> None:
    """They are independent, so their autocorrelation shows nothing."""
    plain, ours = [], []
    for seed in range(8):
        fit = fit_declared(records_of(noisier_at_high_current(30 + seed)), "zoh")
        share = scattered_fraction(fit)
        plain.append(np.mean(squares(fit, effective_fraction(fit))))
        ours.append(np.mean(squares(fit, share)))

        assert share < 0.85

    # The errors of one seed are correlated: 8 to 56 squares of mean 1 have a mean within 0.5.
    assert np.mean(plain) > 1.8
    assert 0.5 < np.mean(ours) < 1.5


def test_a_record_with_fewer_samples_than_parameters_counts_fully() -> None:
    """Six stretches have no scatter in seven directions."""
    (run, *_) = campaign(SERVO, seed=1, runs=1, rows=6)

    assert scattered_fraction(fit_declared(records_of([run]), "zoh")) == pytest.approx(1.0)
