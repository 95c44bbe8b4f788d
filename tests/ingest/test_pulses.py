"""Speeds from the periods between the pulses of a tachometer."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from bench import make_campaign
from identification.checks.joined import joints_of
from identification.fit.declared import fit_declared
from identification.ingest import read_run
from identification.ingest.pulses import find_pulses
from identification.model.excitation import records_of
from tests.ingest.samples import ROWS, motor

TURN = 2.0 * np.pi


def by_pulses(time: Any, speed: Any, angle: float, step: float = 0.0) -> tuple[Any, Any]:
    """The speed as a logger shows it that measures the period between pulses, and their times.

    The shaft gives a pulse whenever it has turned by `angle` [rad] in one direction.  The logger
    knows the sign and rounds to `step` [rad/s].
    """
    fine = np.linspace(time[0], time[-1], 20 * time.size)
    size = np.abs(np.interp(fine, time, speed))
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (size[1:] + size[:-1]) * np.diff(fine))])
    pulses = np.interp(np.arange(angle, turned[-1], angle), turned, fine)
    last = np.searchsorted(pulses, time, side="right") - 1
    known = last >= 1
    shown = np.zeros(time.size)
    shown[known] = angle / (pulses[last[known]] - pulses[last[known] - 1])
    shown *= np.sign(np.interp(np.where(known, pulses[np.maximum(last, 0)], time), time, speed))
    return (np.round(shown / step) * step if step else shown), pulses


@pytest.mark.parametrize(("per_turn", "step"), [(1, 0.0), (1, 0.1), (2, 0.01), (4, 0.0)])
def test_a_value_counts_in_the_middle_of_its_period(per_turn: int, step: float) -> None:
    """A shaft with a sine speed of 10 to 70 rad/s: the mean over a period is that of its middle."""
    time = 2e-3 * np.arange(ROWS)
    speed = 40.0 + 30.0 * np.sin(1.7 * time)
    shown, pulses = by_pulses(time, speed, TURN / per_turn, step)
    run = read_run(pd.DataFrame({**motor(), "time_s": time, "speed_rad_s": shown}))

    assert run.pulses is not None
    assert run.pulses.angle == pytest.approx(TURN / per_turn, rel=0.05)
    assert [w.code for w in run.warnings if w.column == "speed_rad_s"] == ["held_channel"]
    assert abs(run.pulses.times.size - pulses.size) < 0.05 * pulses.size
    middles = (pulses[1:] + pulses[:-1]) / 2
    away = np.abs(run.pulses.times[:, None] - middles).min(axis=1)
    assert np.quantile(away, 0.95) < 2.5e-3
    counted = ~run.omitted("speed_rad_s")
    error = run.between_updates("speed_rad_s") - speed
    assert np.sqrt(np.mean(error[counted] ** 2)) < 0.1 * np.sqrt(np.mean((shown - speed) ** 2))


def test_a_standstill_is_no_measurement() -> None:
    """A logger that shows zero after a second without a pulse, and the last speed until then."""
    time = 2e-3 * np.arange(ROWS)
    speed = np.clip(60.0 * np.sin(1.2 * time), 0.0, None)
    shown, pulses = by_pulses(time, speed, TURN)
    last = pulses[np.maximum(np.searchsorted(pulses, time, side="right") - 1, 0)]
    shown[time - last > 1.0] = 0.0
    run = read_run(pd.DataFrame({**motor(), "time_s": time, "speed_rad_s": shown}))

    assert run.pulses is not None
    counted = ~run.omitted("speed_rad_s")
    assert np.all(run.between_updates("speed_rad_s")[counted][1:] > 0.0)


@pytest.mark.parametrize("kind", ["noisy", "coarse", "ramp", "sampled", "irregular", "paused"])
def test_no_other_speed_is_from_pulses(kind: str) -> None:
    """Noise, coarse steps of a smooth speed or a ramp, and updates at fixed or random times."""
    columns = motor()
    speed = columns["speed_rad_s"]
    smooth = pd.Series(speed).rolling(40, min_periods=1).mean().to_numpy()
    at_random = np.random.default_rng(1).random(ROWS) < 0.2
    others = {
        "noisy": speed,
        "coarse": np.round(smooth / 5.0) * 5.0,
        "ramp": np.round(np.linspace(0.0, 80.0, ROWS)),
        "sampled": np.repeat(smooth[::10], 10)[:ROWS],
        "irregular": smooth[np.maximum.accumulate(np.where(at_random, np.arange(ROWS), 0))],
        "paused": np.round(speed),
    }
    columns["time_s"] = columns["time_s"] + (kind == "paused") * (np.arange(ROWS) >= 100)
    assert read_run(pd.DataFrame({**columns, "speed_rad_s": others[kind]})).pulses is None


def test_a_speed_from_pulses_is_neither_joined_nor_biased() -> None:
    """The parameters agree with those of the speed itself within 4 deviations of both fits."""
    tables = [logged.frame for logged in make_campaign(21, (), seed=2, rows=4000).runs[:2]]
    slow = []
    for table in tables:
        time, speed = table["time_s"].to_numpy(), table["speed_rad_s"].to_numpy()
        smooth = pd.Series(speed).rolling(5, center=True, min_periods=1).mean().to_numpy()
        angle = 12.0 * float(np.mean(np.abs(speed))) * float(np.median(np.diff(time)))
        slow.append(table.assign(speed_rad_s=by_pulses(time, smooth, angle)[0]))
    runs = [read_run(table) for table in slow]
    fits = [
        fit_declared(records_of(found), "zoh")
        for found in ([read_run(table) for table in tables], runs)
    ]
    covariance = sum(fit.equations.covariance() for fit in fits)

    assert all(run.pulses is not None for run in runs)
    assert not any(joints_of(run) for run in runs)
    moved = np.abs(fits[1].position - fits[0].position) / np.sqrt(np.diag(covariance))
    assert moved.max() < 4.0


def test_the_smallest_number_is_no_speed_between_pulses() -> None:
    """Its angle over a sample interval is below the smallest number, hence zero."""
    speed = np.array([0.0, 5e-324, 0.0, 0.0, 0.0, 5e-324, 5e-324, 5e-324, 0.0, 0.0])

    assert find_pulses(1e-3 * np.arange(10, dtype=np.float64), speed) is None
