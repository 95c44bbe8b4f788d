"""Orders in which a residual repeats with the shaft angle, integer or not."""

from __future__ import annotations

import numpy as np
import pytest

from identification.effects.orders import HIGHEST_ORDER, orders_of
from identification.ingest.run import Run
from identification.model.excitation import Record, records_of

ROWS = 6000


def record(speed: np.ndarray) -> Record:
    """Record at these speeds; the angle is their integral."""
    time = 1e-3 * np.arange(speed.size, dtype=np.float64)
    run = Run("run.csv", "0" * 64, time, speed * 0.1, speed * 0.01, speed, None, None)
    return records_of([run])[0]


@pytest.mark.parametrize("order", [1.0, 4.5, 13.96, 30.2])
@pytest.mark.parametrize("reverses", [False, True])
def test_a_ripple_of_any_order_is_found(order: float, reverses: bool) -> None:
    """The resolution is one over the number of revolutions; the first order is the true one."""
    time = np.arange(ROWS) * 1e-3
    speed = 60.0 * np.sin(1.3 * time) if reverses else 50.0 + 15.0 * np.sin(3.0 * time)
    made = record(speed)
    angle = made.column("angle")
    noise = np.random.default_rng(4).standard_normal((ROWS, 2))
    ripple = np.column_stack([np.zeros(ROWS), np.sin(order * angle + 0.4)])

    found = orders_of([made], [noise + ripple], HIGHEST_ORDER)

    assert np.min(np.abs(np.array(found) - order)) < np.pi / np.ptp(angle)


def test_white_noise_has_no_order() -> None:
    """By chance one line in 65,000 exceeds the limit; a record has about 4,000 lines."""
    rng = np.random.default_rng(5)
    made = record(50.0 + 15.0 * np.sin(3e-3 * np.arange(ROWS)))

    found = [len(orders_of([made], [rng.standard_normal((ROWS, 2))], 36.0)) for _ in range(40)]

    assert np.mean(found) < 0.5


def test_a_motor_that_does_not_turn_has_no_order() -> None:
    """Two revolutions are required to detect a period."""
    made = record(np.full(ROWS, 1e-3))

    assert orders_of([made], [np.ones((ROWS, 2))], 36.0) == ()
