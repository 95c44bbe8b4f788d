"""Min-max decimation of long records for plotting, and their compact encoding for the page.

A screen is about a thousand pixels wide.  In every bucket of samples, the minimum and the maximum
of each channel plotted together are kept: outliers stay visible, and every plotted point is an
actual sample at its own time.  Averages would hide the outliers.  Extremes alone turn a step into a
ramp as wide as a bucket, which shows when zooming, so the corners of smooth channels are kept too.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["extremes", "packed", "packed_time", "with_corners"]

Array = NDArray[np.float64]
Indices = NDArray[np.int_]

_CORNER = 0.003
_STEPS = 65534
"""Quantisation steps of an encoded value; the code 65535 is a missing value."""


def extremes(channels: Sequence[Array], buckets: int) -> Indices:
    """Indices of the samples to plot: extremes of every channel in every bucket, and both ends.

    Args:
        channels: (n_sample,) each; plotted over the same time axis.
        buckets: Number of buckets with equally many samples.

    Returns:
        (n_kept,) increasing indices; all samples if the record is short.
    """
    size = channels[0].size
    if size <= 2 * buckets:
        return np.arange(size)
    edges = np.linspace(0, size, buckets + 1).astype(np.int_)
    width = int(np.max(np.diff(edges)))
    # Rows of equal width: a shorter bucket repeats its last sample.
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
    """Add the samples where linear interpolation between the kept ones has its largest errors.

    It is meant for channels without noise, such as a simulation: noise has corners everywhere.

    Args:
        kept: (n_kept,) increasing indices, including the first and the last sample.
        channel: (n_sample,).
        most: Largest number of samples to add.

    Returns:
        Increasing indices; linear interpolation between them is within 0.3 % of the channel's
        range, unless `most` was too small.
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


def packed(values: Array) -> dict[str, Any]:
    """Values as 16-bit integers in base64, a third of the length of decimal digits.

    The resolution is 1/65534 of the range, far finer than a screen can show.

    Args:
        values: (n_sample,); NaN for missing values.

    Returns:
        ``low``, ``step`` and ``data``: the value is ``low + step * word``, word 65535 is missing.
    """
    finite = values[np.isfinite(values)]
    low = float(finite.min()) if finite.size else 0.0
    step = (float(finite.max()) - low) / _STEPS if finite.size else 0.0
    words = np.zeros(values.size) if step == 0.0 else (values - low) / step
    words = np.where(np.isfinite(values), np.rint(words), 65535.0)
    return {"low": low, "step": step, "data": _base64(words.astype("<u2"))}


def packed_time(time: Array) -> dict[str, Any]:
    """Times as 32-bit floats relative to the first one, in base64.

    Args:
        time: (n_sample,) increasing [s].

    Returns:
        ``start`` and ``data``.
    """
    return {"start": float(time[0]), "data": _base64((time - time[0]).astype("<f4"))}


def _base64(words: NDArray[Any]) -> str:
    return base64.b64encode(words.tobytes()).decode("ascii")
