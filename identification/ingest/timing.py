"""Checks of the time base: it runs forward, and it is said where it stumbles.

A repeated or backward time is an error: any repair would have to invent a time.  A gap is not: the
samples around it are good, so the run is cut into segments there, within which the motor's state
is continuous.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.errors import BackwardTime, RepeatedTime
from identification.ingest.place import Places
from identification.ingest.run import RunWarning

__all__ = ["GAP_FACTOR", "check_time", "find_segments"]

Array = NDArray[np.float64]

GAP_FACTOR = 5.0
"""An interval this many times the median one is a gap."""

# Where more than this share of all intervals are that long, the logger is irregular by design.
_MOST_GAPS = 0.1
_RMS_JITTER = 0.02
_LARGEST_JITTER = 0.5
_SLOW_S = 0.5
_FAST_S = 1e-7


def check_time(time: Array, places: Places) -> None:
    """Refuse a time that does not increase.

    Args:
        time: (n_sample,) [s].
        places: Where the samples stand.

    Raises:
        RepeatedTime: A time equal to the one above it.
        BackwardTime: A time before the one above it.
    """
    wrong = np.flatnonzero(np.diff(time) <= 0.0)
    if not wrong.size:
        return
    sample = int(wrong[0]) + 1
    now, before = float(time[sample]), float(time[sample - 1])
    if now == before:
        raise places.error(
            RepeatedTime,
            f"the time {now:.9g} s is there twice ({wrong.size} such rows); "
            "log the time with more digits or remove the repeated rows",
            "time_s",
            sample,
            now,
        )
    raise places.error(
        BackwardTime,
        f"the time falls from {before:.9g} s to {now:.9g} s; "
        "a file is one run in order of time, cut it here or undo the counter's overflow",
        "time_s",
        sample,
        now,
    )


def find_segments(
    time: Array, places: Places
) -> tuple[tuple[tuple[int, int], ...], list[RunWarning]]:
    """Cut a run at its gaps and say how regular its sampling is.

    Args:
        time: (n_sample,) strictly increasing [s].
        places: Where the samples stand.

    Returns:
        Half-open sample ranges, and warnings.
    """
    interval = np.diff(time)
    median = float(np.median(interval))
    gaps = np.flatnonzero(interval > GAP_FACTOR * median)
    if gaps.size > _MOST_GAPS * interval.size:
        gaps = gaps[:0]
    warnings = [_gap_warning(interval, gaps, median, places)] if gaps.size else []
    warnings += _jitter_warning(np.delete(interval, gaps), gaps, median, places)
    warnings += _rate_warning(median, places)
    edges = [0, *(int(gap) + 1 for gap in gaps), time.size]
    return tuple(zip(edges[:-1], edges[1:], strict=True)), warnings


def _gap_warning(interval: Array, gaps: NDArray[np.intp], median: float, at: Places) -> RunWarning:
    longest = int(gaps[np.argmax(interval[gaps])])
    return at.warning(
        "gap",
        f"{gaps.size} gap(s) in the record, the longest of {interval[longest]:.4g} s at a sampling "
        f"interval of {median:.4g} s; the run is used as {gaps.size + 1} segments",
        "time_s",
        longest + 1,
    )


def _jitter_warning(
    interval: Array, gaps: NDArray[np.intp], median: float, places: Places
) -> list[RunWarning]:
    deviation = interval / median - 1.0
    worst = int(np.argmax(np.abs(deviation)))
    rms = float(np.sqrt(np.mean(deviation**2)))
    if rms <= _RMS_JITTER and abs(float(deviation[worst])) <= _LARGEST_JITTER:
        return []
    # `deviation` lacks the gaps; count those before it to find the sample again.
    sample = worst + int(np.searchsorted(gaps - np.arange(gaps.size), worst, side="right")) + 1
    return [
        places.warning(
            "irregular_sampling",
            f"sampling intervals vary by {100 * rms:.2g} % (rms) around {median:.4g} s and reach "
            f"{interval[worst]:.4g} s; every sample is used at its own time",
            "time_s",
            sample,
        )
    ]


def _rate_warning(median: float, places: Places) -> list[RunWarning]:
    if _FAST_S <= median <= _SLOW_S:
        return []
    return [
        places.warning(
            "suspicious_value",
            f"samples are {median:.4g} s apart, unusual for a motor's run; "
            "check the unit of the time",
            "time_s",
        )
    ]
