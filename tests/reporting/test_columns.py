"""Columns of the runs in the page: what is logged comes back, and the page stays small."""

from __future__ import annotations

import base64
import zlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from identification.reporting.columns import Column, encoded, extremes, stored_runs
from tests.reports import NOISE, make_report


def decoded(columns: dict[str, Column], name: str) -> NDArray[np.float64]:
    """The column as the script of the page decodes it: planes, zigzag, sums."""
    column = columns[name]
    planes = np.frombuffer(zlib.decompress(base64.b64decode(column["data"])), dtype=np.uint8)
    words = planes.reshape(4, -1).T.copy().view("<u4").ravel().astype(np.int64)
    whole = (words >> 1) ^ -(words & 1)
    for _ in range(column["order"]):
        whole = np.cumsum(whole)
    values = column["low"] + column["step"] * whole
    for first, length in zip(column["missing"][::2], column["missing"][1::2], strict=True):
        values[first : first + length] = np.nan
    if column["plus"]:
        values = values + decoded(columns, column["plus"])
    return np.asarray(values, dtype=np.float64)


@given(
    arrays(np.float64, st.integers(0, 80), elements=st.floats(-1e9, 1e9) | st.just(np.nan)),
    st.sampled_from([0.0, 1e-3, 10.0]),
)
def test_a_column_comes_back_within_half_a_step(values: NDArray[np.float64], step: float) -> None:
    """Rounding is the only loss; missing values stay missing."""
    column = encoded(values, step)

    back = decoded({"a": column}, "a")

    np.testing.assert_array_equal(np.isnan(back), np.isnan(values))
    assert np.nanmax(np.abs(back - values), initial=0.0) <= 0.5001 * column["step"] + 1e-6


def test_a_measured_channel_is_rounded_far_below_its_noise() -> None:
    """An eighth of the noise: rounding adds 0.07 % to the standard deviation."""
    data = make_report(rows=4000)
    run = data.runs[0]

    (stored,) = stored_runs([run], NOISE, 10**6)
    back = decoded(stored["columns"], "measured_current")

    assert stored["complete"]
    assert np.max(np.abs(back - run.measured_current)) <= NOISE["current_A"] / 15.9
    assert np.max(np.abs(decoded(stored["columns"], "time") - run.time)) < 1e-5


def test_a_channel_logged_in_steps_comes_back_exactly() -> None:
    """A thermometer with one decimal: its steps of 0.1 K are those of the stored column."""
    run = make_report(rows=2000).runs[0]
    assert run.temperature is not None
    logged = np.round(run.temperature, 1)

    (stored,) = stored_runs([replace(run, temperature=logged)], NOISE, 10**6)

    assert stored["columns"]["temperature"]["step"] == 0.1
    np.testing.assert_allclose(decoded(stored["columns"], "temperature"), logged, atol=1e-9)


def test_validation_runs_are_stored_with_all_samples_first() -> None:
    """Room for two runs of three: the training run that does not fit holds extremes only."""
    data = make_report(rows=4000)
    runs = [data.runs[0], data.runs[1], data.runs[5]]
    size = sum(len(c["data"]) for c in stored_runs(runs[2:], NOISE, 10**6)[0]["columns"].values())

    stored = stored_runs(runs, NOISE, budget=int(2.6 * size))

    assert [one["complete"] for one in stored] == [True, False, True]
    assert "extremes of each channel in every" in stored[1]["note"]
    assert stored[2]["note"] == "All 4\u202f000 logged samples."


def test_a_gap_is_a_missing_row_between_its_ends() -> None:
    """The row in the middle of the gap has a time and no values, so that lines break there."""
    run = make_report(rows=100).runs[0]
    late = run.time.copy()
    late[50:] += 9.0

    (stored,) = stored_runs([replace(run, time=late)], NOISE, 10**6)
    time = decoded(stored["columns"], "time")

    assert np.all(np.diff(time) > 0.0)
    assert time[50] == pytest.approx(0.5 * (late[49] + late[50]), abs=1e-3)
    assert stored["columns"]["after_speed"]["missing"] == [50, 1]


def test_a_single_spike_in_a_long_record_is_kept() -> None:
    """One large sample among 100,000 is the extreme of its bucket."""
    channel = np.sin(np.arange(100_000) / 5000.0)
    channel[43_210] = 9.0

    kept = extremes([channel], 300)

    assert 43_210 in kept
    assert kept.size <= 2 * 300 + 2


@given(
    arrays(np.float64, st.integers(1, 400), elements=st.floats(-1e3, 1e3)),
    st.integers(1, 40),
)
def test_the_range_of_a_record_survives(channel: NDArray[np.float64], buckets: int) -> None:
    """Decimation keeps the maximum, the minimum and both ends of any record."""
    kept = extremes([channel], buckets)

    assert channel[kept].max() == channel.max()
    assert channel[kept].min() == channel.min()
    assert {0, channel.size - 1} <= set(kept.tolist())
    assert np.all(np.diff(kept) > 0)


def test_a_record_with_missing_samples_keeps_the_extremes_of_the_others() -> None:
    """NaN counts neither as maximum nor as minimum."""
    channel = np.arange(10_000.0)
    channel[::3] = np.nan
    channel[5_000] = -50.0

    assert 5_000 in extremes([channel], 50)
