"""Detection of runs with identical samples, within and across training and validation.

Samples are compared instead of bytes, so that a copy with another header or other line endings is
found.  Time and temperature are ignored: a copy may start at another time, and the noise of the
other channels is never the same in two runs.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence

import numpy as np

from identification.ingest.run import Run

__all__ = ["first_alike", "repeat_warnings"]


def first_alike(runs: Sequence[Run]) -> tuple[int | None, ...]:
    """For each run the index of the first earlier run with the same samples; None if there is none.

    Args:
        runs: Runs of one motor.
    """
    first: dict[str, int] = {}
    found: list[int | None] = []
    for place, run in enumerate(runs):
        key = _key(run)
        found.append(None if key is None else first.get(key))
        if key is not None:
            first.setdefault(key, place)
    return tuple(found)


def _key(run: Run) -> str | None:
    """Hash of the samples; None if nothing changes, since two idle runs may be identical."""
    channels = (run.voltage, run.current, run.speed)
    if not any(np.ptp(channel) > 0.0 for channel in channels):
        return None
    digest = hashlib.sha256()
    for channel in channels:
        # -0.0 equals 0.0 but has other bytes.
        digest.update((channel + 0.0).tobytes())
    return digest.hexdigest()


def repeat_warnings(
    runs: Sequence[Run], training: int, alike: Sequence[int | None]
) -> tuple[str, ...]:
    """Warnings about identical runs and their effect on the result.

    Args:
        runs: Training runs, then validation runs.
        training: Number of training runs.
        alike: Result of `first_alike`.
    """
    groups: dict[int, list[int]] = {}
    for place, first in enumerate(alike):
        groups.setdefault(place if first is None else first, []).append(place)
    warnings = []
    for places in groups.values():
        fitted = [runs[place].name for place in places if place < training]
        checked = [runs[place].name for place in places if place >= training]
        if len(fitted) > 1:
            warnings.append(
                f"{_same(fitted)}: all are fitted, so they count {len(fitted)} times, and "
                f"intervals are too narrow by up to {math.sqrt(len(fitted)):.2g} times; give each "
                "run once"
            )
        if fitted and checked:
            warnings.append(
                f"{_same([*fitted[:1], *checked])}: the model was fitted to them, so they check "
                "neither it nor its effects; give --validation runs that are not fitted"
            )
        elif len(checked) > 1:
            warnings.append(
                f"{_same(checked)}: they count {len(checked)} times in the validation errors; give "
                "each run once"
            )
    return tuple(warnings)


def _same(names: Sequence[str]) -> str:
    distinct = list(dict.fromkeys(names))
    if len(distinct) == 1:
        return f"{len(names)} of the runs given, named {distinct[0]}, hold the same samples"
    return f"{', '.join(distinct[:-1])} and {distinct[-1]} hold the same samples"
