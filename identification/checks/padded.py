"""Detection of rows that a logger has filled with zeros after the motor was recorded.

A logger with a fixed length, or a script that joins channels of different lengths, fills the rest
of a run with zeros.  Voltage, current and speed are then exactly zero at an end of the run, and the
speed jumps there by more than anywhere else in the run.  A shaft that comes to rest slows down
first.  If one end is padding, zeros at the other end are, too.

No law stops the shaft at once, so the fit omits these samples.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from identification.checks.finding import Omission, omission
from identification.checks.limited import noise_of
from identification.ingest.run import Run

__all__ = ["padding_of"]

_FEWEST: Final = 20
"""Fewest rows of zeros: a shaft at rest that starts has fewer by chance."""
_NEAR: Final = 8.0
"""Noise deviations of the speed by which a jump exceeds the others: noise is in four values."""


def padding_of(run: Run) -> Omission | None:
    """Samples at the ends of a run that are filled with zeros; None if there are none."""
    zero = (run.voltage == 0.0) & (run.current == 0.0) & (run.speed == 0.0)
    moving = np.flatnonzero(~zero)
    if zero.size - moving.size < _FEWEST or not moving.size:
        return None
    first, last = int(moving[0]), int(moving[-1])
    ends = [(run.speed[first], first), (run.speed[last], zero.size - 1 - last)]
    steps = np.abs(np.diff(run.speed[first : last + 1]))
    usual = float(np.max(steps, initial=0.0)) + _NEAR * noise_of(run.speed[first : last + 1])
    jump = max((abs(float(speed)) for speed, rows in ends if rows >= _FEWEST), default=0.0)
    if not jump > usual:
        return None
    padded = np.ones(zero.size, dtype=bool)
    padded[first : last + 1] = False
    return omission(
        run,
        padded,
        "padded_run",
        "speed_rad_s",
        "jumps to or from zero, and voltage, current and speed are exactly zero beyond: the rows "
        "were filled with zeros and are no measurement",
        ("jump relative to the largest other change between samples", jump / usual, 1.0),
        remedy="stop the export where the recording stops",
    )
