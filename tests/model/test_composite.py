"""Assembly of the equations of a model."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import pytest

from identification.effects.periodic import CoggingTorque
from identification.model.composite import INPUTS, MotorModel
from identification.model.term import Expression, Signals, Values
from tests.terms import MagneticDrag

asked: list[str] = []


@dataclass(frozen=True)
class Counted(MagneticDrag):
    """Drag that notes each request for its torque."""

    name = "counted_drag"

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        """Torque on the shaft [N m]."""
        asked.append(self.name)
        return super().torque(signals, states, values)


def test_equations_of_a_model_are_assembled_once() -> None:
    """Assembly takes milliseconds; step, step plan and readings of a model share it."""
    asked.clear()
    model = MotorModel((Counted(),))
    symbols = model.symbols()

    model.rates(*symbols)
    model.rates(*symbols, is_averaged=True)
    model.logged(*symbols)

    assert len(asked) == 1


@pytest.mark.parametrize("is_averaged", [False, True])
def test_only_averaged_equations_depend_on_the_turn(is_averaged: bool) -> None:
    """A torque that is periodic in the angle is averaged over the turn of the shaft if asked."""
    model = MotorModel((CoggingTorque(torque_size=0.01),))
    state, inputs, parameter = model.symbols()

    rates = model.rates(state, inputs, parameter, is_averaged=is_averaged)

    assert ca.depends_on(rates, inputs[INPUTS.index("turn")]) is is_averaged
