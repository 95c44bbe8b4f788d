"""Times of a fixed rate that a logger has rounded.

At 400 Hz, a clock of milliseconds logs the intervals 2, 3, 2, 3 ms.  A model that follows these
times sees a jitter that is not there, and explains it by delays and filters.  The times of a fixed
rate, rounded to a step q, are a digital straight line: their intervals have two values that differ
by q, and no time is farther than q / 2 from a line.  Intervals at random would leave every line
like a random walk.

Source: Klette and Rosenfeld, Discrete Applied Mathematics 139 (2004), 197-230 (digital
straightness).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from identification.arrays import Array
from identification.ingest.run import RunWarning, SourceLocator

__all__ = ["without_rounding"]

_FEWEST: Final = 100
"""Least number of samples.  A random walk of so many steps of q / 2 has a range of about 8 q."""
_FEWEST_OF_EACH: Final = 10
"""Least number of intervals of each length; a few long ones are lost samples."""
_LEAST: Final = 0.02
"""Least step q over the mean interval, from which rounding matters."""
_RANGE: Final = 1.1
"""Largest range of the deviations from a line over q; the fitted line is not quite the true one."""
_EQUAL: Final = 1e-3
"""Difference of two intervals over q that is a rounding error."""


def without_rounding(time: Array, locator: SourceLocator) -> tuple[Array, list[RunWarning]]:
    """Times of the fixed rate whose rounded values are logged, and a note; else the times [s]."""
    interval = np.diff(time)
    step = float(np.ptp(interval)) if interval.size else 0.0
    if time.size < _FEWEST or step < _LEAST * float(np.mean(interval)):
        return time, []
    multiples = interval / step
    number_long = int(np.count_nonzero(multiples > np.mean([multiples.min(), multiples.max()])))
    has_two = bool(np.all(np.abs(multiples - np.round(multiples)) < _EQUAL))
    has_two &= _FEWEST_OF_EACH <= number_long <= interval.size - _FEWEST_OF_EACH
    if not has_two:
        return time, []
    number = np.arange(time.size, dtype=np.float64)
    slope, origin = np.polyfit(number - number.mean(), time, 1)
    even = origin + slope * (number - number.mean())
    if float(np.ptp(time - even)) > _RANGE * step:
        return time, []
    message = (
        f"the times are those of a fixed rate of {1.0 / slope:.4g} Hz, rounded to {step:.3g} s; "
        "each sample is used at its time before rounding"
    )
    return even, [locator.warning("rounded_time", message, "time_s")]
