"""Channels that are logged faster than they are updated: repeats are found and never fitted."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from bench import make_campaign
from identification.checks.joined import joints_of
from identification.fit.declared import fit_declared
from identification.ingest import Run, read_run
from identification.model.excitation import records_of
from identification.selection.projection import Residual
from tests.ingest.samples import ROWS, motor

CHANNELS = ("current_A", "speed_rad_s")


def held(values: Any, updates: Any) -> Any:
    """Series (n_sample,) that keeps its value between the updates, which begin with sample 0."""
    last = np.maximum.accumulate(np.where(updates, np.arange(updates.size), 0))
    return np.asarray(values)[last]


def every(period: float, rows: int = ROWS, seed: int | None = None) -> Any:
    """Boolean (n_sample,), True at the updates of a clock; with a seed, up to 0.3 samples late."""
    late = np.zeros(rows) if seed is None else np.random.default_rng(seed).uniform(0, 0.3, rows)
    times = np.ceil(np.arange(rows) * period + late)
    return np.isin(np.arange(rows), times)


def codes(run: Run) -> list[str]:
    """Codes of the warnings of a run."""
    return [warning.code for warning in run.warnings]


@pytest.mark.parametrize("channel", CHANNELS)
@pytest.mark.parametrize("period", [2, 3, 5, 10, 50])
@pytest.mark.parametrize("step", [0.0, 0.5])
def test_exactly_the_repeats_of_a_held_channel_are_omitted(
    channel: str, period: int, step: float
) -> None:
    """An update that leaves a coarse value unchanged counts as measured."""
    columns = motor()
    updates = every(period)
    values = columns[channel] if step == 0.0 else np.round(columns[channel] / step) * step
    run = read_run(pd.DataFrame({**columns, channel: held(values, updates)}))

    assert codes(run) == ["held_channel"]
    assert f"every {period} samples" in run.warnings[0].message
    assert np.array_equal(run.held[channel], ~updates)
    (record,) = records_of([run])
    assert np.array_equal(record.weight[:, CHANNELS.index(channel)], updates)
    assert record.weight[:, 1 - CHANNELS.index(channel)].all()


def test_updates_by_another_clock_are_found() -> None:
    """The intervals of 9.7 samples are of 9 and 10 samples, and of 11 with the delay of a bus."""
    columns = motor()
    updates = every(9.7, seed=1)
    run = read_run(pd.DataFrame({**columns, "speed_rad_s": held(columns["speed_rad_s"], updates)}))

    assert codes(run) == ["held_channel"]
    assert np.array_equal(run.held["speed_rad_s"], ~updates)


@pytest.mark.parametrize("step", [1e-3, 0.05, 0.5, 5.0])
def test_coarse_steps_are_no_updates(step: float) -> None:
    """The motor without noise in steps of all sizes, and a triangle that crosses them regularly."""
    columns = motor()
    smooth = pd.Series(columns["speed_rad_s"]).rolling(40, min_periods=1).mean().to_numpy()
    triangle = 0.1 * np.abs(np.arange(ROWS) % 2000 - 1000.0)
    for speed in (columns["speed_rad_s"], smooth, triangle):
        rounded = np.round(speed / step) * step
        assert not read_run(pd.DataFrame({**columns, "speed_rad_s": rounded})).held


def test_a_held_speed_is_neither_joined_nor_biased() -> None:
    """The repeats lag by half an update; omitted, they change no estimate by 3 deviations."""
    tables = [logged.frame for logged in make_campaign(21, (), seed=2, rows=4000).runs[:2]]
    updates = every(10, rows=4000)
    slow = [t.assign(speed_rad_s=held(t["speed_rad_s"], updates)) for t in tables]
    runs = [read_run(table) for table in slow]
    fits = [
        fit_declared(records_of([read_run(t) for t in tables]), "zoh"),
        fit_declared(records_of(runs), "zoh"),
        fit_declared(records_of([replace(run, held={}) for run in runs]), "zoh"),
    ]
    spread = np.sqrt(np.diag(fits[1].equations.covariance()))
    moved, lagged = (np.abs(fit.position - fits[0].position) / spread for fit in fits[1:])

    assert not any(joints_of(run) for run in runs)
    assert moved.max() < 3.0
    assert lagged.max() > 10.0


@pytest.mark.parametrize("period", [2, 4, 6])
def test_the_screening_compares_held_samples_in_proportion(period: int) -> None:
    """A stride that shares a factor with the period would meet all of the updates or none."""
    table = make_campaign(21, (), seed=3, rows=3000).runs[0].frame
    slow = table.assign(speed_rad_s=held(table["speed_rad_s"], every(period, rows=3000)))
    fit = fit_declared(records_of([read_run(slow)]), "zoh")
    stride = Residual.of(fit, 3000 // period // 8).stride
    (record,) = fit.simulator.records
    compared = stride * record.weight[::stride].sum(axis=0)

    assert stride > 1
    np.testing.assert_allclose(compared, record.weight.sum(axis=0), rtol=0.02)
