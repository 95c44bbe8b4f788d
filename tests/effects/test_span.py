"""A brake with another weight in each run, applied during the same span."""

from __future__ import annotations

import numpy as np
import pytest

from identification.effects.load import LoadStep
from identification.effects.runs import EACH_RUN
from identification.effects.span import LoadSpan
from identification.fit.campaign import Campaign, campaign_of
from identification.fit.declared import fit_declared
from identification.ingest import Run
from identification.result.run_values import run_values
from identification.selection.candidates import scales_of, with_predicted_gain
from identification.selection.screen import screened
from identification.selection.trials import Trials
from identification.surrogates.entry import term_of
from tests.motors import drive, motor_named

MOTOR = motor_named("servo 100 W")
ROWS, STEPS, NOISE = 800, 5, 0.004
SPAN = slice(200, 600)


def braked(torque: float, rng: np.random.Generator) -> Run:
    """Run at 25 degC with a torque against the motion during the span, by Heun's method."""
    ra, _, kt, _, inertia, viscous, inductance = MOTOR.values
    voltage = 0.5 * (MOTOR.voltage + drive(MOTOR, "forward", ROWS, rng))
    load = np.zeros(ROWS)
    load[SPAN] = torque
    step = MOTOR.interval / STEPS
    state = np.array([0.0, 0.5 * MOTOR.voltage / kt])
    found = np.empty((ROWS, 2))
    for row in range(ROWS):
        found[row] = state

        def rates(x: np.ndarray, row: int = row) -> np.ndarray:
            electrical = (voltage[row] - ra * x[0] - kt * x[1]) / inductance
            return np.array([electrical, (kt * x[0] - viscous * x[1] - load[row]) / inertia])

        for _ in range(STEPS):
            first = rates(state)
            state = state + step * (first + rates(state + step * first)) / 2
    found += NOISE * found.std(axis=0) * rng.standard_normal(found.shape)
    time = MOTOR.interval * np.arange(ROWS, dtype=np.float64)
    warm = np.full(ROWS, 25.0)
    return Run("run.csv", "0" * 64, time, voltage, found[:, 0], found[:, 1], warm)


def with_weights(shares: tuple[float, ...]) -> tuple[Campaign, list[float]]:
    """Campaign whose last run is for validation, and its loads [N m].

    The loads are relative to the stall torque of the motor.
    """
    rng = np.random.default_rng(3)
    torques = [share * MOTOR.voltage / MOTOR.values[0] * MOTOR.values[2] for share in shares]
    runs = [braked(torque, rng) for torque in torques]
    return campaign_of(runs[:-1], runs[-1:]), torques


def test_another_weight_in_each_run_during_one_span_is_a_load_of_each_run() -> None:
    """The weights and the span are known; no run has the weight of another one."""
    found, torques = with_weights((0.0, 0.03, 0.08, 0.05))
    trials = Trials(found)
    nominal = trials.evaluate(fit_declared(found.training, "zoh"))

    scores = screened(nominal.fit, LoadStep.candidates(scales_of(nominal.fit)))
    fits = trials.refits(nominal, with_predicted_gain(scores, 2))
    # A model far behind the best, such as one torque of some runs, is not finished.
    (best,) = trials.finish_best(nominal, fits)

    (term,) = best.fit.simulator.model.terms
    assert isinstance(term, LoadSpan)
    assert trials.criteria(best, nominal).passed
    values = best.fit.by_name
    assert values["load_step.start"] == pytest.approx(SPAN.start * MOTOR.interval, rel=0.01)
    assert values["load_step.stop"] == pytest.approx(SPAN.stop * MOTOR.interval, rel=0.01)
    for entry, torque in zip(run_values(term, best.fit, 1.0), torques, strict=False):
        # The edges are smoothed over two samples.
        median = entry["values"]["torque"]["median"]
        assert median == pytest.approx(torque, abs=0.003 * max(torques))


def test_a_load_of_each_run_comes_back_from_a_result() -> None:
    """The settings distinguish it from a load of some runs."""
    sizes = {"torque_size": 2.0, "edge": 0.01, "duration": 3.0}

    span = term_of({"name": "load_step", "settings": {**sizes, "own": True}})
    assert span == LoadSpan(2.0, 0.01, 3.0)
    assert span.variant == EACH_RUN
    some = term_of({"name": "load_step", "settings": {**sizes, "run": 1, "others": [2]}})
    assert some == LoadStep(1, 2.0, 0.01, 3.0, others=(2,))
