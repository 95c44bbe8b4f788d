"""Detection of channels that are logged faster than their sensor or controller updates them.

Between two updates such a channel repeats its value, and the repeats are no measurements: they lag
the motor by up to one update, and the next update looks like a jump.  A channel counts as held if

- the intervals between its changes are multiples of one number of samples.  If a channel may change
  at any sample, an interval is such a multiple in one of `period` cases, and a Chernoff bound on
  the binomial distribution gives the probability that as many are;
- some changes exceed its quantisation step.  A slow ramp in coarse steps changes as regularly, by
  one step at a time.

Updates by another clock drift: with long periods, an interval may deviate by one sample.  A speed
from the pulses of a tachometer is updated at angles instead of times (`pulses.py`).

Source: Hoeffding, J. American Statistical Association 58 (1963), 13-30, theorem 1 (Chernoff bound).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array
from identification.ingest.pulses import Pulses, find_pulses, improbability
from identification.ingest.run import RunWarning, SourceLocator

__all__ = ["find_held"]

Mask = NDArray[np.bool_]

_LEVEL: Final = 1e-9
"""Probability that a channel which is not held counts as held."""
_REGULAR: Final = 0.98
"""Least fraction of the intervals that are multiples; the others are of samples that the logger
missed."""
_WANDERING: Final = 5
"""Period from which an interval may deviate by one sample [samples]."""
_STEPS: Final = 1.5
"""Change over the quantisation step from which it is not the next step."""


def find_held(
    channels: dict[str, Array], time: Array, locator: SourceLocator
) -> tuple[dict[str, Mask], Pulses | None, list[RunWarning]]:
    """Find the samples of current and speed that repeat the value of the last update.

    Returns:
        Channel name to boolean (n_sample,), True at a repeat, for channels with such samples; the
        pulses, if the speed is that of a pulse tachometer; and one warning for each channel.
    """
    held: dict[str, Mask] = {}
    pulses = None
    warnings = []
    for name in ("current_A", "speed_rad_s"):
        changes = 1 + np.flatnonzero(np.diff(channels[name]))
        period = _period(channels[name], changes)
        if period:
            held[name] = _repeats(changes, period, channels[name].size)
            message = (
                f"takes a new value only every {period} samples; the {int(held[name].sum())} "
                "samples between are repeats and are omitted, and the others count as measured "
                "at their times"
            )
            warnings.append(locator.warning("held_channel", message, name, int(changes[0])))
    if "speed_rad_s" not in held:
        pulses = find_pulses(time, channels["speed_rad_s"])
    if pulses is not None:
        held["speed_rad_s"] = ~pulses.measured(time)
        message = (
            f"takes a new value every {pulses.angle / (2 * math.pi):.3g} revolutions, as from the "
            f"pulses of a tachometer; each of the {pulses.times.size} values counts in the middle "
            "of the period between pulses that it measures, and the repeats are omitted"
        )
        warnings.append(locator.warning("held_channel", message, "speed_rad_s"))
    return held, pulses, warnings


def _period(signal: Array, changes: NDArray[np.intp]) -> int:
    """Samples between the updates of a held channel; zero for any other."""
    intervals = np.diff(changes)
    if not intervals.size:
        return 0
    sizes = np.abs(signal[changes] - signal[changes - 1])
    if not np.any(sizes > _STEPS * sizes.min()):
        return 0
    longest = int(np.quantile(intervals, 1.0 - _REGULAR)) + 1
    for period in range(longest, 1, -1):
        slack = int(period >= _WANDERING)
        off = np.abs(intervals - period * np.round(intervals / period)) > slack
        share, chance = 1.0 - float(off.mean()), (2 * slack + 1) / period
        is_regular = share >= _REGULAR
        if is_regular and improbability(share, intervals.size, chance) > math.log(longest / _LEVEL):
            updates = np.maximum(np.round(intervals / period), 1.0)
            return int(np.round(np.median(intervals / updates)))
    return 0


def _repeats(changes: NDArray[np.intp], period: int, rows: int) -> Mask:
    """Boolean (n_sample,), True between updates; an update may leave the value unchanged."""
    mask = np.ones(rows, dtype=bool)
    mask[changes] = False
    starts, stops = changes, np.append(changes[1:], rows + period // 2)
    for start, stop in zip(starts.tolist(), stops.tolist(), strict=True):
        mask[start : stop - period // 2 : period] = False
    mask[changes[0] % period : changes[0] : period] = False
    return mask
