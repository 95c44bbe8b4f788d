"""Runs that a logger has filled with zeros."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.checks import check_runs
from identification.checks.campaign import admitted
from identification.checks.padded import padding_of
from identification.fit.declared import fit_declared
from identification.ingest import Run
from identification.model.excitation import records_of
from identification.options import FitOptions
from tests.motors import campaign, motor_named

SERVO = motor_named("servo 100 W")
ROWS = 200
"""Rows of zeros at each end."""


def moving_run(seed: int) -> Run:
    """Run that ends while the shaft turns at more than half of its highest speed."""
    run = campaign(SERVO, seed=seed, runs=1)[0]
    speed = np.abs(run.speed)
    return first_rows(run, int(np.flatnonzero(speed > 0.5 * speed.max())[-1]) + 1)


def first_rows(run: Run, stop: int) -> Run:
    """The run up to a sample."""
    channels = (run.time, run.voltage, run.current, run.speed)
    time, voltage, current, speed = (each[:stop] for each in channels)
    warmth = None if run.temperature is None else run.temperature[:stop]
    return Run(run.name, run.sha256, time, voltage, current, speed, warmth)


def padded(run: Run, before: int, after: int) -> Run:
    """The run with rows of zeros at its ends."""
    voltage, current, speed = (
        np.pad(each, (before, after)) for each in (run.voltage, run.current, run.speed)
    )
    time = np.median(np.diff(run.time)) * np.arange(voltage.size, dtype=np.float64)
    warmth = run.temperature
    warmth = None if warmth is None else np.pad(warmth, (before, after), mode="edge")
    return Run(run.name, run.sha256, time, voltage, current, speed, warmth)


@pytest.mark.parametrize(("before", "after"), [(ROWS, ROWS), (0, ROWS)])
def test_rows_of_zeros_are_omitted(before: int, after: int) -> None:
    """The run between the rows of zeros is kept, and nothing else."""
    run = moving_run(1)
    verdict = check_runs([padded(run, before, after)])

    assert [(f.code, f.severity) for f in verdict.findings] == [("padded_run", "suspect")]
    assert verdict.runs[0].segments == ((before, before + run.rows),)


def test_the_motor_is_found_without_the_rows_of_zeros() -> None:
    """The fit is that of the run as it was before the logger filled it."""
    run = moving_run(2)
    whole = fit_declared(records_of([run]), "zoh")
    training = admitted([padded(run, ROWS, ROWS)], [], FitOptions()).training
    found = fit_declared(records_of(training), "zoh")

    assert found.by_name["J"] == pytest.approx(whole.by_name["J"], rel=1e-3)
    assert found.by_name["Kt25"] == pytest.approx(whole.by_name["Kt25"], rel=1e-3)


def test_a_shaft_that_comes_to_rest_is_no_padding() -> None:
    """The speed falls over several samples, and sensors without noise read zero afterwards."""
    run = moving_run(3)
    rested = padded(run, 0, ROWS)
    speed = rested.speed.copy()
    speed[run.rows :] = speed[run.rows - 1] * np.exp(-np.arange(ROWS) / 6.0)
    speed[run.rows + ROWS // 2 :] = 0.0

    assert padding_of(replace(rested, speed=speed)) is None


@pytest.mark.parametrize("seed", range(3))
def test_a_run_of_measured_samples_is_no_padding(seed: int) -> None:
    """The sensors have noise, which is not exactly zero for long."""
    assert padding_of(campaign(SERVO, seed=seed, runs=1)[0]) is None
