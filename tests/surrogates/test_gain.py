"""Runs in which a channel has another gain than in the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.effects.effect import effects_of
from identification.ingest import Run
from identification.model.term import Channel
from identification.result.run_values import run_values
from identification.surrogates.entry import term_of
from identification.surrogates.gain import (
    SensorGain,
    SensorGainOfRuns,
    VoltageGain,
    VoltageGainOfRuns,
)
from tests.effects.hidden import all_but
from tests.motors import drive, motor_named, run_of
from tests.surrogates.searched import outcome_of

MOTOR = motor_named("servo 100 W")
ROWS, NOISE = 800, 0.003
TEMPERATURES = (25.0, 60.0, 25.0, 45.0)

WITHHELD = all_but(
    "inertia_change",
    "self_heating",
    "flux_saturation",
    "current_offset",
    "speed_offset",
    "load_torque",
)


def measured() -> list[Run]:
    """Four runs of the nominal motor with noise, the last one for validation."""
    rng = np.random.default_rng(11)
    runs = []
    for degrees in TEMPERATURES:
        voltage = drive(MOTOR, "steps", ROWS, rng)
        run = run_of(MOTOR, voltage, np.full(ROWS, degrees), np.zeros(2))
        noise = NOISE * rng.standard_normal((2, ROWS))
        current = run.current + noise[0] * run.current.std()
        runs.append(replace(run, current=current, speed=run.speed + noise[1] * run.speed.std()))
    return runs


@pytest.mark.parametrize(
    ("channel", "change"), [("current", -0.05), ("current", 0.02), ("speed", 0.03)]
)
def test_another_gain_of_a_sensor_in_one_run_is_named(channel: Channel, change: float) -> None:
    """The second run is logged with another gain; the parameters are those of the motor."""
    runs = measured()
    logged = {channel: (1.0 + change) * getattr(runs[1], channel)}
    runs[1] = replace(runs[1], **logged)

    outcome = outcome_of(runs, WITHHELD)

    (term,) = outcome.fit.simulator.model.terms
    assert term == SensorGain(1, channel)
    deviations = np.sqrt(np.diag(outcome.fit.equations.covariance()))
    position = outcome.fit.coordinates.of(np.append(MOTOR.vector, change))
    assert np.all(np.abs(outcome.fit.position - position) < 4.0 * deviations)


def test_another_supply_of_a_commanded_voltage_in_one_run_is_named() -> None:
    """In the third run, the motor has 4 % less voltage than the log."""
    runs = measured()
    runs[2] = replace(runs[2], voltage=runs[2].voltage / 0.96)

    outcome = outcome_of(runs, WITHHELD)

    (term,) = outcome.fit.simulator.model.terms
    assert term == VoltageGain(2)
    assert outcome.fit.by_name["unlisted.change"] == pytest.approx(-0.04, abs=0.002)


def test_another_battery_in_each_run_is_a_gain_of_each_run() -> None:
    """The log has the command; the motor has 1, 1.05, 0.97 and 1.02 times as much."""
    factors = (1.0, 1.05, 0.97, 1.02)
    runs = [
        replace(run, voltage=run.voltage / factor)
        for run, factor in zip(measured(), factors, strict=True)
    ]

    fit = outcome_of(runs, WITHHELD).fit

    (term,) = effects_of(fit.simulator.model.terms)
    assert isinstance(term, VoltageGainOfRuns)
    deviations = np.sqrt(np.diag(fit.equations.covariance()))
    assert np.all(np.abs(fit.position - fit.coordinates.of(MOTOR.vector)) < 4.0 * deviations)
    found = [entry["values"]["change"]["mean"] for entry in run_values(term, fit, 1.0)]
    assert found == pytest.approx([0.0, 0.05, -0.03], abs=1e-3)


@pytest.mark.parametrize("channel", ["current", "speed"])
def test_another_gain_of_a_sensor_in_each_run_is_named(channel: Channel) -> None:
    """The sensor was replaced before each run."""
    runs = [
        replace(run, **{channel: factor * getattr(run, channel)})
        for run, factor in zip(measured(), (1.0, 1.03, 0.97, 0.99), strict=True)
    ]

    fit = outcome_of(runs, WITHHELD).fit

    (term,) = effects_of(fit.simulator.model.terms)
    assert isinstance(term, SensorGainOfRuns)
    assert term.channel == channel
    found = [entry["values"]["change"]["mean"] for entry in run_values(term, fit, 1.0)]
    assert found == pytest.approx([0.0, 0.03, -0.03], abs=1e-3)


def test_equal_gains_in_all_runs_are_no_effect() -> None:
    """The nominal motor has no other effect either."""
    assert outcome_of(measured()).effects == ()


def test_a_gain_comes_back_from_a_result() -> None:
    """The settings of a sensor's gain have its channel; a voltage has an equation of its own."""
    runs = {"run": 1, "others": [2]}
    sensor = {"equation": "sensor", "settings": {**runs, "channel": "speed"}}
    voltage = {"equation": "electrical", "settings": runs}

    assert term_of({"name": "unlisted", **sensor}) == SensorGain(1, "speed", others=(2,))
    assert term_of({"name": "unlisted", **voltage}) == VoltageGain(1, others=(2,))
    each = {"gain_size": 0.03, "first": 0}
    sensor = {"equation": "sensor", "settings": {**each, "channel": "speed"}}
    voltage = {"equation": "electrical", "settings": each}
    assert term_of({"name": "unlisted", **sensor}) == SensorGainOfRuns(0.03, "speed", first=0)
    assert term_of({"name": "unlisted", **voltage}) == VoltageGainOfRuns(0.03, first=0)
