"""Heating of the winding in the training records of a fit."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from identification.effects.load import LoadTorque
from identification.effects.thermal import SelfHeating
from identification.fit.evaluate import largest_heating
from identification.fit.solve import Fit
from identification.model.composite import MotorModel
from identification.model.excitation import records_of
from identification.model.simulate import Simulator, initial_states
from identification.model.term import AbstractTerm
from tests.motors import campaign, motor_named

MOTOR = motor_named("servo 100 W")
DECLARED = np.array(MOTOR.vector) * np.array([1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0])
"""Parameters with a resistance that does not depend on the temperature."""


def _heating(term: AbstractTerm, *own: float) -> tuple[float, float]:
    """Largest heating, and largest rise that the simulated losses cause without a time constant."""
    model, values = MotorModel((term,)), np.array([*DECLARED, *own])
    records = records_of(campaign(MOTOR, seed=3, runs=2, rows=600), 0)
    states = [initial_states(model, record) for record in records]
    simulator = Simulator.fitting(model, records, values)
    fit = SimpleNamespace(simulator=simulator, values=values, states=states)
    currents = [y[:, 0, 0] for y in simulator.states(values[:, None], states)]
    loss = max(float(np.max(current**2)) for current in currents) * DECLARED[0]
    return largest_heating(cast(Fit, fit)), own[0] * loss


def test_a_fast_winding_heats_by_the_thermal_resistance_times_the_loss() -> None:
    """With a time constant far below that of the motor, the rise follows the loss."""
    heating, most = _heating(SelfHeating(1.0, 1e-4, 10.0), 2.0, 2e-4)

    assert most > 0.0
    assert heating == pytest.approx(most, rel=0.1)


def test_heating_is_in_proportion_to_the_thermal_resistance() -> None:
    """The resistance is constant, so the losses are; a slow winding stays below the steady rise."""
    term = SelfHeating(1.0, 1e-3, 100.0)
    one, most = _heating(term, 1.0, 5.0)
    three, _ = _heating(term, 3.0, 5.0)

    assert 0.0 < one < 0.9 * most
    assert three == pytest.approx(3.0 * one, rel=1e-6)


def test_a_model_without_self_heating_does_not_heat() -> None:
    """A load warms no winding of the model."""
    assert _heating(LoadTorque(0.1), 0.05)[0] == 0.0
