"""A thermometer that lags the winding, and a winding that lags the thermometer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from identification.effects.search import search
from identification.fit.campaign import Campaign, campaign_of
from identification.fit.declared import fit_declared
from identification.ingest.run import Run
from tests.motors import drive, motor_named, simulated

Array = NDArray[np.float64]

MOTOR = replace(motor_named("servo 100 W"), interval=4e-3)
ROWS = 2000
LAG = 1.5
"""Time constant of the lag [s], in runs of 8 s."""


def _lagging(temperature: Array) -> Array:
    """Response of a first-order lag to a temperature, from equilibrium [degC]."""
    kept = np.exp(-MOTOR.interval / LAG)
    return np.asarray(lfilter([1 - kept], [1.0, -kept], temperature, zi=[kept * temperature[0]])[0])


def _campaign(direction: str) -> Campaign:
    """Runs that heat up and begin to heat harder on the way; the log has noise and steps of 0.1 K.

    Args:
        direction: What lags what.
    """
    rng = np.random.default_rng(4)
    time = MOTOR.interval * np.arange(ROWS, dtype=np.float64)
    runs = []
    for k in range(4):
        voltage = drive(MOTOR, "steps", ROWS, rng)
        rise = 30.0 * (1 - np.exp(-time / 3.0)) + 15.0 * (1 - np.exp(-np.fmax(time - 5.0, 0) / 2.0))
        driven = 25.0 + 15.0 * k + rise
        lagging = _lagging(driven)
        is_ahead = direction.startswith("the log lags")
        winding, shown = (driven, lagging) if is_ahead else (lagging, driven)
        magnet = winding if direction.endswith("magnet") else shown
        exact = simulated(
            MOTOR.vector, MOTOR.interval, voltage, winding, np.zeros(2), magnet=magnet
        )
        noisy = exact + 0.005 * exact.std(axis=0) * rng.standard_normal(exact.shape)
        logged = shown + 0.1 * rng.standard_normal(ROWS)
        current, speed = noisy.T
        runs.append(
            Run(f"{k}.csv", f"{k:064d}", time, voltage, current, speed, np.round(logged, 1))
        )
    return campaign_of(runs[:3], runs[3:])


@pytest.mark.parametrize(
    "direction",
    ["the winding lags the log", "the log lags the winding", "the log lags winding and magnet"],
)
def test_a_lag_is_found_in_its_direction(direction: str) -> None:
    """The closed form of the motor at the true temperatures; the lag is 1.5 s."""
    campaign = _campaign(direction)

    outcome = search(fit_declared(campaign.training, "zoh"), campaign)

    assert [found.name for found in outcome.effects] == ["winding_lag"]
    assert outcome.fit.values[-1] == pytest.approx(LAG, rel=0.1)
    (term,) = outcome.fit.simulator.model.terms
    assert term.variant == direction
    np.testing.assert_allclose(outcome.fit.values[:2], MOTOR.vector[:2], rtol=0.03)
