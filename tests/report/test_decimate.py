"""Decimation of long records for plots: extremes, corners and gaps are kept."""

from __future__ import annotations

import base64

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from identification.report.decimate import extremes, packed, packed_time, with_corners
from identification.result.residuals import gaps


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
def test_the_range_of_a_record_survives(channel: np.ndarray, buckets: int) -> None:
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

    kept = extremes([channel], 50)

    assert 5_000 in kept


def test_a_step_stays_a_step_when_one_zooms() -> None:
    """Linear interpolation of the kept samples errs by at most 0.3 % of the range."""
    channel = np.where(np.arange(20_000) % 3000 < 1500, 1.0, -1.0)
    channel[5_000:7_000] += np.linspace(0, 1, 2_000) ** 3
    coarse = extremes([channel], 50)

    kept = with_corners(coarse, channel, 400)

    samples = np.arange(channel.size)
    missed = np.abs(channel - np.interp(samples, kept, channel[kept])).max()
    assert missed <= 0.003 * np.ptp(channel)
    assert np.abs(channel - np.interp(samples, coarse, channel[coarse])).max() > 0.1
    assert set(coarse) <= set(kept)


def test_corners_are_added_up_to_the_limit_and_no_further() -> None:
    """White noise fills the limit of corners; a channel without samples gets none."""
    rng = np.random.default_rng(71)
    coarse = np.array([0, 999])

    assert with_corners(coarse, rng.standard_normal(1000), 30).size == 32
    assert with_corners(coarse, np.full(1000, np.nan), 30).size == 2


def test_a_pause_in_the_record_is_found_where_it_begins() -> None:
    """A step of 0.5 s after sample 99, among steps of 0.01 s, is the only gap."""
    time = np.arange(200.0) / 100.0
    time[100:] += 0.5

    assert gaps(time).tolist() == [99]
    assert gaps(np.array([1.0])).size == 0


@given(arrays(np.float64, st.integers(1, 60), elements=st.floats(-1e6, 1e6) | st.just(np.nan)))
def test_packed_values_come_back_to_half_a_step(values: np.ndarray) -> None:
    """A 16-bit step is 1/65534 of the range; missing values remain missing."""
    pack = packed(values)
    words = np.frombuffer(base64.b64decode(pack["data"]), dtype="<u2")

    unpacked = np.where(words == 65535, np.nan, pack["low"] + pack["step"] * words)

    assert unpacked == pytest.approx(values, abs=0.51 * pack["step"] + 1e-9, nan_ok=True)


def test_packed_times_come_back_to_six_microseconds() -> None:
    """A 32-bit float has 24 bits, so 91 s are resolved to 6 microseconds."""
    time = np.asarray(5000.0 + 0.0013 * np.arange(70_000.0), dtype=np.float64)
    pack = packed_time(time)
    words = np.frombuffer(base64.b64decode(pack["data"]), dtype="<f4")

    assert pack["start"] + words.astype(float) == pytest.approx(time, abs=6e-6)
