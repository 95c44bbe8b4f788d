"""Typical bench faults: refused with a correction, suspected, or mentioned in a warning."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.fault_table import FAULTS, Fault
from benchmarks.faults import seen
from identification.checks import check_runs
from identification.ingest import Run, read_run

DATA = Path(__file__).parents[2] / "data"
MET = {
    "refuse": {"refuse"},
    "suspect": {"refuse", "suspect"},
    "warn": {"refuse", "suspect", "warn"},
    "none": {"", "warn"},
}
SMALL_MOTOR = 7001
"""33 W, 27 V: of all wrong units, only mV exceeds the bounds of the reader."""


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: f"{fault.name}, {fault.scope}")
def test_a_fault_is_found_and_its_correction_corrects_it(fault: Fault) -> None:
    """Reference: the outcome column of the table; a correction must remove every finding."""
    found = seen(fault, SMALL_MOTOR, rows=1500)

    assert found.after in MET[fault.outcome], found
    if fault.corrected:
        assert found.corrected is not False, found
        # A contradiction names the option, an impossible value the mapping.
        assert "--map '" in found.words or "a mapping such as {" in found.words


def test_the_table_has_more_than_25_types() -> None:
    """A fault in one run and the same fault in all runs count as one type."""
    assert len({fault.name for fault in FAULTS}) >= 25


def test_a_faulty_file_that_is_given_twice_is_named_for_each() -> None:
    """Six runs of the servo, of which the last two are the same run in rpm."""
    names = ["training_1", "training_2", "training_4", "training_5", "validation_1"]
    runs = [read_run(DATA / "brush_drop_servo" / f"{name}.csv") for name in names]
    twice = [read_run(DATA / "brush_drop_servo" / "validation_2.csv") for _ in range(2)]
    faulty = [replace(run, speed=run.speed * 30.0 / np.pi) for run in twice]

    found = check_runs([*runs, *faulty]).refused

    assert [(f.code, f.file) for f in found] == [("scaled_channel", "validation_2.csv")] * 2


PAPER_RUNS = [read_run(DATA / "paper_motor" / f"training_{k}.csv") for k in (1, 2, 3, 5)]
"""Runs of a motor whose friction keeps current and speed proportional: one run determines neither
R nor K, and only the inductance shows that v and i belong together."""


def flipped(run: Run, channel: str) -> Run:
    """Run with the sign of one channel reversed."""
    return replace(run, **{channel: -getattr(run, channel)})


@pytest.mark.parametrize("channel", ["voltage", "current"])
@pytest.mark.parametrize("k", range(len(PAPER_RUNS)))
def test_reversed_sensor_of_a_motor_with_much_friction_is_refused(k: int, channel: str) -> None:
    """Reversed signs give negative L and negative R, which no delay explains."""
    runs = [flipped(run, channel) if n == k else run for n, run in enumerate(PAPER_RUNS)]

    (finding,) = check_runs(runs).findings

    assert (finding.code, finding.severity) == ("reversed_channel", "refuse")
    assert (finding.file, finding.column) == (runs[k].name, f"{channel}_{channel_unit(channel)}")


def channel_unit(channel: str) -> str:
    """Unit in the name of a column."""
    return {"voltage": "V", "current": "A"}[channel]


def test_reversed_speed_of_a_motor_with_much_friction_is_suspected() -> None:
    """The sign of K w is uncertain there; the apparent inertia and friction are negative."""
    runs = [flipped(run, "speed") for run in PAPER_RUNS]

    found = check_runs(runs).findings

    assert [(f.code, f.severity, f.column) for f in found] == [
        ("reversed_channel", "suspect", "speed_rad_s")
    ] * len(runs)
    assert all("speed_rad_s=speed_rad_s * -1" in f.corrections[0] for f in found)


def test_negative_inductance_by_a_late_current_is_no_reversed_sensor() -> None:
    """A current delayed by 2.5 L/R has the apparent inductance -1.5 L and the true resistance."""
    run = read_run(DATA / "clean_servo" / "training_1.csv")
    late = round(2.5 * 2.6e-3 / 1.1 / float(np.median(np.diff(run.time)))) + 1
    delayed = replace(
        run, current=np.concatenate([np.full(late, run.current[0]), run.current[:-late]])
    )

    assert not [f for f in check_runs([delayed]).findings if f.code == "reversed_channel"]
