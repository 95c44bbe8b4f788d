"""Compressed columns of the runs for the page: the logged samples, or extremes beyond a size limit.

    stored_runs(runs, {"current_A": 0.05, "speed_rad_s": 0.3}) -> [{"columns": {...}, "note": ...}]

A column is rounded to an eighth of the noise or to the resolution of its log, differenced up to
twice, zigzag coded into 32-bit words, split into byte planes and deflated.  The browser inflates it
with `DecompressionStream`.  A measured channel is stored as its difference from the simulated one.
200,000 samples of a motor with nominal and final model take about 1.3 MB.  Runs that do not fit
into the page are stored as the extremes of every column in buckets of equally many samples:
outliers stay visible, and every stored row is a logged sample.
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping, Sequence
from typing import Final, TypedDict

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array, Bool, Index, stretches
from identification.result.numbers import count_text
from identification.result.report_data import RunTraces
from identification.result.residuals import gaps

__all__ = ["Column", "StoredRun", "encoded", "extremes", "stored_runs"]

_RESERVED: Final = 12_000
"""Part of the budget that each further run keeps [bytes]."""
_FEWEST_BUCKETS: Final = 100
_NOISE_STEPS: Final = 8.0
"""Rounding steps per standard deviation of the sensor noise."""
_STEPS: Final = 16_384.0
"""Rounding steps of the range of a column without known noise."""
_MOST_STEPS: Final = 2.0**29
"""Rounding steps that a difference of second order still holds in 32 bits."""
_TIME_STEPS: Final = 256.0
"""Rounding steps per sample interval of the time stamps."""
_MOST_DECIMALS: Final = 6
_PREDICTORS: Final = {
    f"{kind}_{channel}": f"after_{channel}"
    for kind in ("measured", "before")
    for channel in ("current", "speed")
}
"""Columns that are stored as the difference from another one."""


class Column(TypedDict):
    """One encoded column: value = low + step * word, plus the value of the column `plus` if any.

    `missing` lists first index and length of each stretch without values.
    """

    low: float
    step: float
    order: int
    missing: list[int]
    plus: str
    data: str


class StoredRun(TypedDict):
    """Columns of one run by name, their number of rows, and a note on what they contain."""

    rows: int
    complete: bool
    note: str
    columns: dict[str, Column]


def stored_runs(
    runs: Sequence[RunTraces], noise: Mapping[str, float | None], budget: int
) -> list[StoredRun]:
    """Encode the runs, in their order; validation runs are the first to be stored with all samples.

    `noise` is that of the result, ``current_A`` and ``speed_rad_s``; `budget` limits the size of
    all columns [bytes].
    """
    order = sorted(range(len(runs)), key=lambda k: runs[k].role != "validation")
    stored: dict[int, StoredRun] = {}
    for done, k in enumerate(order):
        others = len(runs) - done - 1
        room = max(budget - others * _RESERVED, 0)
        stored[k] = _fitting(runs[k], noise, room, budget // (others + 1))
        budget = max(budget - _size(stored[k]["columns"]), 0)
    return [stored[k] for k in range(len(runs))]


def _fitting(run: RunTraces, noise: Mapping[str, float | None], room: int, share: int) -> StoredRun:
    """A run with all samples in `room`, else with extremes in about `share` [bytes]."""
    rows = run.time.size
    columns, note = _stored(run, noise, np.arange(rows)), f"All {count_text(rows)} logged samples."
    whole = StoredRun(rows=rows, complete=True, note=note, columns=columns)
    if _size(columns) <= room:
        return whole
    channels = [values for name, values in _channels(run).items() if name != "time"]
    # Extremes hardly compress: a stored row takes about 3.5 bytes and each column adds two rows.
    bytes_per_bucket = 3.5 * 2.0 * len(channels) * (len(channels) + 1)
    buckets = max(int(share / bytes_per_bucket), _FEWEST_BUCKETS)
    kept = extremes(channels, buckets)
    if kept.size == rows:
        return whole
    note = (
        f"{count_text(rows)} samples; to limit the size of the page, it contains the extremes of "
        f"each channel in every {count_text(max(rows // buckets, 1))} samples."
    )
    return StoredRun(rows=rows, complete=False, note=note, columns=_stored(run, noise, kept))


def _size(columns: Mapping[str, Column]) -> int:
    return sum(len(column["data"]) + 60 for column in columns.values())


def _channels(run: RunTraces) -> dict[str, Array]:
    return {name: one for name, one in vars(run).items() if isinstance(one, np.ndarray)}


def _stored(run: RunTraces, noise: Mapping[str, float | None], kept: Index) -> dict[str, Column]:
    """The encoded columns of some samples, with a row of NaN in the middle of each gap."""
    time = run.time[kept]
    # A gap between the samples, not between the extremes that were kept.
    pauses = np.searchsorted(kept, gaps(run.time), side="right")
    pauses = np.unique(pauses[(pauses > 0) & (pauses < kept.size)])
    columns, steps = {}, {}
    for name, channel in _channels(run).items():
        values = channel[kept]
        fill = 0.5 * (time[pauses - 1] + time[pauses]) if name == "time" else np.nan
        columns[name] = np.insert(values, pauses, fill)
        quantity = "current_A" if name.endswith("current") else "speed_rad_s"
        known = noise.get(quantity) if name.endswith(("current", "speed")) else None
        steps[name] = _step(values, known / _NOISE_STEPS if known else 0.0)
    if time.size > 1:
        steps["time"] = float(np.median(np.diff(run.time))) / _TIME_STEPS
    found: dict[str, Column] = {}
    for name, values in columns.items():
        plus = _PREDICTORS.get(name, "")
        if plus and np.isfinite(columns[plus][np.isfinite(values)]).all():
            # As the browser decodes it, a missing value as the last known one.
            low, step, whole, _ = _words(columns[plus], steps[plus])
            found[name] = encoded(values - (low + step * whole), steps[name]) | {"plus": plus}
        else:
            found[name] = encoded(values, steps[name])
    return found


def _step(values: Array, step: float) -> float:
    """The resolution of the log if it is coarse enough, else the given step; 0 for any."""
    known = values[np.isfinite(values)]
    least = max(step, float(np.ptp(known)) / _STEPS if known.size and step == 0.0 else 0.0)
    for decimals in range(_MOST_DECIMALS):
        grid = 10.0**-decimals
        if grid < least:
            break
        if known.size and np.max(np.abs(known - grid * np.rint(known / grid))) < 1e-6 * grid:
            return grid
    return step


def _words(values: Array, step: float) -> tuple[float, float, NDArray[np.int64], Bool]:
    """Offset, step and words of a column, and which values are known; others repeat the last."""
    finite = np.isfinite(values)
    known = values[finite]
    low = float(known.min()) if known.size else 0.0
    span = float(known.max()) - low if known.size else 0.0
    if not np.isfinite(span):
        finite, low, span = np.zeros(values.size, dtype=np.bool_), 0.0, 0.0
    step = max(step if step > 0.0 else span / _STEPS, span / _MOST_STEPS)
    if not (np.isfinite(step) and step > 1e-300):
        step = 1.0
    last = np.maximum.accumulate(np.where(finite, np.arange(values.size), 0))
    whole = np.rint((np.where(finite, values, low)[last] - low) / step).astype(np.int64)
    return low, step, whole, finite


def encoded(values: Array, step: float = 0.0) -> Column:
    """Encode a column (n_sample,), not finite where missing, in steps or 1/16384 of its range.

    Errors are at most half a step of the column, which may exceed `step` for a wide range.
    """
    low, step, whole, finite = _words(values, step)
    # First index and length of each stretch of missing values, in turn.
    missing = [int(x) for first, last in stretches(~finite) for x in (first, last - first)]
    order, words = min(
        ((n, np.diff(whole, n, prepend=np.zeros(n, dtype=np.int64))) for n in (0, 1, 2)),
        key=lambda one: float(np.log2(1.0 + np.abs(one[1])).sum()),
    )
    zigzag = ((words << 1) ^ (words >> 63)).astype(np.uint32)
    planes = zigzag.astype("<u4").view(np.uint8).reshape(-1, 4).T
    return Column(
        low=low, step=step, order=order, missing=missing, plus="",
        data=base64.b64encode(zlib.compress(planes.tobytes(), 9)).decode("ascii"),
    )  # fmt: skip


def extremes(channels: Sequence[Array], buckets: int) -> Index:
    """Increasing indices of extremes of every channel in every bucket, and of both ends.

    The channels (n_sample,) share a time axis.  A short record keeps all samples.
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
