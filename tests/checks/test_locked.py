"""Runs with a locked shaft beside runs that turn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench import make_campaign
from identification.checks import check_runs
from identification.ingest import Run, read_run

TURNING = [
    read_run(run.frame, name=f"run_{k}.csv")
    for k, run in enumerate(make_campaign(21, ("coulomb_friction",), seed=3, rows=2000).runs[:3])
]


def standing(current: float, seed: int) -> Run:
    """A run at standstill in which the current alternates between two values [A]."""
    rng = np.random.default_rng(seed)
    table = TURNING[0].table()
    square = np.where(np.arange(len(table)) // 200 % 2, current, -0.4 * current)
    noise = rng.standard_normal((2, len(table)))
    resistance = float(np.std(TURNING[0].voltage) / np.std(TURNING[0].current))
    table = table.assign(
        voltage_V=resistance * square,
        current_A=square + 0.01 * current * noise[0],
        speed_rad_s=1e-3 * float(np.std(TURNING[0].speed)) * noise[1],
    )
    return read_run(table, name="stall.csv")


def codes(*runs: Run) -> dict[str, str]:
    """Code of the finding of each run."""
    return {finding.file: finding.code for finding in check_runs(runs).findings}


def rms(run: Run) -> float:
    """RMS current [A]."""
    return float(np.sqrt(np.mean(run.current**2)))


def test_a_stall_test_beside_turning_runs_is_refused() -> None:
    """It has the current of the turning runs several times and no speed."""
    stall = standing(6.0 * min(map(rms, TURNING)), 0)
    assert codes(*TURNING, stall) == {"stall.csv": "locked_shaft"}


@pytest.mark.parametrize("share", [0.3, 0.9])
def test_a_motor_that_friction_holds_is_not_locked(share: float) -> None:
    """A run below the breakaway torque has about the current that a turning shaft needs."""
    assert (
        "locked_shaft" not in codes(*TURNING, standing(share * min(map(rms, TURNING)), 1)).values()
    )


def test_only_the_locked_run_of_equal_names_is_refused() -> None:
    """Runs from DataFrames have one name unless the caller gives others."""
    runs = [replace(run, name="run") for run in TURNING]
    stall = replace(standing(6.0 * min(map(rms, TURNING)), 0), name="run")
    found = check_runs([*runs, stall]).findings
    assert [finding.code for finding in found] == ["locked_shaft"]


def test_turning_runs_are_not_locked() -> None:
    """However different their speeds are."""
    assert codes(*TURNING) == {}
