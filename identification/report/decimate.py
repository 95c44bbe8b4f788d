"""Long records made short for the eye, and packed for the page.

A screen is about a thousand dots wide.  Of every bucket of samples the smallest and the largest are
kept, of every channel that is drawn together: spikes stay, and every point shown is a sample that
was taken, at its own time.  Averages would hide what one looks for.  Extremes alone turn a step
into a ramp as wide as a bucket, which shows when one zooms; so the corners of smooth channels are
kept too.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["extremes", "gaps", "packed", "packed_time", "with_corners"]

Array = NDArray[np.float64]
Indices = NDArray[np.int_]

_CORNER = 0.003
_STEPS = 65534
"""Levels of a packed value; 65535 stands for a value that is not there."""


def extremes(channels: Sequence[Array], buckets: int) -> Indices:
    """Samples to draw: the extremes of every channel in every bucket, and both ends.

    Args:
        channels: (n_sample,) each; drawn over the same time axis.
        buckets: Number of equal stretches of samples.

    Returns:
        (n_kept,) increasing positions; all of them where the record is short.
    """
    size = channels[0].size
    if size <= 2 * buckets:
        return np.arange(size)
    edges = np.linspace(0, size, buckets + 1).astype(np.int_)
    width = int(np.max(np.diff(edges)))
    # Rows of equal width: a shorter bucket sees its last sample twice.
    rows = np.minimum(edges[:-1, None] + np.arange(width), edges[1:, None] - 1)
    kept = [np.array([0, size - 1])]
    for channel in channels:
        values = channel[rows]
        missing = np.isnan(values)
        low = np.argmin(np.where(missing, np.inf, values), axis=1)
        high = np.argmax(np.where(missing, -np.inf, values), axis=1)
        first = np.arange(buckets)
        kept += [rows[first, low], rows[first, high]]
    return np.unique(np.concatenate(kept))


def with_corners(kept: Indices, channel: Array, most: int) -> Indices:
    """Add the samples by which straight lines between the kept ones miss a channel most.

    Meant for channels without noise, such as a simulation: noise has corners everywhere.

    Args:
        kept: (n_kept,) increasing positions, the first and last sample among them.
        channel: (n_sample,).
        most: How many samples to add at most.

    Returns:
        Increasing positions: lines between them miss the channel by at most 0.3 % of its range,
        unless `most` was too few.
    """
    samples = np.arange(channel.size)
    finite = channel[np.isfinite(channel)]
    tolerance = _CORNER * float(np.ptp(finite)) if finite.size else 0.0
    room = most
    while room > 0:
        drawn = np.interp(samples, kept, channel[kept])
        miss = np.nan_to_num(np.abs(channel - drawn), nan=0.0, posinf=0.0)
        worst = np.maximum.reduceat(miss, kept)
        between = np.repeat(worst, np.diff(np.append(kept, channel.size)))
        found = np.flatnonzero((miss == between) & (miss > tolerance))
        if found.size == 0:
            break
        found = found[np.argsort(miss[found])[::-1][:room]]
        room -= found.size
        kept = np.union1d(kept, found)
    return kept


def gaps(time: Array, factor: float = 4.0) -> Indices:
    """Samples after which the record pauses, (n_gap,): where a line must break.

    Args:
        time: (n_sample,) increasing [s].
        factor: A pause is longer than this many usual intervals.
    """
    steps = np.diff(time)
    return np.flatnonzero(steps > factor * np.median(steps)) if steps.size else np.zeros(0, np.int_)


def packed(values: Array) -> dict[str, Any]:
    """Values as 16-bit steps in base64, a third of their length in digits.

    A step is 1/65534 of the range, far below what a screen can show.

    Args:
        values: (n_sample,); NaN where there is nothing to draw.

    Returns:
        ``low``, ``step`` and ``data``: the value is ``low + step * word``, word 65535 is nothing.
    """
    finite = values[np.isfinite(values)]
    low = float(finite.min()) if finite.size else 0.0
    step = (float(finite.max()) - low) / _STEPS if finite.size else 0.0
    words = np.zeros(values.size) if step == 0.0 else (values - low) / step
    words = np.where(np.isfinite(values), np.rint(words), 65535.0)
    return {"low": low, "step": step, "data": _base64(words.astype("<u2"))}


def packed_time(time: Array) -> dict[str, Any]:
    """Times as 32-bit seconds since the first one, in base64.

    Args:
        time: (n_sample,) increasing [s].

    Returns:
        ``start`` and ``data``.
    """
    return {"start": float(time[0]), "data": _base64((time - time[0]).astype("<f4"))}


def _base64(words: NDArray[Any]) -> str:
    return base64.b64encode(words.tobytes()).decode("ascii")
