"""Readings at an instant within a sample interval."""

from __future__ import annotations

import numpy as np
import pytest

from identification.effects.sensor import ChannelDelay
from identification.model.composite import MotorModel
from identification.model.excitation import records_of
from identification.model.simulate import Simulator
from tests.model.denser import densely
from tests.motors import driven, motor_named

SERVO = motor_named("servo 100 W")
ROWS, FINE = 400, 8
START = np.array([1.0, 50.0])
DECLARED = MotorModel(hold="zoh")
RECORD = records_of([driven(SERVO, ROWS, seed=3, warming=0.0)])[0]


@pytest.mark.parametrize("channel", ["current", "speed"])
@pytest.mark.parametrize("settling", [2.0, 0.1, 0.02])
def test_a_delayed_reading_is_exact_however_fast_the_current_settles(
    channel: str, settling: float
) -> None:
    """A delay of 1.25 intervals reads the tenth sample back of a log that is eight times denser.

    The electrical time constant is 2 intervals to a fiftieth of one.
    """
    values = SERVO.vector
    values[-1] = settling * SERVO.interval * values[0]
    column = ("current", "speed").index(channel)
    delayed = DECLARED.adding(ChannelDelay(channel, 4, SERVO.interval))
    late = np.append(values, 1.25 * SERVO.interval)

    simulator = Simulator.fitting(delayed, [RECORD], late)
    found = simulator.logged(late[:, None], [START])[0][:, column, 0]

    dense = Simulator.fitting(DECLARED, [densely(RECORD, FINE)], values)
    expected = dense.logged(values[:, None], [START])[0][:, column, 0]
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found[2:], expected[6 : 8 * ROWS - 10 : 8], atol=1e-7 * scale)
