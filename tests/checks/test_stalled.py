"""Shafts that are held for a part of a run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.checks import check_runs
from identification.checks.campaign import admitted
from identification.checks.stalled import stalled_of
from identification.fit.declared import fit_declared
from identification.ingest import Run
from identification.model.excitation import records_of
from identification.options import FitOptions

R, K, L, J, B, FRICTION, STEP, ROWS = 4.2, 0.018, 3e-3, 2.5e-6, 4e-6, 1e-3, 1e-3, 4000


def turned(seed: int, *, held: bool, friction: float = FRICTION, low: float = 3.0) -> Run:
    """Steps of one direction; a stop holds the shaft of a geared motor for 1 s.

    Args:
        seed: Of the voltage and the noise.
        held: True for a shaft that is held.
        friction: Coulomb torque [N m]; static friction is 1.5 times as large.
        low: Least voltage [V].
    """
    rng = np.random.default_rng(seed)
    voltage = np.repeat(rng.uniform(low, 11.0, ROWS // 250), 250).round(2)
    i, w, angle = 0.0, 0.0, 0.0
    current, count = np.zeros(ROWS), np.zeros(ROWS)
    for k in range(ROWS):
        current[k], count[k] = i, np.floor(angle * 400 / (2.0 * np.pi))
        stop = held and 1500 <= k < 2500
        for _ in range(20):
            i += STEP / 20 / L * (voltage[k] - R * i - K * w)
            torque = K * i - B * w - (1.5 * friction if w == 0.0 else friction)
            w = 0.0 if stop else max(w + STEP / 20 / J * torque, 0.0)
            angle += STEP / 20 * w
    speed = np.diff(count, prepend=0.0) * 2.0 * np.pi / 400 / STEP
    current += rng.normal(0.0, 0.01, ROWS)
    return Run(
        f"r{seed}.csv", str(seed), STEP * np.arange(ROWS, dtype=np.float64), voltage, current, speed
    )


@pytest.mark.parametrize("seed", range(3))
def test_samples_of_a_held_shaft_are_omitted(seed: int) -> None:
    """All of them, and no others; the finding says so."""
    verdict = check_runs([turned(seed, held=True)])

    assert [(f.code, f.severity) for f in verdict.findings] == [("stalled_shaft", "suspect")]
    (first, start), (again, last) = verdict.runs[0].segments
    assert (first, last) == (0, ROWS)
    assert abs(start - 1500) <= 2
    assert abs(again - 2500) <= 25


@pytest.mark.parametrize("seed", range(3))
def test_a_motor_that_friction_stops_is_not_held(seed: int) -> None:
    """Each voltage below 4 V lets this motor stand for 0.25 s, until a higher one turns it."""
    run = turned(seed, held=False, friction=0.012, low=0.0)

    assert np.count_nonzero(run.speed == 0.0) > 200
    assert stalled_of(run) is None


def test_a_speed_sensor_that_fails_is_no_held_shaft() -> None:
    """The current is that of a turning motor, and the finding remains that of the sensor."""
    run = turned(0, held=False)
    speed = np.where((np.arange(ROWS) >= 1500) & (np.arange(ROWS) < 2500), 0.0, run.speed)
    run = replace(run, speed=speed)

    assert stalled_of(run) is None
    assert [f.code for f in check_runs([run]).refused] == ["stuck_sensor"]


def test_estimates_without_the_stall_are_those_of_the_motor() -> None:
    """Kt25 and J within 5 %, b with the dry friction; with the stall, b is far too large."""
    runs = [turned(seed, held=True) for seed in (1, 2)]
    admission = admitted(runs, [], FitOptions())
    parted, whole = (fit_declared(records_of(each), "zoh") for each in (admission.training, runs))

    assert parted.by_name["Kt25"] == pytest.approx(K, rel=0.05)
    assert parted.by_name["J"] == pytest.approx(J, rel=0.05)
    assert parted.by_name["b"] < 2.0 * B
    assert whole.by_name["b"] > 5.0 * B
