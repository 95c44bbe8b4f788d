"""Outlying runs are reported, and they do not affect the estimated noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.diagnosis.outliers import (
    noise_without_outlying_runs,
    outlier_warnings,
    outlying_run_warnings,
    root_mean_square,
)
from identification.fit.evaluate import Simulated
from identification.model.composite import INPUTS
from identification.model.excitation import records_of
from tests.motors import campaign, motor_named

Array = NDArray[np.float64]
NOISE = np.array([0.1, 1.0])


def simulated(scales: list[tuple[float, float]]) -> list[Simulated]:
    """Records whose residual is normal noise with the given multiples of the sensor noise."""
    rng = np.random.default_rng(1)
    runs = campaign(motor_named("servo 100 W"), seed=1, runs=len(scales), rows=2000)
    return [
        Simulated(
            record,
            record.measured - rng.standard_normal((record.rows, 2)) * NOISE * scale,
            np.zeros(2),
        )
        for record, scale in zip(records_of(runs), scales, strict=True)
    ]


def test_runs_that_differ_by_chance_are_not_outlying() -> None:
    """The noise levels of the runs differ by 30 %; a single run is never outlying."""
    assert outlying_run_warnings(simulated([(1.0, 1.2), (1.3, 0.9), (1.1, 1.0)]), NOISE) == []
    assert outlying_run_warnings(simulated([(1.0, 1.2), (1.3, 0.9)]), NOISE) == []
    assert outlying_run_warnings(simulated([(9.0, 9.0)]), NOISE) == []


def test_an_outlying_run_is_reported_once() -> None:
    """A run that deviates in both channels gives one warning that names both."""
    found = outlying_run_warnings(simulated([(1.0, 1.0), (5.0, 4.0), (1.0, 1.0)]), NOISE)

    (warning,) = found
    assert warning.code == "outlying_run"
    assert warning.message.startswith("run1.csv: outlying run")
    assert "current" in warning.message
    assert "speed" in warning.message


def test_noise_is_that_of_the_runs_that_fit() -> None:
    """One run of four deviates in current; the speed noise is estimated from all runs."""
    runs = simulated([(1.0, 1.0), (1.0, 1.0), (20.0, 1.0), (1.0, 1.0)])

    noise = noise_without_outlying_runs(runs, root_mean_square(runs))

    np.testing.assert_allclose(noise, NOISE, rtol=0.05)


def test_outliers_at_the_steps_of_the_voltage_are_its_timing() -> None:
    """A loop that logs the voltage late deviates at the steps; they must not be called faulty."""
    (one,) = simulated([(1.0, 1.0)])
    at = np.flatnonzero(np.abs(np.diff(one.record.column("voltage"))) > 8.0) + 1
    elsewhere = np.arange(7, one.record.rows, 200)

    for samples, code in ((at, "voltage_step_timing"), (elsewhere, "isolated_outliers")):
        residual = one.residual.copy()
        residual[samples, 0] += 10.0
        (warning,) = outlier_warnings([replace(one, logged=one.record.measured - residual)])
        assert warning.code == code
    assert outlier_warnings([one]) == []


def test_small_steps_of_the_voltage_show_its_timing_too() -> None:
    """Any step between two samples causes an outlier, also one of a hundredth of the range."""
    (one,) = simulated([(1.0, 1.0)])
    held = np.repeat([0.0, 5.0, 4.8, -5.0, -4.9, 3.0, 0.0, 0.1], one.record.rows // 8)
    voltage = np.pad(held, (0, one.record.rows - held.size), mode="edge")
    inputs = one.record.inputs.copy()
    inputs[:, INPUTS.index("voltage")] = voltage
    residual = one.residual.copy()
    residual[np.flatnonzero(np.diff(voltage)) + 1, 0] += 10.0
    record = replace(one.record, inputs=inputs)

    found = [replace(one, record=record, logged=one.record.measured - residual)]

    assert [warning.code for warning in outlier_warnings(found)] == ["voltage_step_timing"]
