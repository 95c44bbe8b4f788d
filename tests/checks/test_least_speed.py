"""Speed sensors that read zero below a least speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.checks import check_runs
from identification.fit.declared import fit_declared
from identification.ingest import Run
from identification.model.excitation import records_of
from tests.motors import campaign, motor_named

SERVO = motor_named("servo 100 W")


def read_above(run: Run, least: float) -> Run:
    """The run with a speed of zero where it is below the least speed [rad/s]."""
    return replace(run, speed=np.where(np.abs(run.speed) < least, 0.0, run.speed))


def test_speeds_that_read_zero_are_omitted() -> None:
    """The motor is found from the other samples; one run proves the least speed of all."""
    runs = campaign(SERVO, seed=2, runs=3)
    least = 0.1 * max(float(np.abs(run.speed).max()) for run in runs)
    verdict = check_runs([read_above(run, least) for run in runs])

    assert {(f.code, f.severity) for f in verdict.findings} == {("least_speed", "suspect")}
    fit = fit_declared(records_of(verdict.runs), "zoh")
    deviations = np.sqrt(np.diag(fit.equations.covariance()))
    assert np.all(np.abs(fit.position - fit.coordinates.of(SERVO.vector)) < 4.0 * deviations)


@pytest.mark.parametrize("seed", [3, 4])
def test_a_shaft_at_rest_that_starts_fast_has_no_least_speed(seed: int) -> None:
    """Before its first step the speed is exactly zero, and each later one is above a tenth."""
    runs = []
    for run in campaign(SERVO, seed=seed, runs=3):
        slow = np.flatnonzero(np.abs(run.speed) < 0.1 * np.abs(run.speed).max())
        gaps = np.diff(np.append(slow, run.rows))
        start = int(slow[np.argmax(gaps)])
        part = slice(start, start + int(gaps.max()))
        rest = np.zeros(50)
        voltage, current, speed = (
            np.concatenate((rest, signal[part]))
            for signal in (run.voltage, run.current, np.r_[run.speed])
        )
        time = np.median(np.diff(run.time)) * np.arange(voltage.size, dtype=np.float64)
        runs.append(Run(run.name, run.sha256, time, voltage, current, speed, None))

    assert "least_speed" not in {f.code for f in check_runs(runs).findings}


def test_runs_without_a_least_speed_have_none() -> None:
    """A noisy sensor reads every speed."""
    assert check_runs(campaign(SERVO, seed=5, runs=2)).findings == ()
