"""Choppers whose current is zero during a part of each period."""

from __future__ import annotations

import numpy as np
import pytest

from identification.checks import check_runs
from identification.ingest import Run

ROWS, PERIODS, PARTS = 2000, 4, 20
SUPPLY, RA, KT, J, B, DRY = 12.0, 1.2, 0.02, 1e-5, 2e-6, 0.002


def chopped(seed: int, inductance: float, *, diode: bool, of_supply: bool = False) -> Run:
    """Run at random duty cycles, with the duty cycle times the supply as its voltage.

    Four periods of 0.25 ms make a sample.  The current, a mean over each sample, is that of the
    motor or of the supply.
    """
    rng = np.random.default_rng(seed)
    duties = np.repeat(np.round(rng.uniform(0.1, 1.0, ROWS // 200) * PARTS) / PARTS, 200)
    step = 1e-3 / (PERIODS * PARTS)
    current, speed = np.zeros(ROWS), np.zeros(ROWS)
    i = w = 0.0
    for k, duty in enumerate(duties.tolist()):
        speed[k] = w
        for part in range(PERIODS * PARTS):
            is_on = part % PARTS < round(duty * PARTS)
            current[k] += i if is_on or not of_supply else 0.0
            i += step * ((SUPPLY if is_on else 0.0) - RA * i - KT * w) / inductance
            i = max(i, 0.0) if diode else i
            w += step * (KT * i - B * w - DRY * np.tanh(w)) / J
    noise = rng.standard_normal((2, ROWS))
    current = current / (PERIODS * PARTS) + 0.02 * noise[0]
    time, warmth = 1e-3 * np.arange(ROWS, dtype=np.float64), np.full(ROWS, 25.0)
    return Run(
        f"r{seed}.csv", str(seed), time, SUPPLY * duties, current, speed + 0.3 * noise[1], warmth
    )


def codes(run: Run) -> set[str]:
    """Codes of the contradictions of a run."""
    return {f.code for f in check_runs([run]).refused}


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("inductance", [0.25e-3, 1e-3])
def test_a_chopper_with_a_diode_leaves_the_voltage_to_the_motor(
    seed: int, inductance: float
) -> None:
    """The current reaches zero in each period, or after a step to a lower duty cycle."""
    assert codes(chopped(seed, inductance, diode=True)) == {"discontinuous_current"}


@pytest.mark.parametrize("seed", [1, 2])
def test_a_bridge_that_brakes_has_its_logged_voltage(seed: int) -> None:
    """The current becomes negative, and the mean voltage is the duty cycle times the supply."""
    assert codes(chopped(seed, 1e-3, diode=False)) == set()


@pytest.mark.parametrize("seed", [1, 2])
def test_the_supply_current_of_a_chopper_with_a_diode_is_refused(seed: int) -> None:
    """Either finding says to log the current of the motor."""
    found = check_runs([chopped(seed, 1.5e-3, diode=True, of_supply=True)]).refused

    assert {f.code for f in found} <= {"supply_current", "discontinuous_current"}
    assert any("log" in f.message and "supply" in f.message for f in found)
