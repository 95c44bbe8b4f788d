"""Cogging: a torque with several periods within a sample interval is averaged, not sampled."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.effects.periodic import CoggingTorque
from identification.model.composite import INPUTS, MotorModel
from identification.model.excitation import Record
from identification.model.simulate import Simulator
from identification.model.substeps import evenly
from tests.motors import motor_named

Array = NDArray[np.float64]

SERVO = motor_named("servo 100 W")
INTERVAL, ROWS = 1e-3, 2000


def _simulator(order: float, speed: float) -> tuple[Simulator, Array]:
    """A servo whose logged angle turns at a speed that rises from zero to `speed` [rad/s]."""
    time: Array = INTERVAL * np.arange(ROWS, dtype=np.float64)
    columns: dict[str, Array] = dict.fromkeys(INPUTS, np.zeros(ROWS))
    columns |= {"interval": np.append(np.diff(time), 0.0), "time": time}
    columns |= {name: np.full(ROWS, 12.0) for name in ("voltage", "voltage_next")}
    columns |= {name: np.full(ROWS, 25.0) for name in ("temperature", "temperature_next")}
    blank = Record(
        0, "run.csv", 0, time, np.column_stack([columns[name] for name in INPUTS]),
        np.zeros((ROWS, 2)), np.ones((ROWS, 2)), angle_logged=True,
    )  # fmt: skip
    record = blank.with_angle(0.5 * speed / time[-1] * time**2)
    values = np.concatenate([SERVO.values, [order, 0.05, 0.02, 0.01, 0.0]])
    return Simulator.fitting(MotorModel((CoggingTorque(0.05),)), [record], values), values


def _logged(simulator: Simulator, values: Array, substeps: int) -> Array:
    """(n_sample, 2) simulated current and speed."""
    divided = replace(simulator, substeps=evenly([ROWS], substeps))
    return divided.logged(values[:, None], [np.zeros(2)])[0][:, :, 0]


@pytest.mark.parametrize("order", [6.0, 28.0])
def test_a_fast_shaft_needs_no_substeps_for_a_torque_of_high_order(order: float) -> None:
    """The torque of order 28 turns by 11 rad in an interval at 400 rad/s.

    Sampled once per interval it would alias to a slow torque of full size.  The reference divides
    each interval into 64 substeps.
    """
    simulator, values = _simulator(order, 400.0)
    without = values.copy()
    without[8:] = 0.0

    exact = _logged(simulator, values, 64)
    size = np.std(exact - _logged(simulator, without, 64), axis=0)
    error = np.std(_logged(simulator, values, 1) - exact, axis=0)

    assert np.all(error < 0.05 * size)


def test_the_error_of_the_average_is_of_second_order_in_the_step() -> None:
    """The average is exact; only its course within a step is lost, which is symmetric."""
    simulator, values = _simulator(6.0, 60.0)

    exact = _logged(simulator, values, 64)
    errors = [np.std(_logged(simulator, values, n)[:, 1] - exact[:, 1]) for n in (1, 2, 4)]

    assert errors[0] / errors[1] > 3.5
    assert errors[1] / errors[2] > 3.5
