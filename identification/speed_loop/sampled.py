"""Rise, settling, peak and overshoot of a simulated response, interpolated between its samples.

The simulation gives the speed and its slope, so the response between two samples is the cubic
Hermite polynomial.  Every event is a root of that cubic, with an error of fourth order in the
sample interval; linear interpolation has an error of second order, the nearest sample one of first
order.

The final value is a mean over the last tenth of the response, because the speed of a motor with
cogging oscillates around it.  A Hann window weights the mean: of an oscillation with at least two
periods in it, less than 3 % remain, whatever its phase.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from identification.arrays import Array, Bool, Index
from identification.speed_loop.metrics import BAND, RISE, StepMetrics

__all__ = ["ends", "is_at_rest", "sampled_metrics"]


_LAST: Final = 0.1
_LEAST_FINAL: Final = 0.01
# Accuracy of the simulation.
_LEAST_OVERSHOOT: Final = 1e-4
_STILL: Final = 1e-3
_HALVINGS: Final = 40


def is_at_rest(speed: Array) -> Bool:
    """True if each response (n_time, n_loop), sampled uniformly, has settled at its final value."""
    last, before = ends(speed)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(last - before) <= _STILL * np.maximum(np.abs(last), _LEAST_FINAL))


def sampled_metrics(
    time: Array, speed: Array, slope: Array, final: Array | None = None
) -> StepMetrics:
    """Metrics of simulated step responses; the settling time is NaN if a response does not settle.

    The time (n_time,) is uniform from 0 [s], the speed (n_time, n_loop) divided by the step [-],
    the slope its time derivative [1/s].  Final values (n_loop,) [-] that are not known are taken
    from the responses.
    """
    final = ends(speed)[0] if final is None else final
    usable = np.isfinite(speed).all(axis=0) & (np.abs(final) > _LEAST_FINAL)
    columns = np.full((5, final.size), np.nan)
    if usable.any():
        scale = final[usable]
        response = _Response(time, speed[:, usable] / scale, slope[:, usable] / scale)
        columns[:, usable] = (*response.rise(), response.settling(), *response.peak())
    first, second, settling, excess, peak_time = columns
    return StepMetrics(
        rise_time=second - first,
        settling_time=settling,
        peak=final * (1 + excess),
        peak_time=peak_time,
        overshoot=100 * excess,
        steady_state=np.where(np.isfinite(speed).all(axis=0), final, np.nan),
    )


def ends(speed: Array) -> tuple[Array, Array]:
    """Means of responses (n_time, n_loop) over the last tenth and over the tenth before it."""
    count = max(2, int(_LAST * speed.shape[0]))
    weight = np.hanning(count + 2)[1:-1] / np.hanning(count + 2)[1:-1].sum()
    with np.errstate(invalid="ignore", over="ignore"):
        return weight @ speed[-count:], weight @ speed[-2 * count : -count]


class _Response:
    """Responses divided by their final values, as cubic polynomials between samples."""

    def __init__(self, time: Array, value: Array, slope: Array) -> None:
        self.time, self.value = time, value
        self.interval = float(time[1] - time[0])
        self.slope = slope * self.interval
        self.loops = np.arange(value.shape[1])

    def rise(self) -> tuple[Array, Array]:
        """First crossings of 10 % and of 90 %, NaN if there is none [s]."""
        first, second = (self._crossing(self.value >= level, level) for level in RISE)
        return first, second

    def settling(self) -> Array:
        """Time of the last entry into the band; NaN if the last tenth leaves the band [s]."""
        outside = np.abs(self.value - 1) > BAND
        last = outside.shape[0] - 1 - np.argmax(outside[::-1], axis=0)
        last = np.where(outside.any(axis=0), last, 0)
        ended = last < (1 - _LAST) * (outside.shape[0] - 1)
        at = np.minimum(last, outside.shape[0] - 2)
        side = 1 + BAND * np.sign(self.value[at, self.loops] - 1)
        return np.where(ended, self._root(at, side), np.nan)

    def peak(self) -> tuple[Array, Array]:
        """Excess of the peak over the final value [-], and its time [s]."""
        top = np.argmax(self.value, axis=0)
        excess = self.value[top, self.loops] - 1
        time = self.time[top]
        for begin in (top - 1, top):
            # The maximum lies in the interval before or after the highest sample.
            at = np.clip(begin, 0, self.value.shape[0] - 2)
            position = self._turning(at)
            value = self._at(at, position) - 1
            higher = value > excess
            excess = np.where(higher, value, excess)
            time = np.where(higher, self.time[at] + position * self.interval, time)
        passes = excess > _LEAST_OVERSHOOT
        return np.where(passes, excess, 0.0), np.where(passes, time, np.nan)

    def _crossing(self, reached: Bool, level: float) -> Array:
        first = np.argmax(reached, axis=0)
        found = reached.any(axis=0) & (first > 0)
        return np.where(found, self._root(np.maximum(first - 1, 0), level), np.nan)

    def _root(self, at: Index, level: Array | float) -> Array:
        """Time at which the cubic of interval `at` has the value `level`, by bisection [s]."""
        low, high = np.zeros(at.size), np.ones(at.size)
        begin = np.sign(self._at(at, low) - level)
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            before = np.sign(self._at(at, middle) - level) == begin
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        return self.time[at] + high * self.interval

    def _parts(self, at: Index) -> tuple[Array, Array, Array, Array]:
        """Coefficients of the cubic of interval `at`, rising powers."""
        y0, y1 = self.value[at, self.loops], self.value[at + 1, self.loops]
        s0, s1 = self.slope[at, self.loops], self.slope[at + 1, self.loops]
        return y0, s0, 3 * (y1 - y0) - 2 * s0 - s1, 2 * (y0 - y1) + s0 + s1

    def _at(self, at: Index, position: Array) -> Array:
        a, b, c, d = self._parts(at)
        return np.asarray(a + position * (b + position * (c + position * d)))

    def _turning(self, at: Index) -> Array:
        """Position of the maximum of the cubic in interval `at`, 0 if it has none [-]."""
        _, b, c, d = self._parts(at)
        with np.errstate(all="ignore"):
            root = np.sqrt(np.maximum(c * c - 3 * b * d, 0.0))
            position = np.where(c > 0, -(c + root) / (3 * d), b / (root - c))
        return np.where(np.isfinite(position), np.clip(position, 0.0, 1.0), 0.0)
