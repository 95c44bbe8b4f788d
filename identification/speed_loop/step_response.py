"""Exact rise time, settling time, peak and overshoot of closed-loop step responses.

A time grid is only as accurate as its spacing: one widely used grid-based routine is 1.6 percent
off for the source's hot motor.  Here the response is divided into monotone pieces, and each event
is the root of the exact response on one piece (`turns`).

The search for first crossings and the peak runs forwards from zero.  The search for the last entry
into the settling band runs backwards from a time after which an envelope keeps the response inside.
Each draw stops as soon as its result is known.  All values are relative to the final value:
e(t) = y(t) / y_final - 1.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array
from identification.speed_loop.loop import Loop
from identification.speed_loop.metrics import BAND, RISE, StepMetrics
from identification.speed_loop.modes import Modes, bound_at, time_below
from identification.speed_loop.roots import monic_roots, root
from identification.speed_loop.turns import Turns

__all__ = ["StepResponse", "step_metrics"]

Bool = NDArray[np.bool_]
Index = NDArray[np.intp]

# A smaller relative excess over the final value is rounding, not overshoot.
_LEAST_OVERSHOOT: Final = 1e-9
_MOST_WINDOWS: Final = 210
"""Largest number of windows that are searched: 100 oscillations."""


class StepResponse:
    """Exact responses of the speed to a reference step of 1 rad/s, of stable loops or not."""

    def __init__(self, loop: Loop) -> None:
        closed = loop.closed_denominator
        self.final = loop.final_value
        self.poles = monic_roots(closed)
        self._speed_rate = Modes.of(loop.closed_numerator, self.poles)
        # y - y_final has the transform (Nr - y_final D) / (s D), D the closed denominator; its
        # numerator has no constant term, so s cancels.
        shifted = -self.final[:, None] * closed
        shifted[:, 1:] += loop.closed_numerator
        self._error = Modes.of(shifted[:, :-1], self.poles)

    @property
    def is_stable(self) -> Bool:
        """Whether all poles of each loop have a negative real part, (n_loop,)."""
        return np.asarray((self.poles.real < 0).all(axis=1))

    def at(self, time: Array) -> Array:
        """Speed of every loop at every time (n_time,) [s], (n_loop, n_time) [rad/s]."""
        loops = np.arange(self.final.size)[:, None]
        with np.errstate(over="ignore", invalid="ignore"):
            return self.final[:, None] + self._error.at(np.asarray(time)[None, :], loops)

    def relative(self, rows: Bool) -> _RelativeResponse:
        """Selected stable responses of equally many complex poles, over their final values."""
        final = self.final[rows]
        return _RelativeResponse(
            self._error.selected(rows, final), self._speed_rate.selected(rows, final)
        )


def step_metrics(response: StepResponse) -> StepMetrics:
    """Metrics of each step response.

    All metrics of unstable ones are NaN; times and peak also if 100 oscillations do not determine
    them.
    """
    is_stable = response.is_stable
    usable = is_stable & np.isfinite(response.final) & (response.final != 0)
    columns = np.full((4, usable.size), np.nan)
    complex_count = (response.poles.imag != 0).sum(axis=1)
    for count in np.unique(complex_count[usable]):
        rows = usable & (complex_count == count)
        columns[:, rows] = response.relative(rows).events()
    rise, settling, excess, peak_time = columns
    return StepMetrics(
        rise_time=rise,
        settling_time=settling,
        peak=response.final * (1 + excess),
        peak_time=peak_time,
        overshoot=100 * excess,
        steady_state=np.where(is_stable, response.final, np.nan),
    )


class _RelativeResponse:
    """Stable step responses relative to their final values, as e(t) and its derivative."""

    def __init__(self, error: Modes, rate: Modes) -> None:
        self.error = error
        self.size = error.poles.shape[0]
        self.turns = Turns(rate)
        self.horizon = time_below(error, _LEAST_OVERSHOOT)

    def events(self) -> tuple[Array, Array, Array, Array]:
        """Rise time, settling time, peak excess relative to the final value, and peak time."""
        crossing, excess, peak_time = self._forwards()
        return crossing[1] - crossing[0], self._settling(), excess, peak_time

    def _forwards(self) -> tuple[Array, Array, Array]:
        crossing = np.full((2, self.size), np.nan)
        excess, peak_time = np.zeros(self.size), np.full(self.size, np.nan)
        left, rows, windows = np.zeros(self.size), np.arange(self.size), 0
        while rows.size:
            right = np.minimum(self.turns.window_end(left, rows), self.horizon[rows])
            turns = self.turns.between(left, right, rows)
            for piece in pairwise(turns):
                self._cross(piece, rows, crossing)
            for time in turns[1:]:
                self._raise_peak(time, rows, excess, peak_time)
            is_highest = bound_at(self.error, right, rows) <= np.maximum(
                excess[rows], _LEAST_OVERSHOOT
            )
            is_found = np.isfinite(crossing[:, rows]).all(axis=0)
            going = ~(is_found & is_highest) & (right < self.horizon[rows])
            left, rows, windows = right[going], rows[going], windows + 1
            if windows == _MOST_WINDOWS:
                # Nearly undamped: results not found by now are undefined.
                excess[rows] = peak_time[rows] = np.nan
                break
        return crossing, excess, peak_time

    def _cross(self, piece: tuple[Array, Array], rows: Index, crossing: Array) -> None:
        """Store the first crossings that lie in monotone pieces."""
        begin, end = (self.error.at(time, rows) for time in piece)
        for k, share in enumerate(RISE):
            level = share - 1
            has = np.isnan(crossing[k, rows]) & (begin < level) & (end >= level)
            bracket = piece[0][has], piece[1][has]
            crossing[k, rows[has]] = self._reaches(np.full(has.sum(), level), bracket, rows[has])

    def _reaches(self, levels: Array, bracket: tuple[Array, Array], rows: Index) -> Array:
        """Time at which e(t) has the value `levels`, one per row, in monotone pieces."""
        return root(
            lambda time, row, level: self.error.at(time, row) - level, bracket, (rows, levels)
        )

    def _raise_peak(self, time: Array, rows: Index, excess: Array, peak_time: Array) -> None:
        value = self.error.at(time, rows)
        higher = value > np.maximum(excess[rows], _LEAST_OVERSHOOT)
        excess[rows[higher]], peak_time[rows[higher]] = value[higher], time[higher]

    def _settling(self) -> Array:
        settling = np.zeros(self.size)
        right, rows, windows = time_below(self.error, BAND), np.arange(self.size), 0
        while rows.size:
            left = self.turns.window_begin(right, rows)
            turns = np.stack(self.turns.between(left, right, rows))
            values = self.error.at(turns, rows)
            is_outside = np.abs(values[:-1]) > BAND
            has = np.flatnonzero(is_outside.any(axis=0))
            last = is_outside.shape[0] - 1 - is_outside[::-1].argmax(axis=0)[has]
            side = np.sign(values[last, has]) * BAND
            bracket = turns[last, has], turns[last + 1, has]
            settling[rows[has]] = self._reaches(side, bracket, rows[has])
            going = ~is_outside.any(axis=0) & (left > 0)
            right, rows, windows = left[going], rows[going], windows + 1
            if windows == _MOST_WINDOWS:
                settling[rows] = np.nan
                break
        return settling
