"""Detection of rows that are missing where a held voltage steps.

A logger that loses single rows leaves intervals of two or more times the usual one.  A model uses
the logged voltage until the next row, so a step whose row is lost acts one row late.  The log does
not show when the voltage stepped, and the samples at the step, which determine resistance and
inductance, contradict the model most.  The fit omits the sample before the interval and starts
again after it.

Intervals that vary otherwise are those of irregular sampling, in which each row has its voltage.  A
voltage that changes in most intervals changes little in each of them.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from identification.checks.finding import Omission, omission
from identification.ingest.run import Run

__all__ = ["lost_steps_of"]

_STEP: Final = 0.1
"""Change of the voltage in a step at least, over the range of the voltage."""
_RARE: Final = 0.1
"""Largest fraction of the intervals in which a held voltage steps."""
_REGULAR: Final = 0.1
"""Largest deviation of an interval from a multiple of the usual one, over the usual one."""
_MOST: Final = 0.9
"""Least fraction of the intervals that have the usual length."""


def lost_steps_of(run: Run) -> Omission | None:
    """Samples of a run before intervals in which rows are lost and the voltage steps; or None."""
    intervals = np.diff(run.time)
    ratios = intervals / float(np.median(intervals))
    is_multiple = np.abs(ratios - np.round(ratios)) < _REGULAR
    is_usual = is_multiple & (np.round(ratios) == 1.0)
    steps = np.abs(np.diff(run.voltage)) > _STEP * float(np.ptp(run.voltage))
    if np.mean(is_usual) < _MOST or np.mean(steps) > _RARE:
        return None
    lost = steps & is_multiple & ~is_usual & run.joined
    if not lost.any():
        return None
    return omission(
        run,
        np.append(lost, False),
        "lost_rows",
        "voltage_V",
        "steps between rows that are further apart than the others: rows are missing, and the log "
        "does not show when it stepped",
        ("longest of these intervals over the usual one", float(ratios[lost].max()), 1.0),
        remedy="log every sample, or the time at which the voltage was set",
    )
