"""Runs in which a channel has another gain than in the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.ingest import Run
from identification.selection.outcome import Outcome
from identification.selection.search import search
from identification.surrogates.entry import term_of
from identification.surrogates.gain import CurrentGain, VoltageGain
from tests.motors import drive, motor_named, run_of

MOTOR = motor_named("servo 100 W")
ROWS, NOISE = 1500, 0.003
TEMPERATURES = (25.0, 60.0, 25.0, 45.0)


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


def outcome_of(runs: list[Run]) -> Outcome:
    """Outcome of the search with the last run for validation."""
    campaign = campaign_of(runs[:-1], runs[-1:])
    return search(fit_declared(campaign.training, "zoh"), campaign)


@pytest.mark.parametrize("change", [-0.05, 0.02])
def test_another_gain_of_the_current_in_one_run_is_named(change: float) -> None:
    """The second run reads its current with a known gain; the parameters are those of the motor."""
    runs = measured()
    runs[1] = replace(runs[1], current=(1.0 + change) * runs[1].current)

    outcome = outcome_of(runs)

    (term,) = outcome.fit.simulator.model.terms
    assert term == CurrentGain(1)
    deviations = np.sqrt(np.diag(outcome.fit.equations.covariance()))
    position = outcome.fit.coordinates.of(np.append(MOTOR.vector, change))
    assert np.all(np.abs(outcome.fit.position - position) < 4.0 * deviations)


def test_another_supply_of_a_commanded_voltage_in_one_run_is_named() -> None:
    """In the third run, the motor has 4 % less voltage than the log."""
    runs = measured()
    runs[2] = replace(runs[2], voltage=runs[2].voltage / 0.96)

    outcome = outcome_of(runs)

    (term,) = outcome.fit.simulator.model.terms
    assert term == VoltageGain(2)
    assert outcome.fit.by_name["unlisted.change"] == pytest.approx(-0.04, abs=0.002)


def test_equal_gains_in_all_runs_are_no_effect() -> None:
    """The nominal motor has no other effect either."""
    assert outcome_of(measured()).effects == ()


def test_a_gain_comes_back_from_a_result() -> None:
    """Both gains have the same settings; the equation distinguishes them."""
    entry = {"name": "unlisted", "settings": {"run": 1, "others": [2]}}

    assert term_of({**entry, "equation": "sensor"}) == CurrentGain(1, others=(2,))
    assert term_of({**entry, "equation": "electrical"}) == VoltageGain(1, others=(2,))
