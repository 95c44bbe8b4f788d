"""Exact rise time, settling time, peak and overshoot of closed-loop step responses.

A time grid is only as accurate as its spacing: one widely used grid-based routine is 1.6 percent
off for the source's hot motor.  Here the response is divided into monotone pieces, and each event
is the root of the exact response on one piece.

The pieces follow from the derivative w(t) of the response, a sum of two or three modes.  The
product exp(-q t) w(t), with q the real pole, has a derivative of two modes only, whose zeros
("knots") are known in closed form: equally spaced for a complex pair of poles, at most one for two
real poles.  Between knots exp(-q t) w is monotone, so w has at most one zero there, bracketed by
the knots (Rolle).  In loops of two poles the knots themselves are the extrema.

    knots    0 ------ k1 -------- k2 -------- k3 ---
    extrema       z1       z2          z3             at most one between two knots

The search for first crossings and the peak runs forwards from zero.  The search for the last entry
into the settling band runs backwards from a time after which an envelope keeps the response inside.
Each draw stops as soon as its result is known.  All values are relative to the final value:
e(t) = y(t) / y_final - 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import elementwise

from identification.feedback.envelope import bound_at, time_below
from identification.feedback.loop import Loop
from identification.feedback.modes import Modes
from identification.feedback.roots import monic_roots

__all__ = ["StepCharacteristics", "StepResponse", "step_characteristics"]

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]
Index = NDArray[np.intp]

_RISE: Final = (0.1, 0.9)
_BAND: Final = 0.02
# A smaller relative excess over the final value is rounding, not overshoot.
_LEAST_OVERSHOOT: Final = 1e-9
_MOST_PIECES: Final = 200
"""Largest number of pieces between knots that are searched: 100 oscillations."""


@dataclass(frozen=True)
class StepCharacteristics:
    """Metrics of step responses; each (n_loop,), NaN if undefined.

    Times and peak are also NaN if 100 oscillations do not determine them.

    Args:
        is_stable: Whether all closed-loop poles have a negative real part.
        rise_time: Time from the first crossing of 10 % to the first of 90 % of the final value [s].
        settling_time: Last entry into the 2 % band around the final value [s].
        peak: Largest value, in the direction of the final value; without overshoot the final value
            itself, which is approached and never exceeded [rad/s].
        peak_time: Time of the peak; NaN without overshoot [s].
        overshoot: Excess of the peak over the final value; exactly 0 if no extremum exceeds it [%].
        steady_state: Final value [rad/s].
    """

    is_stable: Bool
    rise_time: Array
    settling_time: Array
    peak: Array
    peak_time: Array
    overshoot: Array
    steady_state: Array


class StepResponse:
    """Exact responses of the speed to a reference step of 1 rad/s.

    Args:
        loop: The loops; they may be unstable.
    """

    def __init__(self, loop: Loop) -> None:
        closed = loop.closed_denominator
        self.final = loop.final_value
        self.poles = monic_roots(closed)
        self._speed_rate = Modes.of(loop.numerator, self.poles)
        # y - y_final has the transform (N - y_final D) / (s D), D the closed denominator; its
        # numerator has no constant term, so s cancels.
        shifted = -self.final[:, None] * closed
        shifted[:, 1:] += loop.numerator
        self._error = Modes.of(shifted[:, :-1], self.poles)

    @property
    def is_stable(self) -> Bool:
        """Whether all poles of each loop have a negative real part, (n_loop,)."""
        return np.asarray((self.poles.real < 0).all(axis=1))

    def at(self, time: Array) -> Array:
        """Speed of every loop at every time.

        Args:
            time: (n_time,) [s].

        Returns:
            (n_loop, n_time) [rad/s].
        """
        loops = np.arange(self.final.size)[:, None]
        with np.errstate(over="ignore", invalid="ignore"):
            return self.final[:, None] + self._error.at(np.asarray(time)[None, :], loops)

    def relative(self, rows: Bool) -> _RelativeResponse:
        """Selected stable responses, divided by their final values."""
        scale = self.final[rows, None]
        return _RelativeResponse(
            Modes.of(self._error.numerator[rows] / scale, self.poles[rows]),
            Modes.of(self._speed_rate.numerator[rows] / scale, self.poles[rows]),
        )


def step_characteristics(response: StepResponse) -> StepCharacteristics:
    """Metrics of each step response.

    Args:
        response: The responses; all metrics of unstable ones are NaN.
    """
    is_stable = response.is_stable
    usable = is_stable & np.isfinite(response.final) & (response.final != 0)
    columns = np.full((4, usable.size), np.nan)
    if usable.any():
        columns[:, usable] = response.relative(usable).events()
    rise, settling, excess, peak_time = columns
    return StepCharacteristics(
        is_stable=is_stable,
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
        self.rate = rate
        self.size = error.poles.shape[0]
        self.first_knot, self.spacing, self.knot_count = _knots(rate)
        self.horizon = time_below(error, _LEAST_OVERSHOOT)

    def events(self) -> tuple[Array, Array, Array, Array]:
        """Rise time, settling time, peak excess relative to the final value, and peak time."""
        crossing, excess, peak_time = self._forwards()
        return crossing[1] - crossing[0], self._settling(), excess, peak_time

    def _knot(self, number: Index, rows: Index) -> Array:
        """Time of the knot with index `number`, from 0; infinite if there is none."""
        with np.errstate(invalid="ignore"):
            further = self.first_knot[rows] + number * self.spacing[rows]
        time = np.where(number == 0, self.first_knot[rows], further)
        return np.where(number < self.knot_count[rows], time, np.inf)

    def _forwards(self) -> tuple[Array, Array, Array]:
        crossing = np.full((2, self.size), np.nan)
        excess, peak_time = np.zeros(self.size), np.full(self.size, np.nan)
        left, rows, number = np.zeros(self.size), np.arange(self.size), 0
        while rows.size:
            right = np.minimum(self._knot(np.full(rows.size, number), rows), self.horizon[rows])
            turn = self._turning(left, right, rows)
            for piece in ((left, turn), (turn, right)):
                self._cross(piece, rows, crossing)
            for time in (turn, np.where(right < self.horizon[rows], right, np.inf)):
                self._raise_peak(time, rows, excess, peak_time)
            is_highest = bound_at(self.error, right, rows) <= np.maximum(
                excess[rows], _LEAST_OVERSHOOT
            )
            is_found = np.isfinite(crossing[:, rows]).all(axis=0)
            going = ~(is_found & is_highest) & (right < self.horizon[rows])
            left, rows, number = right[going], rows[going], number + 1
            if number == _MOST_PIECES:
                # Nearly undamped: results not found by now are undefined.
                excess[rows] = peak_time[rows] = np.nan
                break
        return crossing, excess, peak_time

    def _turning(self, left: Array, right: Array, rows: Index) -> Array:
        """Zero of the derivative in each open interval, or the right end if there is none."""
        begin, end = self.rate.at(left, rows), self.rate.at(right, rows)
        turning = right.copy()
        has = (np.sign(begin) * np.sign(end) < 0) & (left < right)
        turning[has] = _root(self.rate.at, (left[has], right[has]), rows[has])
        return turning

    def _cross(self, piece: tuple[Array, Array], rows: Index, crossing: Array) -> None:
        """Store the first crossings that lie in monotone pieces."""
        begin, end = (self.error.at(time, rows) for time in piece)
        for k, share in enumerate(_RISE):
            level = share - 1
            has = np.isnan(crossing[k, rows]) & (begin < level) & (end >= level)
            bracket = piece[0][has], piece[1][has]
            crossing[k, rows[has]] = self._reaches(level, bracket, rows[has])

    def _reaches(self, level: float | Array, bracket: tuple[Array, Array], rows: Index) -> Array:
        """Time at which e(t) has the value `level` (scalar or one per loop) in monotone pieces."""
        levels = np.broadcast_to(level, self.size)
        return _root(lambda time, row: self.error.at(time, row) - levels[row], bracket, rows)

    def _raise_peak(self, time: Array, rows: Index, excess: Array, peak_time: Array) -> None:
        at = np.isfinite(time)
        value = np.full(rows.size, -np.inf)
        value[at] = self.error.at(time[at], rows[at])
        higher = value > np.maximum(excess[rows], _LEAST_OVERSHOOT)
        excess[rows[higher]], peak_time[rows[higher]] = value[higher], time[higher]

    def _settling(self) -> Array:
        settling = np.zeros(self.size)
        right, rows = time_below(self.error, _BAND), np.arange(self.size)
        with np.errstate(invalid="ignore", divide="ignore"):
            passed = np.ceil((right - self.first_knot) / self.spacing)
        passed = np.where(np.isfinite(self.spacing), passed, right > self.first_knot)
        number, pieces = np.clip(passed, 0, self.knot_count).astype(np.intp), 0
        while rows.size:
            left = np.where(number > 0, self._knot(number - 1, rows), 0.0)
            left = np.minimum(left, right)
            turn = self._turning(left, right, rows)
            outside_turn = np.abs(self.error.at(turn, rows)) > _BAND
            outside_left = np.abs(self.error.at(left, rows)) > _BAND
            begin, end = np.where(outside_turn, turn, left), np.where(outside_turn, right, turn)
            has = outside_turn | outside_left
            settling[rows[has]] = self._enters(begin[has], end[has], rows[has])
            going = ~has & (number > 0)
            right, rows, number = left[going], rows[going], number[going] - 1
            pieces += 1
            if pieces == _MOST_PIECES:
                settling[rows] = np.nan
                break
        return settling

    def _enters(self, begin: Array, end: Array, rows: Index) -> Array:
        """Time at which a monotone piece that begins outside the band enters it."""
        side = np.zeros(self.size)
        side[rows] = np.sign(self.error.at(begin, rows)) * _BAND
        return self._reaches(side, (begin, end), rows)


def _knots(rate: Modes) -> tuple[Array, Array, Array]:
    """First zero, spacing and number of the zeros of the last two modes of `rate`.

    With poles p, r and weights a, b, the sum a f[p] + b f[p, r] vanishes at
    tan(omega t) = -a omega / b for a complex pair of imaginary part omega, and at
    (exp((r - p) t) - 1) / (r - p) = -a / b for a real pair.
    """
    a, b = rate.weights[:, -2].real, rate.weights[:, -1].real
    upper, lower = rate.poles[:, -2], rate.poles[:, -1]
    frequency, gap = upper.imag, (lower - upper).real
    with np.errstate(divide="ignore", invalid="ignore"):
        angle = np.arctan2(-a * frequency, b) % np.pi
        angle = np.where(angle == 0, np.pi, angle)
        ratio = -a / b
        single = np.where(gap == 0, ratio, np.log1p(np.maximum(gap * ratio, -1)) / gap)
        has_single = np.isfinite(single) & (single > 0)
        oscillates = frequency > 0
        first = np.where(oscillates, angle / frequency, np.where(has_single, single, np.inf))
        spacing = np.where(oscillates, np.pi / frequency, np.inf)
        many = np.floor((_last_turn(rate) - first) / spacing) + 1
    count = np.where(oscillates, np.nan_to_num(many, nan=np.inf).clip(min=0), 1.0 * has_single)
    # The limit fits an integer index and is never reached.
    return first, spacing, np.minimum(count, 2.0**62)


def _last_turn(rate: Modes) -> Array:
    """Time after which the real mode dominates the oscillation, so that no extremum follows [s].

    Infinite if the oscillation decays more slowly, or if there is no real mode.
    """
    if rate.poles.shape[1] == 2:
        return np.full(rate.poles.shape[0], np.inf)
    weight = np.abs(rate.residues())
    faster = rate.poles[:, 0].real - rate.poles[:, 1].real
    with np.errstate(divide="ignore", invalid="ignore"):
        time = np.log(2 * weight[:, 1] / weight[:, 0]) / faster
    return np.where((faster > 0) & np.isfinite(time), np.maximum(time, 0.0), np.inf)


def _root(
    function: Callable[[Array, Index], Array], bracket: tuple[Array, Array], rows: Index
) -> Array:
    """Roots in brackets with a change of sign, to machine precision."""
    if not rows.size:
        return np.empty(0)
    # The search may divide by a zero difference; it then falls back to bisection.
    with np.errstate(all="ignore"):
        found = elementwise.find_root(function, bracket, args=(rows,))
    return np.asarray(found.x)
