"""All zeros of the derivative w(t) of a step response, a sum of n exponential modes.

By Rolle's theorem the zeros of w are separated by those of a sum of fewer modes: for a real pole p
by the zeros of (D - p) w, D = d/dt, because exp(-p t) w is monotone between them.  For a complex
pair with imaginary part omega the same holds in two steps within windows of length pi / omega
(Polya).  From the single mode that is left, which has no zero, each sum brackets the next:

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
from numpy.typing import NDArray

from identification.arrays import Array
from identification.speed_loop.modes import Modes
from identification.speed_loop.roots import root

__all__ = ["Turns"]

Index = NDArray[np.intp]

# Length of a window over pi / omega.  Below 1, u of `_wronskian` is positive at both ends too, so
# that a zero at an end, as w(0) = 0, counts in Rolle's theorem.
_SHARE: Final = 0.95
# A pair that has decayed by exp(-80) moves no zero of the other modes.
_DECAYED: Final = 80.0


class Turns:
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
