"""Times of a fixed rate that were rounded by the logger, and times that only look like it."""

from __future__ import annotations

import numpy as np
import pytest

from identification.ingest.rounded import without_rounding
from identification.ingest.run import SourceLocator

LOCATOR = SourceLocator("run.csv", {"time_s": "t"}, int)


@pytest.mark.parametrize("rate", [400.0, 300.0, 128.0, 60.0, 990.0])
def test_a_fixed_rate_comes_back_from_rounded_times(rate: float) -> None:
    """A clock of milliseconds leaves no more than the error of a line through rounded times."""
    true = 3.2 + np.arange(1000) / rate
    logged = np.round(true, 3)

    found, notes = without_rounding(logged, LOCATOR)

    assert [note.code for note in notes] == ["rounded_time"]
    assert f"{rate:g} Hz" in str(notes[0])
    assert np.ptp(found - true) < 1e-4
    assert np.abs(np.diff(found) - 1.0 / rate).max() < 1e-6


@pytest.mark.parametrize("kind", ["even", "random", "lost", "three", "short", "fine"])
def test_other_times_stay_as_logged(kind: str) -> None:
    """Random intervals, lost samples and a jitter are no rounding."""
    rng = np.random.default_rng(1)
    even = np.arange(1000) * 2.5e-3
    times = {
        "even": even,
        "random": np.cumsum(rng.choice([2e-3, 3e-3], 1000)),
        "lost": np.delete(np.arange(1000) * 1e-3, [200, 500, 501, 900]),
        "three": np.cumsum(rng.choice([2e-3, 3e-3, 4e-3], 1000)),
        "short": np.round(even[:50], 3),
        "fine": np.round(even + 1e-5 * rng.standard_normal(1000), 5),
    }

    found, notes = without_rounding(times[kind], LOCATOR)

    assert notes == []
    np.testing.assert_array_equal(found, times[kind])
