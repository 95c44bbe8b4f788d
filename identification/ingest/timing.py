"""Time base checks: monotonic time, gaps and sampling jitter.

A repeated or decreasing time is an error, because a repair would have to invent a time.  A gap is
accepted, because the samples around it are valid: the run is split there into segments with a
continuous motor state.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array
from identification.errors import BackwardTime, RepeatedTime
from identification.ingest.run import RunWarning, SourceLocator

__all__ = ["GAP_FACTOR", "check_time", "find_gaps", "find_segments"]

GAP_FACTOR = 5.0
"""An interval longer than this multiple of the median interval is a gap."""

# If a larger share of the intervals is that long, the sampling is irregular by design.
_MOST_GAPS = 0.1
_RMS_JITTER = 0.02
_LARGEST_JITTER = 0.5
_SLOW_S = 0.5
_FAST_S = 1e-7


def check_time(time: Array, locator: SourceLocator) -> None:
    """Reject a time [s] that does not increase strictly.

    Raises:
        RepeatedTime: A time equals the previous one.
        BackwardTime: A time is less than the previous one.
    """
    wrong = np.flatnonzero(time[1:] <= time[:-1])
    if not wrong.size:
        return
    sample = int(wrong[0]) + 1
    now, before = float(time[sample]), float(time[sample - 1])
    if now == before:
        message = (
            f"the time {now:.9g} s is repeated ({wrong.size} such samples); "
            "log the time with more digits, map it to row / RATE if the rate is fixed, or remove "
            "the repeated rows"
        )
        raise locator.error(RepeatedTime, message, "time_s", sample, now)
    message = (
        f"the time decreases from {before + 0.0:.9g} s to {now:.9g} s; "
        "a file is one run in order of time; cut it here, or correct the overflow of the counter"
    )
    raise locator.error(BackwardTime, message, "time_s", sample, now)


def find_gaps(time: Array) -> NDArray[np.intp]:
    """Index of the last sample before each gap of a time [s]."""
    interval = np.diff(time)
    if not interval.size:
        return np.empty(0, dtype=np.intp)
    gaps = np.flatnonzero(interval > GAP_FACTOR * float(np.median(interval)))
    return gaps[:0] if gaps.size > _MOST_GAPS * interval.size else gaps


def find_segments(
    time: Array, locator: SourceLocator
) -> tuple[tuple[tuple[int, int], ...], list[RunWarning]]:
    """Half-open sample ranges between the gaps of a time [s], and warnings about its sampling."""
    interval = np.diff(time)
    median = float(np.median(interval))
    gaps = find_gaps(time)
    edges = [0, *(int(gap) + 1 for gap in gaps), time.size]
    warnings = []
    if gaps.size:
        longest = int(gaps[np.argmax(interval[gaps])])
        message = (
            f"{gaps.size} gap(s), the longest is {interval[longest]:.4g} s at a sample interval of "
            f"{median:.4g} s; the run is divided into {gaps.size + 1} records"
        )
        warnings.append(locator.warning("gap", message, "time_s", longest + 1))
    regular = np.delete(interval, gaps)
    deviation = regular / median - 1.0
    worst = int(np.argmax(np.abs(deviation)))
    rms = float(np.sqrt(np.mean(deviation**2)))
    if rms > _RMS_JITTER or abs(float(deviation[worst])) > _LARGEST_JITTER:
        # `regular` omits the gaps; add those before the worst interval to get its sample index.
        before = int(np.searchsorted(gaps - np.arange(gaps.size), worst, side="right"))
        message = (
            f"sample intervals vary by {100 * rms:.2g} % (rms) around {median:.4g} s, the most "
            f"extreme is {regular[worst]:.4g} s; each sample is used at its logged time"
        )
        sample = worst + before + 1
        warnings.append(locator.warning("irregular_sampling", message, "time_s", sample))
    if not _FAST_S <= median <= _SLOW_S:
        message = (
            f"the sample interval is {median:.4g} s, unusual for a run of a motor; "
            "check the unit of the time"
        )
        warnings.append(locator.warning("suspicious_value", message, "time_s"))
    return tuple(zip(edges[:-1], edges[1:], strict=True)), warnings
