"""Exact rise time, settling time, peak and overshoot of closed-loop step responses.

A time grid is only as accurate as its spacing: one widely used grid-based routine is 1.6 percent
off for the source's hot motor.  Here the response is divided into monotone pieces, and each event
is the root of the exact response on one piece (`_Turns`).

The search for first crossings and the peak runs forwards from zero.  The search for the last entry
into the settling band runs backwards from a time after which an envelope keeps the response inside.
Each draw stops as soon as its result is known.  All values are relative to the final value:
e(t) = y(t) / y_final - 1.

The pieces end at the zeros of the derivative w(t), a sum of n exponential modes.  By Rolle's
theorem the zeros of w are separated by those of a sum of fewer modes: for a real pole p by the
zeros of (D - p) w, D = d/dt, because exp(-p t) w is monotone between them.  For a complex pair with
imaginary part omega the same holds in two steps within windows of length pi / omega (Polya).  From
the single mode that is left, which has no zero, each sum brackets the next:

    one mode           0 ------------------------------------- window
    two modes          0 ------------- z1 -------------------- window
    three modes, w     0 ----- z1 ------------- z2 ----------- window

Source: Polya, Transactions of the American Mathematical Society 24 (1922), 312-324 (factorization
of linear differential operators, and Rolle's theorem for them).
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Final

import numpy as np

from identification.arrays import Array, Bool, Index
from identification.speed_loop.loop import Loop
from identification.speed_loop.metrics import BAND, RISE, StepMetrics
from identification.speed_loop.modes import Modes, bound_at, time_below
from identification.speed_loop.roots import monic_roots, root

__all__ = ["StepResponse", "step_metrics"]


# A smaller relative excess over the final value is rounding, not overshoot.
_LEAST_OVERSHOOT: Final = 1e-9
_MOST_WINDOWS: Final = 210
"""Largest number of windows that are searched: 100 oscillations."""
# Length of a window over pi / omega.  Below 1, u of `_wronskian` is positive at both ends too, so
# that a zero at an end, as w(0) = 0, counts in Rolle's theorem.
_SHARE: Final = 0.95
# A pair that has decayed by exp(-80) moves no zero of the other modes.
_DECAYED: Final = 80.0


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
        """True if all poles of each loop have a negative real part, (n_loop,)."""
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
        self.turns = _Turns(rate)
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
                value = self.error.at(time, rows)
                higher = value > np.maximum(excess[rows], _LEAST_OVERSHOOT)
                excess[rows[higher]], peak_time[rows[higher]] = value[higher], time[higher]
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


class _Turns:
    """Zeros of the derivative w(t) of step responses, window by window.

    All loops have equally many complex poles, in the order of `monic_roots`.
    """

    def __init__(self, rate: Modes) -> None:
        n_pole = rate.poles.shape[1]
        n_real = int((rate.poles[0].imag == 0).sum())
        self.pairs = rate.poles[:, n_real::2]
        tails = [rate.tail(k) for k in range(n_pole)]
        # From the last, fastest pair to w.  The very first sum has no zero within a window.
        self.levels: list[tuple[_Sum, int | None]] = []
        for pair, k in reversed(list(enumerate(range(n_real, n_pole, 2)))):
            frequency = self.pairs[:, pair].imag
            self.levels += [(_wronskian(tails[k], tails[k + 1], frequency), pair)]
            self.levels += [(_value(tails[k]), pair)]
        self.levels += [(_value(tails[k]), None) for k in reversed(range(n_real))]
        del self.levels[0]
        with np.errstate(divide="ignore"):
            decayed = _DECAYED / -self.pairs.real
        self.last = np.minimum(decayed, _last_turn(rate)[:, None])

    def window_end(self, left: Array, rows: Index) -> Array:
        """End of the longest window from `left`; infinite if no pair oscillates any more."""
        half_period = _SHARE * np.pi / self.pairs[rows].imag
        lengths = np.where(left[:, None] < self.last[rows], half_period, np.inf)
        return np.asarray(left + lengths.min(axis=1, initial=np.inf))

    def window_begin(self, right: Array, rows: Index) -> Array:
        """Begin of the longest window up to `right`, at least 0."""
        last, half_period = self.last[rows], _SHARE * np.pi / self.pairs[rows].imag
        begins = np.where(right[:, None] <= last, right[:, None] - half_period, last)
        return np.asarray(begins.max(axis=1, initial=0.0))

    def between(self, left: Array, right: Array, rows: Index) -> list[Array]:
        """`left`, all zeros of w in a window in ascending order, and `right`, also as filler."""
        points = [left, right]
        for level, pair in self.levels:
            rings = True if pair is None else left < self.last[rows, pair]
            signs = [np.sign(level(time, rows, left)) for time in points]
            zeros = []
            for k, (begin, end) in enumerate(pairwise(points)):
                has = (signs[k] * signs[k + 1] < 0) & rings & (begin < end)
                zero = right.copy()
                zero[has] = root(level, (begin[has], end[has]), (rows[has], left[has]))
                zeros.append(zero)
            points = [left, *np.sort(zeros, axis=0), right]
        return points


_Sum = Callable[[Array, Index, Array], Array]
"""Function of time, loop and begin of the window."""


def _value(modes: Modes) -> _Sum:
    return lambda time, loop, begin: modes.at(time, loop)


def _wronskian(modes: Modes, without: Modes, frequency: Array) -> _Sum:
    """Wronskian h' u - h u' over exp(2 sigma t); between its zeros h / u is monotone.

    u = exp(sigma t) sin(omega (t - begin) + phase) is positive in the window, h is `modes`, and
    `without` is (D - sigma - j omega) h.
    """

    def value(time: Array, loop: Index, begin: Array) -> Array:
        angle = frequency[loop] * (time - begin) + 0.5 * (1 - _SHARE) * np.pi
        rate = without.complex_at(time, loop).real
        return np.asarray(
            rate * np.sin(angle) - modes.at(time, loop) * frequency[loop] * np.cos(angle)
        )

    return value


def _last_turn(rate: Modes) -> Array:
    """Time after which the slowest mode dominates all others, so that no extremum follows [s].

    Infinite if the slowest mode oscillates.
    """
    rows = np.arange(rate.poles.shape[0])
    slowest = rate.poles.real.argmax(axis=1)
    weights = np.abs(rate.residues)
    gaps = rate.poles.real[rows, slowest][:, None] - rate.poles.real
    others = np.arange(rate.poles.shape[1]) != slowest[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (others.shape[1] - 1) * weights / weights[rows, slowest][:, None]
        times = np.where(others, np.log(share) / gaps, 0.0).max(axis=1)
    is_real = rate.poles.imag[rows, slowest] == 0
    return np.where(is_real & np.isfinite(times), np.maximum(times, 0.0), np.inf)
