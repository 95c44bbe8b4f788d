"""Bodies whose temperature changes far more slowly than a run lasts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.effects.thermal import SelfHeating
from identification.fit.campaign import Campaign, campaign_of
from identification.fit.declared import fit_declared
from identification.ingest.run import Run
from identification.selection.candidates import scales_of
from identification.selection.refit import refitted_with
from identification.selection.search import search
from identification.selection.start import Along, Start
from identification.selection.trials import Trials
from tests.effects.hidden import all_but
from tests.motors import drive, motor_named, simulated

Array = NDArray[np.float64]

WITHHELD = all_but(
    "self_heating",
    "winding_lag",
    "magnet_lag",
    "resistance_curvature",
    "demagnetization",
    "viscous_temperature",
)
MOTOR = replace(motor_named("servo 100 W"), interval=2e-3)
ROWS = 2000
"""Rows of a run of 4 s."""
HOUSING = (25.0, 60.0, 90.0, 45.0)
RISES = (0.0, 10.0, 25.0, 4.0)
"""Temperature of the winding above the housing at the start of each run, after the last run [K]."""


def _following(driver: Array, start: float, time_constant: float) -> Array:
    """Temperature of a body that follows another one to first order, from its own start [degC]."""
    found = np.full(driver.size, start)
    for k in range(driver.size - 1):
        found[k + 1] = found[k] + (driver[k] - found[k]) * MOTOR.interval / time_constant
    return found


def _read(body: str, voltage: Array, winding: Array, housing: float) -> Array:
    """Current and speed at a temperature of the winding [A, rad/s]."""
    magnet = winding if body == "winding" else _following(winding, housing, 150.0)
    interval, rest = MOTOR.interval, np.zeros(2)
    return simulated(MOTOR.vector, interval, voltage, winding, rest, magnet=magnet)


def _campaign(body: str, rises: tuple[float, ...] = RISES) -> Campaign:
    """Three training runs and a validation run, recorded one after the other.

    Args:
        body: ``winding`` if the thermometer is on the housing and the winding cools to it within
            40 s; ``magnet`` if it is in the winding and the magnet follows within 150 s.
        rises: Temperature of the winding above the housing at the start of each run [K].
    """
    rng = np.random.default_rng(3)
    time = MOTOR.interval * np.arange(ROWS, dtype=np.float64)
    runs = []
    for k, (housing, rise) in enumerate(zip(HOUSING, rises, strict=True)):
        voltage = drive(MOTOR, "steps", ROWS, rng)
        still, winding = np.full(ROWS, housing), np.full(ROWS, housing + rise)
        for _ in range(4):
            heat = MOTOR.values[0] * _read(body, voltage, winding, housing)[:, 0] ** 2
            heat = heat * (1 + MOTOR.values[1] * (winding - 25.0))
            winding = _following(still + 1.5 * heat, housing + rise, 40.0)
        exact = _read(body, voltage, winding, housing)
        noisy = exact + 0.002 * exact.std(axis=0) * rng.standard_normal(exact.shape)
        shown = still if body == "winding" else winding
        logged = np.round(shown + 0.1 * rng.standard_normal(ROWS), 1)
        current, speed = noisy.T
        runs.append(Run(f"{k}.csv", f"{k:064d}", time, voltage, current, speed, logged))
    return campaign_of(runs[:3], runs[3:])


@pytest.mark.parametrize(
    ("body", "effect", "coefficient"),
    [("winding", "self_heating", "alpha_Ra"), ("magnet", "magnet_lag", "alpha_Kt")],
)
def test_a_body_that_a_run_hardly_cools_does_not_bias_the_temperature_coefficient(
    body: str, effect: str, coefficient: str
) -> None:
    """Its excess follows from its rate and its time constant, which may exceed five runs."""
    split = _campaign(body)

    fit = search(fit_declared(split.training, "zoh"), split, withheld=WITHHELD).fit

    assert effect in [term.name for term in fit.simulator.model.terms]
    at = fit.coordinates.names.index(coefficient)
    error = fit.by_name[coefficient] - MOTOR.values[at]
    assert abs(error) < 3.0 * fit.deviations[at]
    assert fit.deviations[at] < 0.5 * abs(MOTOR.values[at])


def test_losses_do_not_heat_a_winding_that_starts_colder_than_logged() -> None:
    """The housing was heated from outside, and the winding warms up to it."""
    rises = (-40.0, -10.0, -30.0, -20.0)
    split = _campaign("winding", rises)
    trials = Trials(split)
    nominal = trials.evaluate(fit_declared(split.training, "zoh"))
    [candidate] = SelfHeating.candidates(scales_of(nominal.fit))
    assert isinstance(candidate.final, SelfHeating)
    heated = replace(candidate.final, warms_magnet=True)
    states = tuple(np.array([rise]) for rise in rises[:3])
    motor = Along.to(nominal.fit, MOTOR.vector)
    true = Start(np.array([1.5, 40.0, 1.0]), states, motor, is_moved=True)

    model = trials.evaluate(refitted_with(nominal.fit, heated, [true]))

    criteria = trials.criteria(model, nominal)
    assert criteria.gain > 1000.0
    assert "starts most runs colder than logged" in criteria.flaw
    assert not criteria.passed


def test_a_single_run_that_starts_colder_than_logged_does_not_refuse_heating_by_losses() -> None:
    """The housing was warmed from outside before the first run only."""
    split = _campaign("winding", (-30.0, 10.0, 25.0, 4.0))

    fit = search(fit_declared(split.training, "zoh"), split, withheld=WITHHELD).fit

    assert [term.name for term in fit.simulator.model.terms] == ["self_heating"]
