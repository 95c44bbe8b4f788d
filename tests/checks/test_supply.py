"""Current sensors in the supply lead of a chopper, and motor currents that are none."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from identification.checks import check_runs
from identification.ingest import read_run

Array = NDArray[np.float64]

ROWS = 4000
SUPPLY = 24.0


def driven(lowest: float, seed: int, friction: float = 0.0) -> dict[str, Array]:
    """Motor at random steps of the voltage between `lowest` and 20 V, by steps of 0.1 ms.

    R 1.3 ohm, K 0.06 V s/rad, J 1.2e-4 kg m^2, b 4e-5 N m s/rad, L 1.5 mH, dry `friction` [N m].
    """
    rng = np.random.default_rng(seed)
    voltage = np.repeat(rng.uniform(lowest, 20.0, ROWS // 200), 200)
    current, speed = np.zeros(ROWS), np.zeros(ROWS)
    i = w = 0.0
    for k in range(ROWS):
        current[k], speed[k] = i, w
        for _ in range(20):
            i += 1e-4 * (voltage[k] - 1.3 * i - 0.06 * w) / 1.5e-3
            w += 1e-4 * (0.06 * i - 4e-5 * w - friction * np.tanh(w / 0.5)) / 1.2e-4
    noise = rng.standard_normal((2, ROWS))
    return {
        "time_s": 2e-3 * np.arange(ROWS),
        "voltage_V": voltage,
        "current_A": current + 0.02 * noise[0],
        "speed_rad_s": speed + 0.3 * noise[1],
    }


def codes(columns: dict[str, Array]) -> list[str]:
    """Codes of all findings of a run."""
    return [f.code for f in check_runs([read_run(pd.DataFrame(columns))]).findings]


@pytest.mark.parametrize("friction", [0.0, 0.03])
@pytest.mark.parametrize("lowest", [6.0, -20.0])
def test_the_current_of_the_supply_is_refused(lowest: float, friction: float) -> None:
    """A chopper draws the duty cycle times the motor current, in one direction and in two."""
    columns = driven(lowest, 1, friction)
    assert codes(columns) == []

    columns["current_A"] = columns["current_A"] * columns["voltage_V"] / SUPPLY
    assert codes(columns) == ["supply_current"]


def test_a_load_that_no_balance_explains_is_no_supply() -> None:
    """A torque that wanders as much as the current leaves both balances unexplained."""
    columns = driven(-20.0, 2)
    load = np.cumsum(np.random.default_rng(3).standard_normal(ROWS))
    current = columns["current_A"] + 4.0 * load / np.std(load)
    columns["voltage_V"] = 1.3 * current + 0.06 * columns["speed_rad_s"]
    columns["current_A"] = current

    assert "supply_current" not in codes(columns)
