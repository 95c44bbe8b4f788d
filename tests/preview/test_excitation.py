"""Excitation of runs: fractions of the time, ranges and spans."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.ingest.run import Run
from identification.preview.excitation import excitation_of
from tests.motors import campaign, motor_named

SPEEDS = st.lists(st.floats(-1e4, 1e4), min_size=3, max_size=40)


def run_at(speeds: list[float]) -> Run:
    """Run with these speeds at unequal intervals."""
    time = np.cumsum(1.0 + np.arange(len(speeds)) % 3)
    still = np.zeros(len(speeds))
    return Run("run.csv", "0" * 64, time, still, still, np.array(speeds))


@given(SPEEDS)
def test_directions_and_standstill_fill_the_time(speeds: list[float]) -> None:
    """Every interval is forward, reverse or standstill."""
    found = excitation_of([run_at(speeds)], 1e4)
    assert found.forward + found.reverse + found.standstill == pytest.approx(1.0)


@given(SPEEDS)
def test_reversed_speed_exchanges_the_directions(speeds: list[float]) -> None:
    """The fractions of a run and of its mirror image."""
    found = excitation_of([run_at(speeds)], 1e4)
    mirrored = excitation_of([run_at([-speed for speed in speeds])], 1e4)
    assert mirrored.forward == pytest.approx(found.reverse)
    assert mirrored.standstill == pytest.approx(found.standstill)


def test_time_in_a_gap_belongs_to_no_direction() -> None:
    """Two segments of one second, a thousand seconds apart."""
    run = replace(run_at([5.0, 5.0, -5.0, -5.0]), time=np.array([0.0, 1.0, 1001.0, 1002.0]))
    found = excitation_of([replace(run, segments=((0, 2), (2, 4)))], 5.0)
    assert (found.duration_s, found.forward, found.reverse) == (2.0, 0.5, 0.5)


def test_runs_together_cover_the_ranges_of_each() -> None:
    """Three runs of a warming servo: the span is that from the coldest to the hottest sample."""
    runs = campaign(motor_named("servo 100 W"), seed=2)
    total = excitation_of(runs)
    logged = np.concatenate([run.temperature for run in runs if run.temperature is not None])
    assert total.temperature_span == pytest.approx(float(np.ptp(logged)))
    assert total.directions == 2
    assert total.duration_s == pytest.approx(sum(excitation_of([run]).duration_s for run in runs))
