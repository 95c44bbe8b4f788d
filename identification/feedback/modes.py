"""Sums of exponential modes in Newton's divided-difference form, for any distance of the poles.

Partial fractions write a response as a sum of c_k exp(p_k t).  For two nearly coincident poles the
weights c_k grow without bound and cancel; for coincident poles the form does not exist.  Newton's
form has no such singularity:

    x(t) = a_1 f[p_1] + a_2 f[p_1, p_2] + a_3 f[p_1, p_2, p_3]          f(p) = exp(p t)

Its divided differences f[...] are smooth in the poles: f[p, p] is t exp(p t).  For separate poles
both forms are equal.  A matrix exponential for each draw and time would be as robust, but two
hundred times slower.

Source: McCurdy, Ng and Parlett, Mathematics of Computation 43 (1984), 501-528 (divided
differences of the exponential).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

__all__ = ["Modes"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Index = NDArray[np.intp]

# Poles closer than 1/t are summed as a series around their mean; the terms decay as 1/k!.
_SERIES_TERMS: Final = 18
_SMALLEST_GAP: Final = 1e-150


@dataclass(frozen=True)
class Modes:
    """Inverse Laplace transforms of N(s) / ((s - p_1) ... (s - p_n)), n = 2 or 3.

    Args:
        poles: (n_loop, n_pole) [1/s].
        numerator: N, (n_loop, n_pole), falling powers from s^(n_pole - 1).
        weights: Coefficients a_1 to a_n of Newton's form, (n_loop, n_pole).
    """

    poles: Complex
    numerator: Array
    weights: Complex

    @classmethod
    def of(cls, numerator: Array, poles: Complex) -> Modes:
        """Sum of modes of a strictly proper fraction, given by numerator and poles."""
        weights = numerator.astype(np.complex128)
        count = poles.shape[1]
        # Repeated synthetic division: by the last pole, then the one before it.
        for last in range(count - 1, 0, -1):
            for k in range(1, last + 1):
                weights[:, k] += weights[:, k - 1] * poles[:, last]
        return cls(poles, numerator, weights)

    def at(self, time: Array, loop: Index) -> Array:
        """Values of the sums.

        Args:
            time: Times, any shape [s].
            loop: Index of the loop for each time, of a shape that broadcasts with `time`.
        """
        poles, weights = self.poles[loop], self.weights[loop]
        first = np.exp(poles[..., 0] * time)
        second = _pair(poles[..., 0], poles[..., 1], time)
        total = weights[..., 0] * first + weights[..., 1] * second
        if poles.shape[-1] == 3:
            total = total + weights[..., 2] * _triple(poles, time)
        return np.asarray(total.real)

    def residues(self) -> Complex:
        """Weights c_k of the partial fractions, (n_loop, n_pole); infinite for coincident poles."""
        value = np.zeros_like(self.poles)
        for k in range(self.numerator.shape[1]):
            value = value * self.poles + self.numerator[:, k, None]
        apart = self.poles[:, :, None] - self.poles[:, None, :]
        apart += np.eye(self.poles.shape[1])
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return np.asarray(value / apart.prod(axis=2))


def _pair(p: Complex, q: Complex, time: Array) -> Complex:
    """f[p, q]; the slower exponential is factored out, so that nothing overflows."""
    slow, fast = np.where(p.real >= q.real, p, q), np.where(p.real >= q.real, q, p)
    z = (fast - slow) * time
    # Complex division overflows on subnormal numbers, where the quotient is 1 to all digits.
    is_zero = np.abs(z) < _SMALLEST_GAP
    ratio = np.where(is_zero, 1.0, np.expm1(z) / np.where(is_zero, 1.0, z))
    return np.asarray(np.exp(slow * time) * time * ratio)


def _triple(poles: Complex, time: Array) -> Complex:
    """f[p_1, p_2, p_3], by recursion on the most distant pair, or by a series if all are close."""
    p, q, r = poles[..., 0], poles[..., 1], poles[..., 2]
    # Put the pole outside the most distant pair into the middle.
    gaps = np.abs(np.stack([q - r, p - r, p - q]))
    widest = gaps.argmax(axis=0)
    left = np.where(widest == 0, q, p)
    right = np.where(widest == 2, q, r)
    middle = np.where(widest == 0, p, np.where(widest == 1, q, r))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        apart = (_pair(left, middle, time) - _pair(middle, right, time)) / (left - right)
    together = gaps.max(axis=0) * time < 1
    if not np.any(together):
        return np.asarray(apart)
    return np.where(together, _series(left, middle, right, time * together), apart)


def _series(p: Complex, q: Complex, r: Complex, time: Array) -> Complex:
    """f[p, q, r] = t^2 exp(m t) sum h_k / (k + 2)!, with m the mean of the poles.

    h_k is the complete homogeneous symmetric polynomial of degree k of the differences (p - m) t.
    """
    mean = (p + q + r) / 3
    x, y, z = (p - mean) * time, (q - mean) * time, (r - mean) * time
    pairs, product = x * y + y * z + z * x, x * y * z
    before, last, newest = np.zeros_like(x), np.zeros_like(x), np.ones_like(x)
    total, factor = newest / 2, 2.0
    for k in range(1, _SERIES_TERMS):
        before, last, newest = last, newest, -pairs * last + product * before
        factor *= k + 2
        total = total + newest / factor
    return np.asarray(time**2 * np.exp(mean * time) * total)
