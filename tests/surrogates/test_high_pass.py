"""Sensors that do not transmit the mean of a signal."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from identification.effects.effect import effects_of
from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.ingest import Run
from identification.model.term import Channel
from identification.selection.search import search
from identification.surrogates.entry import term_of
from identification.surrogates.high_pass import SensorHighPass
from tests.motors import drive, motor_named, run_of

MOTOR = motor_named("servo 100 W")
ROWS, NOISE = 1500, 0.003


def coupled(rng: np.random.Generator, degrees: float, channel: Channel, lag: float) -> Run:
    """Run of the nominal motor with a sensor of time constant `lag` [s], exact for each interval.

    The sensor has adapted to 0.1 of the unit of the channel before the run.
    """
    voltage = drive(MOTOR, "steps", ROWS, rng)
    run = run_of(MOTOR, voltage, np.full(ROWS, degrees), np.zeros(2))
    ra, kt, inertia, friction, inductance = MOTOR.warm(degrees)
    rates = np.zeros((4, 4))
    rates[0] = -ra / inductance, -kt / inductance, 0.0, 1.0 / inductance
    rates[1] = kt / inertia, -friction / inertia, 0.0, 0.0
    rates[2, 2], rates[2, int(channel == "speed")] = -1.0 / lag, 1.0 / lag
    step = expm(MOTOR.interval * rates)
    state, states = np.array([0.0, 0.0, 0.1]), []
    for held in voltage:
        states.append(state)
        state = (step @ [*state, held])[:3]
    current, speed, lost = np.array(states).T
    noise = NOISE * rng.standard_normal((2, ROWS))
    logged = {"current": current, "speed": speed}
    scales = [signal.std() for signal in logged.values()]
    logged[channel] = logged[channel] - lost
    current, speed = (x + s * n for x, s, n in zip(logged.values(), scales, noise, strict=True))
    return replace(run, current=current, speed=speed)


@pytest.mark.parametrize("channel", ["current", "speed"])
def test_a_high_pass_filter_is_found_with_its_time_constant(channel: Channel) -> None:
    """The parameters are those of the motor, although no constant signal was logged."""
    rng = np.random.default_rng(5)
    lag = 0.3 * ROWS * MOTOR.interval
    runs = [coupled(rng, degrees, channel, lag) for degrees in (25.0, 60.0, 25.0, 45.0)]
    campaign = campaign_of(runs[:-1], runs[-1:])

    fit = search(fit_declared(campaign.training, "zoh"), campaign).fit

    (term,) = effects_of(fit.simulator.model.terms)
    assert isinstance(term, SensorHighPass)
    assert term.channel == channel
    deviations = np.sqrt(np.diag(fit.equations.covariance()))
    position = fit.coordinates.of(np.append(MOTOR.vector, lag))
    assert np.all(np.abs(fit.position - position) < 4.0 * deviations)


def test_a_high_pass_filter_comes_back_from_a_result() -> None:
    """Its settings are those of no other surrogate."""
    term = SensorHighPass("current", 10.0, 1e-3, 50.0)

    entry = {"name": "unlisted", "equation": "sensor", "settings": term.settings}
    assert term_of(entry) == term
