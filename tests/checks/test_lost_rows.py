"""Runs in which single rows are lost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.checks.campaign import admitted
from identification.checks.lost_rows import lost_steps_of
from identification.fit.declared import fit_declared
from identification.ingest import Run
from identification.model.excitation import records_of
from identification.options import FitOptions
from tests.motors import campaign, motor_named

SERVO = motor_named("servo 100 W")


def rows_of(run: Run, kept: NDArray[np.bool_]) -> Run:
    """The run without some of its rows."""
    assert run.temperature is not None
    channels = (run.time, run.voltage, run.current, run.speed, run.temperature)
    time, voltage, current, speed, warmth = (each[kept] for each in channels)
    return Run(run.name, run.sha256, time, voltage, current, speed, warmth)


def losing(run: Run) -> tuple[Run, int]:
    """The run without the rows of every third step of its voltage; the number of these rows."""
    steps = np.flatnonzero(np.abs(np.diff(run.voltage)) > 0.1 * np.ptp(run.voltage)) + 1
    kept = np.ones(run.rows, dtype=bool)
    kept[steps[::3]] = False
    return rows_of(run, kept), steps[::3].size


def test_intervals_in_which_the_row_of_a_step_is_lost_are_omitted() -> None:
    """Each lost step takes one sample from the fit, and divides the run."""
    run, number = losing(campaign(SERVO, seed=1, runs=1)[0])
    found = lost_steps_of(run)

    assert found is not None
    assert found.finding.code == "lost_rows"
    assert found.samples.sum() == number


def test_lost_rows_leave_the_parameters_right() -> None:
    """With the lost steps, the voltage acts a row late, and the residual is twice as large."""
    runs = [losing(run)[0] for run in campaign(SERVO, seed=2)]
    late = fit_declared(records_of(runs), "zoh")
    ours = fit_declared(records_of(admitted(runs, [], FitOptions()).training), "zoh")
    errors = (ours.position - ours.coordinates.of(SERVO.vector)) / np.sqrt(
        np.diag(ours.equations.covariance())
    )

    assert np.all(late.weighting.deviation > 2.0 * ours.weighting.deviation)
    assert np.all(np.abs(errors) < 4.0)


def test_rows_lost_elsewhere_are_no_fault() -> None:
    """Rows without a step of the voltage are lost; the logged voltage acts all the same."""
    run = campaign(SERVO, seed=3, runs=1)[0]
    changes = np.diff(run.voltage, prepend=run.voltage[:1]) != 0.0
    beside = changes | np.roll(changes, -1)
    kept = beside | (np.arange(run.rows) % 17 != 5)

    assert lost_steps_of(rows_of(run, kept)) is None


def test_irregular_samples_have_no_lost_rows() -> None:
    """Intervals between half and one and a half of the mean are those of a free-running loop."""
    run = campaign(SERVO, seed=4, runs=1)[0]
    intervals = np.random.default_rng(4).uniform(0.5, 1.5, run.rows) * SERVO.interval

    assert lost_steps_of(replace(run, time=np.cumsum(intervals))) is None
