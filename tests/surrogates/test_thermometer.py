"""Thermometer that shows another temperature than that of the motor, by a constant in each run."""

from __future__ import annotations

import numpy as np
import pytest

from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.ingest.run import Run
from identification.selection.outcome import Outcome
from identification.selection.search import search
from identification.surrogates.entry import term_of
from identification.surrogates.thermometer import ThermometerError
from tests.motors import drive, motor_named, simulated

SERVO = motor_named("servo 100 W")
ROWS = 1000
LOGGED = (25.0, 60.0, 90.0, 45.0, 75.0, 30.0)


def outcome_of(errors: tuple[float, ...]) -> Outcome:
    """Outcome of the search on five runs and a validation run of a motor that is warmer by these.

    Winding and magnet have one temperature.
    """
    rng = np.random.default_rng(3)
    time = SERVO.interval * np.arange(ROWS, dtype=np.float64)
    runs = []
    for number, (logged, error) in enumerate(zip(LOGGED, errors, strict=True)):
        voltage, warm = drive(SERVO, "steps", ROWS, rng), np.full(ROWS, logged + error)
        exact = simulated(SERVO.vector, SERVO.interval, voltage, warm, np.zeros(2), magnet=warm)
        current, speed = (exact + [0.05, 0.3] * rng.standard_normal(exact.shape)).T
        shown = np.round(logged + 0.1 * rng.standard_normal(ROWS), 1)
        runs.append(Run(f"run{number}.csv", "0" * 64, time, voltage, current, speed, shown))
    campaign = campaign_of(runs[:5], runs[5:])
    return search(fit_declared(campaign.training, "zoh"), campaign)


@pytest.mark.parametrize(
    "errors", [(3.0, -8.0, 5.0, -2.0, 4.0, -6.0), (0.0, 6.0, 10.0, 14.0, 18.0, 20.0)]
)
def test_errors_of_the_thermometer_are_named_and_widen_the_coefficients(
    errors: tuple[float, ...],
) -> None:
    """Known: the motor.  Runs that are hotter than logged, one after the other, are no heating."""
    outcome = outcome_of(errors)

    (term,) = outcome.fit.simulator.model.terms
    assert isinstance(term, ThermometerError)
    deviation = np.sqrt(np.diag(outcome.fit.equations.covariance()))
    position = outcome.fit.coordinates.of(SERVO.vector)
    assert np.all(np.abs(outcome.fit.position - position) < 3.0 * deviation)
    at = outcome.fit.coordinates.names.index("alpha_Ra")
    assert outcome.fit.deviations[at] > 0.05 * SERVO.values[at]


def test_a_thermometer_without_error_has_none() -> None:
    """The same bench has no effect."""
    assert outcome_of((0.0,) * 6).effects == ()


def test_an_error_of_the_thermometer_comes_back_from_a_result() -> None:
    """Its settings restore it, as for each unlisted term."""
    settings = {"size": 4.0, "own": True}

    entry = {"name": "unlisted", "equation": "thermal", "settings": settings}
    assert term_of(entry) == ThermometerError(4.0)
