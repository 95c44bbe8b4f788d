"""Filters of samples: moving averages and recursive filters of firmware, drives and loggers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from identification.effects.average import CurrentRecursion, SpeedAverage, SpeedSampleAverage
from identification.effects.effect import AbstractEffect
from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.ingest.run import Run
from identification.model.composite import MotorModel
from identification.model.excitation import records_of
from identification.model.simulate import Simulator
from identification.selection.outcome import Outcome
from identification.selection.search import search
from identification.surrogates.entry import term_of
from tests.effects.hidden import all_but
from tests.motors import driven, motor_named

WITHHELD = all_but(
    "current_filter",
    "speed_filter",
    "voltage_filter",
    "channel_delay",
    "input_hold",
    "inductance_saturation",
)
SERVO = motor_named("servo 100 W")
ROWS = 800
FAST = 0.2
"""Electrical time constant over the sample interval, which tells a digital filter of the current
from an analog one."""
VALUES = np.append(SERVO.vector[:-1], FAST * SERVO.interval * SERVO.vector[0])


def logged(seed: int, weights: tuple[np.ndarray, np.ndarray], channel: int) -> Run:
    """A run of the servo whose current (0) or speed (1) passes a filter b, a of its samples."""
    run = driven(SERVO, ROWS, seed, warming=2.0)
    simulator = Simulator.fitting(MotorModel(hold="zoh"), records_of([run]), VALUES)
    signals = simulator.logged(VALUES[:, None], [np.zeros(2)])[0][:, :, 0]
    rng = np.random.default_rng(seed)
    noise = 2e-3 * np.abs(signals).max(axis=0) * rng.standard_normal(signals.shape)
    signals[:, channel] = lfilter(*weights, signals[:, channel])
    current, speed = (signals + noise).T
    return replace(run, name=f"{seed}.csv", sha256=str(seed), current=current, speed=speed)


def outcome_of(weights: tuple[np.ndarray, np.ndarray], channel: int) -> Outcome:
    """Outcome of the search on two training runs and one validation run."""
    runs = [logged(seed, weights, channel) for seed in (1, 2, 3)]
    campaign = campaign_of(runs[:2], runs[2:])
    return search(fit_declared(campaign.training, "zoh"), campaign, withheld=WITHHELD)


def test_a_recursive_filter_of_the_current_is_told_from_an_analog_one() -> None:
    """Known: y_k = 0.8 y_(k-1) + 0.2 i_k, whose time constant is 4.48 intervals."""
    outcome = outcome_of((np.array([0.2]), np.array([1.0, -0.8])), 0)

    (term,) = outcome.fit.simulator.model.terms
    assert isinstance(term, CurrentRecursion)
    found = outcome.fit.by_name["current_filter.time_constant"]
    assert found / SERVO.interval == pytest.approx(-1.0 / np.log(0.8), rel=0.02)
    deviation = np.sqrt(np.diag(outcome.fit.equations.covariance()))[: VALUES.size]
    truth = outcome.fit.coordinates.of(np.append(VALUES, found))[: VALUES.size]
    assert np.all(np.abs(outcome.fit.position[: VALUES.size] - truth) < 4.0 * deviation)


def test_an_average_of_samples_is_told_from_an_analog_filter() -> None:
    """Known: the mean of eight samples, without another effect beside it."""
    outcome = outcome_of((np.full(8, 1 / 8), np.array([1.0])), 1)

    (term,) = outcome.fit.simulator.model.terms
    assert isinstance(term, SpeedSampleAverage)
    lag = outcome.fit.by_name["speed_filter.time_constant"] / SERVO.interval
    assert 1.0 + 2.0 * lag == pytest.approx(8.0, abs=0.1)


@pytest.mark.parametrize(
    ("term", "settings"),
    [
        (SpeedAverage(1e-3), {"interval": 1e-3, "intervals": 32}),
        (SpeedSampleAverage(1e-3), {"interval": 1e-3, "memory": 31}),
        (CurrentRecursion(1e-3), {"interval": 1e-3}),
    ],
)
def test_a_filter_of_samples_comes_back_from_a_result(
    term: AbstractEffect, settings: dict[str, object]
) -> None:
    """Its settings tell it from the other laws of the effect."""
    entry = {"name": term.name, "equation": "sensor", "settings": settings}

    assert term_of(entry) == term
    assert term.settings == settings
